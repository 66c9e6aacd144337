#include "engine/tools/bench/reference_case.h"
#include "engine/core/json_text.h"

#include <algorithm>
#include <cmath>

#include "engine/io/file_util.h"
#include "nlohmann/json.hpp"

namespace litags {

struct ReferenceCase::Json {
  nlohmann::json root;

  const nlohmann::json& At(const char* section, const std::string& key) const {
    const auto found = root.find(section);
    if (found == root.end() || !found->contains(key)) {
      throw CaseError(std::string("case.json has no ") + section + "." + key);
    }
    return (*found)[key];
  }
};

ReferenceCase::ReferenceCase(const std::string& folder)
    : folder_(folder), json_(std::make_unique<Json>()) {
  const auto text = ReadFile(folder + "/case.json", "case.json", int64_t{16} << 20);
  if (!text.ok()) throw CaseError(std::string(text.status().message()));
  json_->root = ParseJson(*text);
  if (json_->root.is_discarded()) throw CaseError("case.json is no JSON");
}

ReferenceCase::~ReferenceCase() = default;
ReferenceCase::ReferenceCase(ReferenceCase&&) noexcept = default;

std::string ReferenceCase::name() const { return json_->root.at("name").get<std::string>(); }
std::string ReferenceCase::kind() const { return json_->root.at("kind").get<std::string>(); }

double ReferenceCase::Param(const std::string& key) const {
  return json_->At("params", key).get<double>();
}
bool ReferenceCase::ParamFlag(const std::string& key) const {
  return json_->At("params", key).get<bool>();
}
bool ReferenceCase::HasParam(const std::string& key) const {
  const auto& params = json_->root.at("params");
  return params.contains(key) && !params[key].is_null();
}
std::string ReferenceCase::ParamText(const std::string& key) const {
  return json_->At("params", key).get<std::string>();
}
std::vector<double> ReferenceCase::ParamList(const std::string& key) const {
  std::vector<double> list;
  for (const auto& item : json_->At("params", key)) {
    if (item.is_array()) {
      for (const auto& number : item) list.push_back(number.get<double>());
    } else {
      list.push_back(item.get<double>());
    }
  }
  return list;
}
double ReferenceCase::Value(const std::string& key) const {
  return json_->At("values", key).get<double>();
}
double ReferenceCase::Tolerance(const std::string& key) const {
  return json_->At("tolerances", key).get<double>();
}

bool ReferenceCase::Has(const std::string& array) const {
  return json_->root.at("arrays").contains(array);
}

NpyArray ReferenceCase::Array(const std::string& array) const {
  if (!Has(array)) throw CaseError("case.json has no array " + array);
  auto npy = ReadNpy(folder_ + "/" + array + ".npy", array);
  if (!npy.ok()) throw CaseError(std::string(npy.status().message()));
  read_.insert(array);
  return *std::move(npy);
}

Planes ReferenceCase::ReadPlanes(const std::string& array) const {
  NpyArray npy = Array(array);
  if (npy.shape.size() == 2) npy.shape.insert(npy.shape.begin(), 1);
  if (npy.shape.size() != 3) throw CaseError(array + " is not [C,H,W]");
  Planes planes(npy.shape[0], npy.shape[1], npy.shape[2]);
  planes.data = npy.ToFloats();
  return planes;
}

Planes ReferenceCase::ReadHwc(const std::string& array) const {
  const NpyArray npy = Array(array);
  if (npy.shape.size() != 3) throw CaseError(array + " is not [H,W,C]");
  const int height = npy.shape[0], width = npy.shape[1], channels = npy.shape[2];
  const std::vector<float> values = npy.ToFloats();
  Planes planes(channels, height, width);
  for (size_t i = 0; i < values.size(); ++i) planes.plane(i % channels)[i / channels] = values[i];
  return planes;
}

ImageU8 ReferenceCase::ReadImage(const std::string& array) const {
  const NpyArray npy = Array(array);
  if (npy.type != NpyType::kUInt8 || npy.shape.size() != 3 || npy.shape[2] != 3) {
    throw CaseError(array + " is not an 8-bit image [H,W,3]");
  }
  ImageU8 image(npy.shape[1], npy.shape[0]);
  image.data = npy.bytes;
  return image;
}

std::vector<std::string> ReferenceCase::UnreadResults() const {
  std::vector<std::string> unread;
  for (const auto& [array, info] : json_->root.at("arrays").items()) {
    const std::string role = info.value("role", "");
    const bool result = role == "output" || role == "gradient" || role == "intermediate";
    if (result && !read_.contains(array)) unread.push_back(array);
  }
  return unread;
}

double MaxAbs(absl::Span<const double> values) {
  double largest = 0;
  for (double v : values) largest = std::max(largest, std::abs(v));
  return largest;
}

double MaxAbsError(absl::Span<const float> actual, absl::Span<const double> expected) {
  if (actual.size() != expected.size()) {
    throw CaseError("the engine gives " + std::to_string(actual.size()) + " numbers, the case " +
                    std::to_string(expected.size()));
  }
  double largest = 0;
  for (size_t i = 0; i < actual.size(); ++i) {
    const double error = std::abs(actual[i] - expected[i]);
    if (std::isnan(error)) return error;
    largest = std::max(largest, error);
  }
  return largest;
}

}  // namespace litags
