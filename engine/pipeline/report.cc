#include "engine/pipeline/report.h"
#include "engine/core/json_text.h"

#include <nlohmann/json.hpp>

namespace litags {

std::string_view StageName(Stage stage) {
  switch (stage) {
    case Stage::kLoading:
      return "loading";
    case Stage::kFindingCameras:
      return "finding-cameras";
    case Stage::kPreparing:
      return "preparing";
    case Stage::kTraining:
      return "training";
    case Stage::kSaving:
      return "saving";
  }
  return "unknown";
}

std::string ReconstructReport::ToJson() const {
  const nlohmann::json json = {{"photos", photos},
                               {"registered", registered},
                               {"dropped", dropped},
                               {"sfm_preparation", sfm_preparation},
                               {"sparse_points", sparse_points},
                               {"gaussians", gaussians},
                               {"iterations", iterations},
                               {"first_iteration", first_iteration},
                               {"seconds", seconds},
                               {"training_seconds", training_seconds},
                               {"camera_seconds", camera_seconds},
                               {"phase_seconds", phase_seconds},
                               {"psnr_holdout", psnr_holdout},  // NaN becomes null
                               {"ssim_holdout", ssim_holdout},
                               {"depth_used", depth_used},
                               {"notes", notes},
                               {"scene_path", scene_path}};
  return JsonText(json, 2) + "\n";
}

}  // namespace litags
