#ifndef LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
#define LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/pipeline/context.h"
#include "engine/target/photometric.h"

namespace litags {

// Takes out of the photos of a capture what their camera, not the scene, did to their light: white
// balances that differ from photo to photo, a lens that is dark at the corners (response.h), and a
// strong cast, unless the options keep it (white_balance.h). Adds a note for each.
// `cameras` and `masks` (see MaskOf) are the photos'; `sightings` are sorted by point. Does nothing
// for other tones than Tone::kCapture. The same bytes for any number of threads.
void EvenOutResponse(const Context& context, absl::Span<const PointSighting> sightings,
                     absl::Span<const Camera> cameras, absl::Span<const PlaneU8> masks,
                     std::vector<Photo>* photos);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
