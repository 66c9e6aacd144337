#include "engine/train/options.h"

namespace litags {

absl::Status TrainOptions::Validate() const {
  const auto check = [](const char* name, auto value, double least, double most) {
    return CheckField(name, value, FieldRule{.least = least, .most = most});
  };
  LITAGS_RETURN_IF_ERROR(check("iterations", iterations, 1, 1e6));
  LITAGS_RETURN_IF_ERROR(check("threads", threads, 0, 1024));
  LITAGS_RETURN_IF_ERROR(check("sh_degree", sh_degree, 0, 3));
  LITAGS_RETURN_IF_ERROR(check("max_gaussians", max_gaussians, 1, 2e7));
  return recipe.Validate();
}

}  // namespace litags
