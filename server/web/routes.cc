#include "server/web/routes.h"

#include <optional>

#include "absl/strings/str_cat.h"

namespace litags::web {
namespace {

using Fields = std::vector<std::pair<std::string, std::string>>;

constexpr Route kRoutes[] = {
    {"GET", "/v1/serverInfo", "ReconstructionService/GetServerInfo"},
    {"POST", "/v1/jobs", "ReconstructionService/CreateJob", "*"},
    {"GET", "/v1/jobs", "ReconstructionService/ListJobs"},
    {"POST", "/v1/jobs:batchDelete", "ReconstructionService/BatchDeleteJobs", "*"},
    {"GET", "/v1/{name=jobs/*}", "ReconstructionService/GetJob"},
    {"PATCH", "/v1/{job.name=jobs/*}", "ReconstructionService/UpdateJob", "job"},
    {"DELETE", "/v1/{name=jobs/*}", "ReconstructionService/DeleteJob"},
    {"POST", "/v1/{name=jobs/*}:clone", "ReconstructionService/CloneJob", "*"},
    {"POST", "/v1/{name=jobs/*}:start", "ReconstructionService/StartJob", "*"},
    {"POST", "/v1/{name=jobs/*}:cancel", "ReconstructionService/CancelJob", "*"},
    {"POST", "/v1/{name=jobs/*}:resume", "ReconstructionService/ResumeJob", "*"},
    {"GET", "/v1/{name=jobs/*}/events", "ReconstructionService/WatchJob", "", AnswerKind::kEvents,
     "after_event"},
    {"GET", "/v1/{name=jobs/*}/log", "ReconstructionService/GetLog", "", AnswerKind::kEvents,
     "after_entry"},
    {"GET", "/v1/{name=jobs/*}/files", "ReconstructionService/ListFiles"},
    {"POST", "/v1/{name=jobs/*}/files:query", "ReconstructionService/QueryUpload", "*"},
    {"PUT", "/v1/{name=jobs/*}/files/{file_name}", "ReconstructionService/UploadImages", "",
     AnswerKind::kUpload},
    {"DELETE", "/v1/{name=jobs/*}/files/{file_name}", "ReconstructionService/DeleteFile"},
    {"GET", "/v1/{name=jobs/*}/report", "ReconstructionService/GetJob", "", AnswerKind::kReport},
    {"GET", "/v1/{name=jobs/*}/cameras", "RenderService/ListCameras"},
    {"GET", "/v1/{name=jobs/*}/view", "RenderService/RenderView", "", AnswerKind::kBytes},
    {"POST", "/v1/{name=jobs/*}:renderView", "RenderService/RenderView", "*", AnswerKind::kBytes},
    {"POST", "/v1/{name=jobs/*}:renderPath", "RenderService/RenderPath", "*", AnswerKind::kEvents},
    {"GET", "/v1/{name=jobs/*}/model", "ModelService/ExportModel", "", AnswerKind::kDownload},
};

// "/a/b:verb" as {"a", "b"} and "verb".
struct Parts {
  std::vector<std::string_view> segments;
  std::string_view verb;
};

// `has_verb` false: a colon is as any other character.
Parts Split(std::string_view path, bool has_verb = true) {
  Parts parts;
  const size_t slash = path.rfind('/'), colon = path.rfind(':');
  if (has_verb && colon != std::string_view::npos && colon > slash) {
    parts.verb = path.substr(colon + 1);
    path = path.substr(0, colon);
  }
  while (!path.empty()) {
    path.remove_prefix(1);  // the slash
    parts.segments.push_back(path.substr(0, path.find('/')));
    path.remove_prefix(parts.segments.back().size());
  }
  return parts;
}

// A variable that spans two segments, "{name=jobs/*}", is two of them here: "{name=jobs" and "*}".
std::optional<Fields> Matches(std::string_view pattern, std::string_view whole_path) {
  const Parts wanted = Split(pattern);
  // Files' names may have colons, jobs' names have none.
  const Parts path = Split(whole_path, !wanted.segments.back().starts_with("{"));
  if (wanted.verb != path.verb || wanted.segments.size() != path.segments.size()) {
    return std::nullopt;
  }
  Fields fields;
  std::string_view open;    // the variable whose first segment was met
  std::string_view prefix;  // that segment
  for (size_t i = 0; i < wanted.segments.size(); ++i) {
    std::string_view segment = wanted.segments[i];
    if (segment == "*}" || segment.starts_with("{")) {
      const bool closes = segment.ends_with("}");
      if (!closes) {
        const size_t equals = segment.find('=');
        open = segment.substr(1, equals - 1);
        prefix = segment.substr(equals + 1);
        if (path.segments[i] != prefix) return std::nullopt;
        continue;
      }
      auto value = PercentDecode(path.segments[i]);
      if (!value || value->empty()) return std::nullopt;
      if (segment == "*}") {
        fields.emplace_back(open, absl::StrCat(std::string(prefix), "/", *value));
      } else {
        fields.emplace_back(segment.substr(1, segment.size() - 2), *std::move(value));
      }
    } else if (segment != path.segments[i]) {
      return std::nullopt;
    }
  }
  return fields;
}

}  // namespace

std::span<const Route> Routes() { return kRoutes; }

Match FindRoute(const Head& head, std::string* other_methods) {
  for (const Route& route : kRoutes) {
    auto fields = Matches(route.path, head.path);
    if (!fields) continue;
    if (route.method == head.method) return {&route, *std::move(fields)};
    absl::StrAppend(other_methods, other_methods->empty() ? "" : ", ", std::string(route.method));
  }
  return {};
}

}  // namespace litags::web
