// Which file belongs to which photo, by their names.
#ifndef LITAGS_ENGINE_CORE_PHOTO_NAMES_H_
#define LITAGS_ENGINE_CORE_PHOTO_NAMES_H_

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/types/span.h"

namespace litags {

// Without the part after the last dot.
std::string WithoutEnding(const std::string& name);

class PhotoNames {
 public:
  explicit PhotoNames(absl::Span<const std::string> photos);

  // The photo called `name`, else the photo called `name` without its ending. Empty: several are
  // called so without their endings; nullopt: none is.
  std::optional<std::string> Find(const std::string& name) const;

 private:
  std::set<std::string> names_;
  std::map<std::string, std::string> by_stem_;  // empty: several photos
};

// How closely one of several paths names a photo: 2 whole, 1 but for the ending, 0 not at all.
// `has`: whether a key (NameKey) is among those of the paths (KeysOf in engine/io).
int HowNamed(const std::string& photo, absl::FunctionRef<bool(const std::string& key)> has);

// What a photo's depth map may be called, best first: <photo's whole name>.npy, .pfm, .png, then
// <photo's stem>.npy, .pfm, .png, each ending also as .NPY. A PNG beside another may be a picture
// of it.
std::vector<std::string> DepthMapNames(const std::string& photo);

// `map`: the first of DepthMapNames(photo) that there is. INVALID_ARGUMENT (DEPTH_MAP_AMBIGUOUS) if
// it may be another photo's, too.
absl::Status CheckDepthMapIsOf(const std::string& photo, const std::string& map,
                               const PhotoNames& photos, const std::string& field);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_PHOTO_NAMES_H_
