#include "engine/tools/table/row.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"

namespace litags {
namespace {

using Json = nlohmann::ordered_json;

Json JsonOf(const TableRow& r) {
  Json json = {{"scene", r.scene}, {"light", r.light}, {"method", r.method}};
  // What is not known is null, so that every row has the same columns.
  const auto known = [&](const auto& value) { return r.ok() ? Json(value) : Json(); };
  const auto measured = [&](const std::optional<double>& value) {
    return value.has_value() ? known(*value) : Json();
  };
  json["psnr"] = measured(r.psnr);
  json["ssim"] = measured(r.ssim);
  json["lpips"] = measured(r.lpips);
  json["psnr_affine"] = measured(r.psnr_affine);
  json["seconds"] = known(r.seconds);
  json["cpu_seconds"] = known(r.cpu_seconds);
  json["enhance_seconds"] = known(r.enhance_seconds);
  json["iterations"] = known(r.iterations);
  json["gaussians"] = known(r.gaussians);
  json["peak_rss_bytes"] = known(r.peak_rss_bytes);
  json["views"] = known(r.views);
  json["flicker"] = measured(r.flicker);
  json["flicker_share"] = measured(r.flicker_share);
  json["path_contrast"] = measured(r.path_contrast);
  json["build"] = r.build;
  json["error"] = r.ok() ? Json() : Json(r.error);
  return json;
}

// A field of a line: quoted where it would break the line otherwise.
std::string CsvField(const Json& value) {
  if (value.is_null()) return "";
  if (!value.is_string()) return JsonText(value);
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::string TableRow::PsnrText() const {
  return psnr.has_value() && std::isfinite(*psnr) ? absl::StrFormat("%.2f", *psnr) : "infinite";
}

std::string TableRow::ToJson() const { return JsonText(JsonOf(*this), 1); }

absl::StatusOr<TableRow> ParseTableRow(std::string_view text, std::string_view field) {
  try {
    const Json json = Json::parse(text);
    TableRow row;
    row.scene = json.at("scene");
    row.light = json.at("light");
    row.method = json.at("method");
    row.build = json.at("build");
    if (!json.at("error").is_null()) {
      row.error = json.at("error");
      return row;
    }
    const auto measured = [](const Json& value) {
      return value.is_null() ? std::nullopt : std::optional<double>(value.get<double>());
    };
    row.psnr = measured(json.at("psnr"));
    row.ssim = measured(json.at("ssim"));
    row.lpips = measured(json.at("lpips"));
    row.psnr_affine = measured(json.at("psnr_affine"));
    row.seconds = json.at("seconds");
    row.cpu_seconds = json.at("cpu_seconds");
    row.enhance_seconds = json.at("enhance_seconds");
    row.iterations = json.at("iterations");
    row.gaussians = json.at("gaussians");
    row.peak_rss_bytes = json.at("peak_rss_bytes");
    row.views = json.at("views");
    const auto optional = [&](const char* key) {
      return measured(json.value(key, Json()));  // rows made before there was a path have none
    };
    row.flicker = optional("flicker");
    row.flicker_share = optional("flicker_share");
    row.path_contrast = optional("path_contrast");
    return row;
  } catch (const Json::exception& e) {
    return MakeError(absl::StatusCode::kDataLoss, "ROW_CORRUPT", field,
                     absl::StrCat(std::string(field), ": not a row of the table: ", e.what()));
  }
}

std::string TableJson(const std::vector<TableRow>& rows) {
  Json list = Json::array();
  for (const TableRow& row : rows) list.push_back(JsonOf(row));
  return JsonText(list, 1) + "\n";
}

std::string TableCsv(const std::vector<TableRow>& rows) {
  std::string csv, heading;
  for (const TableRow& row : rows) {
    std::string line;
    heading.clear();
    const Json json = JsonOf(row);
    for (const auto& [key, value] : json.items()) {
      absl::StrAppend(&heading, heading.empty() ? "" : ",", key);
      absl::StrAppend(&line, line.empty() ? "" : ",", CsvField(value));
    }
    absl::StrAppend(&csv, line, "\n");
  }
  return heading + "\n" + csv;
}

}  // namespace litags
