// Coarse-to-fine training: the first iterations see smaller photos, which cost a quarter or a
// sixteenth and need fewer Gaussians. The idea of tying resolution to progress is DashGaussian's
// (Chen et al., CVPR 2025); the schedule is ours.
#ifndef LITAGS_ENGINE_TRAIN_PYRAMID_H_
#define LITAGS_ENGINE_TRAIN_PYRAMID_H_

#include <cstdint>
#include <vector>

#include "engine/train/crop.h"
#include "engine/train/options.h"
#include "engine/train/train_view.h"

namespace litags {

// The view at half its size: means of 2x2 pixels; an odd last row or column is left out. Depth and
// confidence are means over known pixels, unless the map is small already. A pixel counts if all
// four do (ChangeMask says why). HalfPhoto and HalfMask do the same to a part of it; an empty mask
// stays empty.
TrainView HalfSize(const TrainView& view);
Photo HalfPhoto(const Photo& photo);
PlaneU8 HalfMask(const PlaneU8& mask);

// What an iteration takes beside its pixels, in pixels, and what a Gaussian in view takes. Measured
// on photos of 1600x1063 and 1600x1200 and their halves, two cores
// (docs/experiments/performance.md).
inline constexpr double kPixelsBeside = 8000;
inline constexpr double kPixelsOfGaussian = 0.9;

// Of an iteration: it starts at min(1, options.sh_degree) and grows.
int ShDegreeAt(const TrainOptions& options, int iteration);

// Level 0 is the given views; level k has 2^-k of their size.
class ViewPyramid {
 public:
  // `views` (one or more) must outlive this. As many levels as the options ask for, fewer if the
  // shorter side of the median photo would fall below 64 px: there a Gaussian's low-pass
  // (PixelFilter) is all there is to see.
  ViewPyramid(const std::vector<TrainView>* views, const TrainOptions& options);

  // Level of an iteration: equal shares of the first coarse_until of the run, down to whole density
  // steps, for levels n .. 1, then level 0.
  int LevelOf(int iteration) const;

  // First iteration at full size.
  int CoarseEnd() const;

  // The time of an iteration with so many Gaussians grows about like this: the pixels that it
  // compares, kPixelsBeside, and kPixelsOfGaussian for each Gaussian of its crop, by the share of
  // rows that its SH degree has.
  double WorkOf(int iteration, double gaussians) const;

  // Most Gaussians of a scene while photos of this level are learnt. Smaller photos have fewer
  // pixels to explain; more Gaussians would only learn their noise.
  int64_t MostGaussians(int level) const;

  // How photo `index` is cut in that iteration.
  CropGrid GridOf(int iteration, size_t index) const;

  // What `iteration` compares of photo `index`, on the photo's visit number `visit`: all of it at
  // the iteration's level, or a crop, cut to `cropped`. `crop`: where that is.
  const TrainView& Compared(int iteration, size_t index, uint64_t visit, TrainView* cropped,
                            PixelRect* crop) const;

  // A photo too small for this level keeps its smallest size that has 64 px.
  const TrainView& View(int level, size_t index) const;

 private:
  // Pixels of a photo or, if they come in crops, of one; the mean over the views.
  double MeanPixels(int level, int64_t crop_pixels) const;

  const std::vector<TrainView>* views_;
  TrainOptions options_;
  std::vector<std::vector<TrainView>> smaller_;  // of each view, levels 1, 2, ...
  int levels_ = 0;                               // above level 0
  double coarse_iterations_;
  std::vector<double> compared_;         // pixels of an iteration, by level
  std::vector<double> compared_share_;   // of a photo's pixels, by level
  std::vector<int64_t> most_gaussians_;  // by level
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_PYRAMID_H_
