#ifndef LITAGS_SERVER_TESTING_FAKE_ENGINE_H_
#define LITAGS_SERVER_TESTING_FAKE_ENGINE_H_

#include <memory>
#include <string>

#include "engine/pipeline/engine.h"

namespace litags {

// An engine that makes scenes in milliseconds, for tests of the service. Its "training" counts to
// options.iterations, 1 ms each, with checkpoints, snapshots and previews as the options say. A
// scene renders as a picture whose pixels follow from camera, channel and iteration.
//
// A video is not looked at: options.frames photos come of it, or 12.
//
// A photo with one of these names (and any extension) changes what happens:
//   fail        Reconstruct returns FAILED_PRECONDITION (SFM_TOO_FEW_VIEWS)
//   crash-once  the process dies half way, at the first attempt only
//   crash       the process dies half way, at every attempt
//   memory      takes memory half way until there is none: only with a limit, --worker-memory
//   hang        stops making progress half way, but obeys the cancel token
//   stuck       stops making progress half way and does not obey it
//   slow        20 ms per iteration
//   hungry      takes 300 MB half way, then as hang
//   heavy       a picture of the scene takes 20 s, unless it is cancelled
//   no-camera   no camera is found for it
std::unique_ptr<Engine> MakeFakeEngine(std::string colmap = "");

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_FAKE_ENGINE_H_
