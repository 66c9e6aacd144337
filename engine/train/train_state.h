#ifndef LITAGS_ENGINE_TRAIN_TRAIN_STATE_H_
#define LITAGS_ENGINE_TRAIN_TRAIN_STATE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/denoise/pdm.h"
#include "engine/train/camera_pose.h"
#include "engine/train/density.h"
#include "engine/train/nan_recovery.h"

namespace litags {

// All that changes during training. What is random is derived from (seed, iteration), so this
// is the whole checkpoint.
struct TrainState {
  int iteration = 0;  // finished iterations
  SplatState splats;
  PdmWeights pdm, pdm_moment1, pdm_moment2;
  DensityStats density;
  std::vector<CameraPose> poses;            // of the views; empty: cameras are not refined
  std::vector<NanRecovery> nan_recoveries;  // by iteration
  // SimdTarget() of all who trained and saved it, "AVX2, AVX3"; empty: it does not say. Not a part
  // of what is trained.
  std::string saved_on;
};

// Version of the container. LoadTrainState reads no other.
inline constexpr uint32_t kCheckpointVersion = 3;

// One container file of kind "checkpoint". `fingerprint` says what the run was made of; saved_on
// gets this process' target besides.
absl::Status SaveTrainState(const std::string& path, const std::string& fingerprint,
                            const TrainState& state);

// FAILED_PRECONDITION (CHECKPOINT_MISMATCH) for another fingerprint; errors of Container::Read;
// DATA_LOSS if the sections do not fit together.
absl::StatusOr<TrainState> LoadTrainState(const std::string& path, const std::string& fingerprint);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_TRAIN_STATE_H_
