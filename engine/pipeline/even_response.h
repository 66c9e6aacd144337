#ifndef LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
#define LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/pipeline/context.h"
#include "engine/render/renderer.h"
#include "engine/target/capture_light.h"
#include "engine/target/photometric.h"
#include "engine/target/response.h"

namespace litags {

// Takes out of the photos of a capture what their camera, not the scene, did to their light: white
// balances that differ from photo to photo, a lens that is dark at the corners (response.h), and a
// strong cast, unless the options keep it (white_balance.h). Adds a note for each.
// A photo that would be black without its cast stays as it is.
// A lamp that lights what is near stays in the photos, since how far everything is is learnt later:
// returns what it does to light, and sets PointSighting::lit. Fills `brightened`, one per photo.
// `cameras`, `masks` (see MaskOf) and `code_step` (see FileSteps) are the photos'; `sightings` are
// sorted by point. Does nothing for other tones than Tone::kCapture. The same bytes for any number
// of threads.
Lamp EvenOutResponse(const Context& context, absl::Span<const Camera> cameras,
                     absl::Span<const PlaneU8> masks, double code_step,
                     std::vector<PointSighting>* sightings, std::vector<Photo>* photos,
                     std::vector<Brightening>* brightened);

// The lamp that EvenOutResponse found as the renderer takes it: what it does to codes of targets,
// and from the distance at which pictures without it are as bright as well exposed photos.
// `photos` and what is known of them (facts) as they were left there; without lamps.
Lamp LampOfTargets(const Context& context, const Lamp& lamp,
                   absl::Span<const PointSighting> sightings, absl::Span<const Photo> photos,
                   absl::Span<const double> exposures, CaptureFacts facts);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
