// Inside this module: what both camera file formats have to check and finish.
#ifndef LITAGS_ENGINE_IO_MODEL_UTIL_H_
#define LITAGS_ENGINE_IO_MODEL_UTIL_H_

#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

// One camera on its way from a file; `source_id` is the file's own number for it.
struct LoadedView {
  View view;
  Distortion distortion;
  size_t source_id = 0;
};

// Checks every camera, name and coefficient, sorts by name and refuses double names. `order`, if
// not null, receives the source ids in the order of the model's views.
absl::StatusOr<SparseModel> FinishModel(std::vector<LoadedView> views, std::string_view field,
                                        std::vector<size_t>* order);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_MODEL_UTIL_H_
