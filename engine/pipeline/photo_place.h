// What errors call a photo of a reconstruction, and where it is.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_PLACE_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_PLACE_H_

#include <string>

#include "absl/strings/str_cat.h"
#include "engine/pipeline/engine.h"

namespace litags {

inline std::string PhotoField(const std::string& name) {
  return absl::StrCat("images[", name, "]");
}

inline std::string PhotoPath(const ReconstructInput& input, const std::string& name) {
  return absl::StrCat(input.images_dir, "/", name);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_PLACE_H_
