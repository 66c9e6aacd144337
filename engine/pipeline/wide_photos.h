// Photos that see more than one pinhole picture can show: panoramas, and fisheyes whose cameras are
// known.
#ifndef LITAGS_ENGINE_PIPELINE_WIDE_PHOTOS_H_
#define LITAGS_ENGINE_PIPELINE_WIDE_PHOTOS_H_

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/io/sparse_model.h"
#include "engine/io/wide_lens.h"
#include "engine/pipeline/engine.h"

namespace litags {

struct WidePhoto {
  std::string name = "";
  std::string kind = "";  // "panorama", "part of a panorama", "fisheye"
  WideLens lens = {};
  std::vector<CubeView> views = {};  // that it shows something of
  int camera = -1;                   // index into WidePhotos::cameras.views
};

struct WidePhotos {
  std::vector<WidePhoto> photos;   // by name
  SparseModel cameras;             // of all photos, if cameras are given
  std::vector<std::string> notes;  // on reading them
};

// Of these photos in input.images_dir. Without given cameras: those whose metadata say that they
// are an equirectangular panorama or a part of one, and those of the whole sphere whose edges tell.
// A part that is too small to fill a view stays a photo.
// With given cameras: those that are said to be panoramas of the whole sphere, and fisheyes that
// see farther than kWidestPinhole; of a circle with black around it, no more than the circle.
// Files and cameras that cannot be read are left to those who need them. INVALID_ARGUMENT
// (CAMERA_SIZE_MISMATCH) for a panorama of other sides than 2 to 1; CANCELLED.
absl::StatusOr<WidePhotos> FindWidePhotos(const ReconstructInput& input,
                                          const std::vector<std::string>& names, int threads,
                                          const CancelToken& cancel);

// Whether the metadata of a photo of this size say that it is a panorama, or a part that fills a
// view.
bool StatesViews(std::string_view bytes, int width, int height);

// Whether a fisheye among them sees farther than kWidestPinhole.
bool HasWideFisheye(const SparseModel& cameras);

// "2 photos are fisheyes, such as a.jpg: 5 views of each are the photos", a line for each kind; of
// one photo "a.jpg is a fisheye: ...".
std::vector<std::string> DescribeWidePhotos(const std::vector<WidePhoto>& photos);

// Radius, px from the principal point, of the circle that photos of one fisheye show with black
// around; infinite: they show none, or it cannot be told from noise.
// `read(i)`: the i-th of so many photos, one after the other; nullopt: without it.
double FindCircle(size_t photos, absl::FunctionRef<std::optional<Photo>(size_t)> read,
                  const Camera& camera);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_WIDE_PHOTOS_H_
