// Cameras of Bundler: bundle.out and its list of photos. COLMAP and RealityScan write them, too.
#ifndef LITAGS_ENGINE_IO_BUNDLER_IO_H_
#define LITAGS_ENGINE_IO_BUNDLER_IO_H_

#include <set>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

bool IsBundler(std::string_view text);

// `text`: bundle.out followed by its list, a photo a line, which it does not hold itself. Cameras
// with a focal length of 0 were not placed. The principal point is the photo's middle, the lens
// 1 + k1 r^2 + k2 r^4. Points only tell which size a camera's photo has: that of `sizes` or that
// turned by 90 degrees, as of a photo before EXIF turns it. `sure`, if not null, receives the
// names, as the list has them, of photos for which one of these is certain. INVALID_ARGUMENT naming
// field and camera: BAD_BUNDLE, CAMERA_SIZE_MISMATCH (points beyond the photo).
absl::StatusOr<SparseModel> ParseBundler(std::string_view text, std::string_view field,
                                         const PhotoSizes& sizes,
                                         std::set<std::string>* sure = nullptr);

// The list that belongs to a bundle.out: NAME.list.txt beside NAME.out and NAME.bundle.out, as
// COLMAP calls it, else list.txt, else the only *.lst there (RealityScan). Empty if there is none.
std::string BundlerListOf(const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_BUNDLER_IO_H_
