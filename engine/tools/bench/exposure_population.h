// Inside litags-bench: captures of known exposure, made from well exposed photos.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_POPULATION_H_
#define LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_POPULATION_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/target/exposure_rule.h"

namespace litags {

// A made-up capture.
struct ExposureCase {
  size_t photo = 0;      // index of the photo it is made of
  std::string kind;      // "plain", "lamps", ...
  bool fit = false;      // constants are fitted to these kinds; the others are tests only
  LightHistogram light;  // as the capture's photos show it
  double stops = 0;      // log2 of the gain that gives the photo's own exposure
};

struct ExposurePopulation {
  size_t photos = 0;
  std::vector<LightHistogram> luma;  // of each photo as it is, linear; 1: white
  std::vector<ExposureCase> cases;
};

// Reads the photos of a folder, well exposed ones, and makes cases of each. Real photos clip what
// is brighter than white, dark captures of the same places do not, so kinds to fit to have
// sources of light lifted above white: the photo's own clipped areas (log share falling evenly up
// to -0.5 to 2 stops), lamps (0.02 to 12 % of the picture, 1 to 7 stops above white), windows
// (0 to 15 %, 0.3 to 4 stops), a bright sky (clipped areas up to 2.5 stops). Tests: several
// crops pooled, darkened by 6 to 9 stops with a sensor's noise in 8 bits, as PNG and JPEG,
// brightened by 1 to 3 stops and clipped, and a torch that lights 9 % of the photo 5 stops too
// little. What is stored is counted as a capture's photos are (CaptureLight). Deterministic.
absl::StatusOr<ExposurePopulation> MakeExposurePopulation(const std::string& folder);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_POPULATION_H_
