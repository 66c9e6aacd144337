// Stands in for engine/pipeline's own until that library is part of the build.
#include <cmath>

#include "engine/core/error.h"
#include "engine/pipeline/engine.h"

namespace litags {

absl::Status ReconstructOptions::Validate() const {
  if (!(theta > 0 && theta < 1)) {
    return InvalidInput("OPTION_OUT_OF_RANGE", "options.theta", "theta must be in (0, 1)");
  }
  if (iterations < 1) {
    return InvalidInput("OPTION_OUT_OF_RANGE", "options.iterations", "iterations must be positive");
  }
  return absl::OkStatus();
}

}  // namespace litags
