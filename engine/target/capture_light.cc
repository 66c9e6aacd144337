#include "engine/target/capture_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/light_squares.h"
#include "engine/target/noise_floor.h"

namespace litags {
namespace {

// Where no light fell there is nothing to brighten: what noise makes of black counts for at most
// this share of what is lit, and black for at most this share of the two, so that a torch in the
// dark is exposed for what it lights. Choice
constexpr double kMostBlack = 0.1;

// The light of a photo's squares, and the share of the photo that no light fell on.
struct PhotoLight {
  LightHistogram lit, noise;  // above the noise floor; up to it
  double black = 0;
};

// Adds a square as the camera stored it, with an exposure that makes up for that: its own white
// clipped.
PhotoLight MeasureLight(const Photo& photo, double exposure, const PlaneU8& mask,
                        const LampLight* lamp, const Brightening& brightened, double noise_floor) {
  PhotoLight out;
  const double black = LinearTable::Get()(kBlackSample);
  const double share = 1.0 / CountedPixels(mask, photo.pixels());
  ForLightSquares(photo, mask, [&](const LightSquare& square) {
    const double weight = share * square.counted;
    if (square.LargestMean() <= black) {
      out.black += weight;
      return;
    }
    const double lit = lamp != nullptr ? lamp->At(square.x, square.y) : 1;
    const std::array<float, 3> grew = brightened.At(square.x + kSquare / 2, square.y + kSquare / 2);
    std::array<double, 3> stored;
    for (int c = 0; c < 3; ++c) stored[c] = square.mean[c] / grew[c];
    const double before = LightOfPixel(stored[0], stored[1], stored[2]),
                 after = LightOfPixel(square.mean[0], square.mean[1], square.mean[2]);
    const double less = before > 0 ? before / after : 1;
    const bool is_noise = std::max({stored[0], stored[1], stored[2]}) <= noise_floor;
    (is_noise ? out.noise : out.lit)
        .AddPixel(stored[0], stored[1], stored[2], exposure * lit * less, weight);
  });
  return out;
}

// Adds `light` so that it weighs `most` at most.
void AddUpTo(double most, const LightHistogram& light, LightHistogram* to) {
  if (light.total() <= most) {
    to->Add(light);
    return;
  }
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    const double weight = light.weight(bin) * most / light.total();
    if (weight > 0) to->Add(std::exp2(LightHistogram::Stops(bin)), weight);
  }
}

}  // namespace

LightHistogram CaptureLight(absl::Span<const Photo> photos, absl::Span<const double> exposures,
                            int threads, const CaptureFacts& facts) {
  const double noise_floor =
      facts.noise_floor.has_value() ? *facts.noise_floor : NoiseFloor(photos, threads, facts.masks);
  std::vector<PhotoLight> of_photos(photos.size());
  ParallelFor(threads, photos.size(), [&](size_t i, int) {
    of_photos[i] = MeasureLight(photos[i], exposures[i], MaskOf(facts.masks, i),
                                facts.lamps.empty() ? nullptr : &facts.lamps[i],
                                BrighteningOf(facts.brightened, i), noise_floor);
  });
  LightHistogram all, noise;
  double black = 0;
  for (const PhotoLight& of_photo : of_photos) {
    all.Add(of_photo.lit);
    noise.Add(of_photo.noise);
    black += of_photo.black;
  }
  // Where noise hides everything, it is all there is to go by.
  AddUpTo(all.total() > 0 ? kMostBlack * all.total() : noise.total(), noise, &all);
  all.Add(0, std::min(black, kMostBlack * all.total()));
  return all;
}

}  // namespace litags
