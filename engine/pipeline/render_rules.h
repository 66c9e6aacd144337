// Which light and exposure a picture may have, and what a file: one rule for the engine and the
// service.
#ifndef LITAGS_ENGINE_PIPELINE_RENDER_RULES_H_
#define LITAGS_ENGINE_PIPELINE_RENDER_RULES_H_

#include <string_view>

#include "absl/status/status.h"
#include "engine/pipeline/scene.h"

namespace litags {

// Whether the channel is a colour, which can be lit and exposed.
bool IsColor(Channel channel);

// INVALID_ARGUMENT about `field`: LIGHT_INVALID beyond kMaxLight, EXPOSURE_INVALID beyond
// kMaxExposureStops, both also for NaN.
absl::Status CheckLight(double light, std::string_view field);
absl::Status CheckExposure(double stops, std::string_view field);

// INVALID_ARGUMENT (EXPOSURE_INVALID) about `field` unless the channel is a colour.
absl::Status CheckExposable(Channel channel, std::string_view field);

// INVALID_ARGUMENT unless the request can be met for some scene: LIGHT_INVALID, EXPOSURE_INVALID,
// EXPORT_OPTION_INVALID. One rule for the engine and the service.
absl::Status CheckExport(const ExportRequest& request);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_RENDER_RULES_H_
