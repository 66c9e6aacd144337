#include "engine/pipeline/render_rules.h"

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"

namespace litags {
namespace {

absl::Status CheckRange(double value, double limit, const char* reason, std::string_view field) {
  if (std::abs(value) <= limit) return absl::OkStatus();  // not NaN
  return InvalidInput(reason, field,
                      absl::StrCat(std::string(field), " is ", value, "; it must be in [-", limit,
                                   ", ", limit, "]"));
}

// "compressed-ply, spz, spz-v4, sog and html".
std::string FormatsWithTag() {
  std::vector<std::string> names;
  for (const FormatInfo& info : Formats()) {
    if (info.has_antialiased_tag) names.push_back(info.name);
  }
  const std::string last = names.back();
  names.pop_back();
  return absl::StrCat(absl::StrJoin(names, ", "), " and ", last);
}

absl::Status BadOption(std::string_view field, const std::string& rule) {
  return InvalidInput("EXPORT_OPTION_INVALID", field, absl::StrCat(std::string(field), rule));
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

absl::Status CheckExport(const ExportRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckLight(request.light, "light"));
  LITAGS_RETURN_IF_ERROR(CheckExposure(request.exposure_stops, "exposure_stops"));
  if (!(request.scale >= kMinExportScale && request.scale <= kMaxExportScale)) {
    return BadOption("scale", absl::StrCat(" is ", request.scale, "; it must be in [",
                                           kMinExportScale, ", ", kMaxExportScale, "]"));
  }
  if (request.max_splats < 0) {
    return BadOption("max_splats", absl::StrCat(" is ", request.max_splats,
                                                "; it must be positive, or 0 for all"));
  }
  for (int k = 0; request.crop.has_value() && k < 3; ++k) {
    if (!(request.crop->min[k] <= request.crop->max[k])) {  // NaN, too
      return BadOption("crop", absl::StrCat(" begins at ", request.crop->min[k], " and ends at ",
                                            request.crop->max[k],
                                            "; give the lower corner, then the upper one"));
    }
  }
  if (!IsFormat(request.format)) {
    return BadOption("format", absl::StrCat(" is ", static_cast<int>(request.format),
                                            "; it must be a value of SceneFormat"));
  }
  const FormatInfo& info = InfoOf(request.format);
  if (request.antialiased && !info.has_antialiased_tag) {
    return BadOption("antialiased", absl::StrCat(": ", info.name, " has no tag for it; ",
                                                 FormatsWithTag(), " have"));
  }
  if (request.max_splats > 0 && info.encode_mesh != nullptr) {
    return BadOption("max_splats",
                     absl::StrCat(": ", info.name, " holds triangles; leave it 0, or give a crop"));
  }
  if (request.format == SceneFormat::kUsda &&
      (request.up == UpAxis::kX || request.up == UpAxis::kNegativeX ||
       request.up == UpAxis::kNegativeY || request.up == UpAxis::kNegativeZ)) {
    return BadOption("up", ": usda knows y and z; give one of these, or keep");
  }
  return absl::OkStatus();
}

}  // namespace litags
