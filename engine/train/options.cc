#include "engine/train/options.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

absl::Status Bad(const char* field, const std::string& rule) {
  return InvalidInput("BAD_OPTION", field, absl::StrCat(field, ": ", rule));
}

}  // namespace

absl::Status TrainOptions::Validate() const {
  if (iterations < 1 || iterations > 1'000'000) return Bad("iterations", "must be in 1..1000000");
  if (threads < 0) return Bad("threads", "must be 0 (all cores) or more");
  if (sh_degree < 0 || sh_degree > 3) return Bad("sh_degree", "must be in 0..3");
  if (pdm_every < 1) return Bad("pdm_every", "must be 1 or more");
  if (coarse_levels < 0 || coarse_levels > 4) return Bad("coarse_levels", "must be in 0..4");
  if (!(coarse_until > 0 && coarse_until <= 1)) return Bad("coarse_until", "must be in (0, 1]");
  if (sh_interval < 1) return Bad("sh_interval", "must be 1 or more");
  if (densify_start < 0 || densify_every < 1 || densify_until < 0) {
    return Bad("densify_start, densify_every, densify_until",
               "must not be negative, every at least 1");
  }
  if (max_gaussians < 1 || max_gaussians > 20'000'000) {
    return Bad("max_gaussians", "must be in 1..20000000");
  }
  const struct {
    const char* name;
    double value;
  } numbers[] = {{"weight_exposure", weight_exposure},
                 {"exposure_ssim", exposure_ssim},
                 {"weight_reconstruction", weight_reconstruction},
                 {"weight_prior", weight_prior},
                 {"weight_depth", weight_depth},
                 {"weight_denoise", weight_denoise},
                 {"weight_tv", weight_tv},
                 {"lr_means", lr_means},
                 {"lr_means_final", lr_means_final},
                 {"lr_sh_dc", lr_sh_dc},
                 {"lr_sh_rest", lr_sh_rest},
                 {"lr_opacity", lr_opacity},
                 {"lr_scales", lr_scales},
                 {"lr_quats", lr_quats},
                 {"lr_attributes", lr_attributes},
                 {"lr_pdm", lr_pdm},
                 {"settle_epochs", settle_epochs},
                 {"dropout", dropout},
                 {"densify_epochs", densify_epochs},
                 {"densify_grad", densify_grad},
                 {"densify_abs_grad", densify_abs_grad},
                 {"densify_percent", densify_percent},
                 {"prune_opacity", prune_opacity},
                 {"max_scale", max_scale},
                 {"clear_space", clear_space}};
  for (const auto& [name, value] : numbers) {
    if (!std::isfinite(value) || value < 0) return Bad(name, "must be a finite number, 0 or more");
  }
  if (exposure_ssim > 1) return Bad("exposure_ssim", "must be in [0, 1]");
  if (dropout > kMaxDropout) return Bad("dropout", "must be in [0, 0.9]");
  return pdm.Validate();
}

}  // namespace litags
