#ifndef LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
#define LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_

#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/pipeline/engine.h"
#include "engine/target/photometric.h"

namespace litags {

// Takes out of the photos of a capture what their camera, not the scene, did to their light: white
// balances that differ from photo to photo, a lens that is dark at the corners (response.h), and a
// strong cast, unless options.white_balance keeps it (white_balance.h). Adds a note for each.
// `cameras` and `masks` (see MaskOf) are the photos'; `sightings` are sorted by point. Does nothing
// for other tones than Tone::kCapture. The same bytes for any options.threads.
void EvenOutResponse(const ReconstructOptions& options, absl::Span<const PointSighting> sightings,
                     absl::Span<const Camera> cameras, absl::Span<const PlaneU8> masks,
                     std::vector<Photo>* photos, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_EVEN_RESPONSE_H_
