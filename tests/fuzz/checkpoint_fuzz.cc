// Checkpoints whose checksums are right and whose sections are anything.
#include "engine/core/check.h"
#include "engine/train/train_state.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  WriteScratchContainer(AsText(data, size), "checkpoint", kCheckpointVersion);
  const auto state = LoadTrainState(ScratchPath(), "fuzz");
  if (!state.ok()) return 0;
  const size_t n = state->splats.params.size();
  LITAGS_CHECK(n > 0 && state->splats.moment1.size() == n && state->splats.moment2.size() == n);
  LITAGS_CHECK(state->density.grad.size() == n && state->density.views.size() == n);
  return 0;
}
