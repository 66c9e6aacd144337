#include "engine/depth/depth_network.h"

#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/onnx/onnx_net.h"

namespace litags {
namespace {

bool ParseSize(const std::string& text, DepthNetwork* network) {
  const std::vector<std::string> sides = absl::StrSplit(text, 'x');
  return sides.size() == 2 && absl::SimpleAtoi(sides[0], &network->width) &&
         absl::SimpleAtoi(sides[1], &network->height) && network->width > 0 && network->height > 0;
}

bool ParseSetting(const std::string& name, const std::string& value, DepthNetwork* network) {
  if (name == "size") return ParseSize(value, network);
  if (name == "mean") return ParsePerChannel(value, &network->mean);
  if (name == "std") return ParsePerChannel(value, &network->std);
  if (name != "output" || (value != "inverse" && value != "depth")) return false;
  network->inverse = value == "inverse";
  return true;
}

}  // namespace

absl::StatusOr<DepthNetwork> DepthNetwork::Parse(std::string_view text, std::string_view field) {
  DepthNetwork network;
  if (text.empty()) return network;
  const std::vector<std::string> parts = absl::StrSplit(std::string(text), ',');
  network.path = parts[0];
  for (size_t i = 1; i < parts.size(); ++i) {
    const std::vector<std::string> setting = absl::StrSplit(parts[i], absl::MaxSplits('=', 1));
    if (setting.size() != 2 || !ParseSetting(setting[0], setting[1], &network)) {
      return InvalidInput("DEPTH_MODEL_SETTING", field,
                          absl::StrCat(std::string(field), ": \"", parts[i],
                                       "\" is none of size=WxH, mean=R:G:B, std=R:G:B, "
                                       "output=inverse, output=depth"));
    }
  }
  return network;
}

}  // namespace litags
