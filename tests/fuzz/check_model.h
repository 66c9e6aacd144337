#ifndef LITAGS_TESTS_FUZZ_CHECK_MODEL_H_
#define LITAGS_TESTS_FUZZ_CHECK_MODEL_H_

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/check.h"
#include "engine/io/colmap_io.h"
#include "engine/io/sparse_model.h"

namespace litags {

// What whoever uses a model that was read relies on.
inline void CheckModel(const SparseModel& model) {
  LITAGS_CHECK(model.distortions.size() == model.views.size());
  for (const SparsePoint& point : model.points) {
    for (const TrackElement& seen : point.track) {
      LITAGS_CHECK(seen.view >= 0 && static_cast<size_t>(seen.view) < model.views.size());
    }
  }
}

// COLMAP's files by themselves, as they are uploaded: those of a model that is read pass, unless
// none of its cameras is of a picture of its size.
inline void CheckParts(const std::vector<std::string>& files, const std::string& ending,
                       const absl::StatusOr<SparseModel>& model) {
  const bool cameras = CheckColmapFile("cameras" + ending, files[0], "cameras").ok();
  const bool images = CheckColmapFile("images" + ending, files[1], "images").ok();
  const bool points = CheckColmapFile("points3D" + ending, files[2], "points").ok();
  if (!model.ok()) return;
  LITAGS_CHECK(images && points);
  for (const View& view : model->views) {
    LITAGS_CHECK(cameras || !CheckIntrinsics(view.camera, "camera").ok());
  }
}

}  // namespace litags

#endif  // LITAGS_TESTS_FUZZ_CHECK_MODEL_H_
