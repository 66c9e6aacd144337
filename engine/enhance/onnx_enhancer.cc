#include "engine/enhance/onnx_enhancer.h"

#include <cctype>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/io/image_io.h"

namespace litags {
namespace {

constexpr char kField[] = "--enhancer";

absl::Status Bad(const std::string& text, const std::string& rule) {
  return InvalidInput("BAD_ENHANCER", kField, absl::StrCat(kField, " ", text, ": ", rule));
}

bool ParseSize(absl::string_view text, OnnxPhotoOptions* out) {
  const std::pair<absl::string_view, absl::string_view> sides = absl::StrSplit(text, 'x');
  return absl::SimpleAtoi(sides.first, &out->width) && absl::SimpleAtoi(sides.second, &out->height);
}

// One "key=value"; false if it makes no sense.
bool ParsePart(absl::string_view part, OnnxEnhancerOptions* out) {
  const std::pair<absl::string_view, absl::string_view> pair =
      absl::StrSplit(part, absl::MaxSplits('=', 1));
  const auto& [key, value] = pair;
  if (key == "size") return ParseSize(value, &out->input);
  if (key == "multiple") return absl::SimpleAtoi(value, &out->input.multiple);
  if (key == "mean") return ParsePerChannel(std::string(value), &out->input.mean);
  if (key == "std") return ParsePerChannel(std::string(value), &out->input.std);
  if (key == "white") return absl::SimpleAtod(value, &out->scale);
  if (key == "output") out->output = std::string(value);
  return key == "output" && !value.empty();
}

}  // namespace

absl::Status OnnxEnhancerOptions::Validate() const {
  const auto allowed = [](unsigned char c) {
    return std::isalnum(c) || c == '.' || c == '_' || c == '-';
  };
  if (name.empty() || name.front() == '.' || !std::all_of(name.begin(), name.end(), allowed)) {
    return Bad(name, "the name must be letters, digits, '.', '_' and '-', as in zero-dce");
  }
  if (path.empty()) return Bad(name, "there is no file; give NAME=FILE.onnx");
  if (!std::isfinite(scale) || scale <= 0) return Bad(name, "white must be above 0");
  return input.Validate(kField);
}

absl::StatusOr<OnnxEnhancerOptions> ParseOnnxEnhancer(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  const size_t equals = parts[0].find('=');
  if (equals == std::string::npos) return Bad(text, "is not NAME=FILE.onnx");
  OnnxEnhancerOptions options;
  options.text = text;
  options.name = parts[0].substr(0, equals);
  options.path = parts[0].substr(equals + 1);
  for (size_t i = 1; i < parts.size(); ++i) {
    if (!ParsePart(parts[i], &options)) {
      return Bad(text, absl::StrCat("\"", parts[i],
                                    "\" is none of size=WxH, multiple=N, mean=R:G:B, std=R:G:B, "
                                    "output=NAME, white=255"));
    }
  }
  LITAGS_RETURN_IF_ERROR(options.Validate());
  return options;
}

absl::StatusOr<Enhancer> MakeOnnxEnhancer(const OnnxEnhancerOptions& options) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  LITAGS_ASSIGN_OR_RETURN(OnnxNet loaded, OnnxNet::Load(options.path, kField));
  // std::function copies its target; the network is shared.
  const auto net = std::make_shared<OnnxNet>(std::move(loaded));
  const auto run = [net, options](const ImageU8& photo) -> absl::StatusOr<ImageU8> {
    LITAGS_ASSIGN_OR_RETURN(Planes out,
                            net->Run({{"", OnnxPhoto(photo, options.input)}}, options.output));
    if (out.channels != 3) {
      return Bad(options.name, absl::StrCat("the network gives ", out.channels,
                                            " channels, not 3; choose another with output=NAME"));
    }
    for (float& v : out.data) v = static_cast<float>(v / options.scale);
    ImageU8 picture = ToImageU8(out);
    if (picture.width == photo.width && picture.height == photo.height) return picture;
    return ResizeArea(picture, photo.width, photo.height);
  };
  return Enhancer{options.name, run};
}

}  // namespace litags
