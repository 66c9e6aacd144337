#include "engine/pipeline/render_rules.h"

#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

absl::Status CheckRange(double value, double limit, const char* reason, std::string_view field) {
  if (std::abs(value) <= limit) return absl::OkStatus();  // not NaN
  return InvalidInput(reason, field,
                      absl::StrCat(std::string(field), " is ", value, "; it must be in [-", limit,
                                   ", ", limit, "]"));
}

}  // namespace

bool IsColor(Channel channel) {
  return channel == Channel::kColor || channel == Channel::kOriginal || channel == Channel::kLight;
}

absl::Status CheckLight(double light, std::string_view field) {
  return CheckRange(light, kMaxLight, "LIGHT_INVALID", field);
}

absl::Status CheckExposure(double stops, std::string_view field) {
  return CheckRange(stops, kMaxExposureStops, "EXPOSURE_INVALID", field);
}

absl::Status CheckExposable(Channel channel, std::string_view field) {
  if (IsColor(channel)) return absl::OkStatus();
  return InvalidInput(
      "EXPOSURE_INVALID", field,
      absl::StrCat(std::string(field), " is for COLOR, ORIGINAL and LIGHT only; leave it 0"));
}

}  // namespace litags
