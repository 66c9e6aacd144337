#ifndef LITAGS_SERVER_WEB_ROUTES_H_
#define LITAGS_SERVER_WEB_ROUTES_H_

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/web/http.h"

namespace litags::web {

// What becomes of a call's answer.
enum class AnswerKind {
  kJson,      // one message, as JSON
  kBytes,     // its field `data` is the body; the rest is JSON in the header Litags-Answer
  kEvents,    // a stream of messages, as server-sent events
  kDownload,  // ExportModel: the header gives the length, the chunks are the body
  kReport,    // GetJob and what else a report is made of, as one HTML file
  kUpload,    // UploadImages: the body of the request is one file
};

// One row: how an RPC is called by HTTP, in the words of google.api.http.
struct Route {
  std::string_view method;  // "GET"
  // "/v1/{name=jobs/*}:cancel": the part in braces is the request's field `name`, here "jobs/ID".
  std::string_view path;
  std::string_view rpc;  // "ReconstructionService/CancelJob"
  // What the body is, as JSON: "*" the request, a name that field of it, empty: no body. Fields
  // that are neither in path nor body are parameters of the query: "settings.width=320".
  std::string_view body = "";
  AnswerKind kind = AnswerKind::kJson;
  // Of kEvents: the field that Last-Event-ID fills, where messages have numbers.
  std::string_view resume_field = "";
};

std::span<const Route> Routes();

// A route, with what its path's braces stand for.
struct Match {
  const Route* route = nullptr;
  std::vector<std::pair<std::string, std::string>> fields;  // {"name", "jobs/abc"}
};

// The route of a request. Without one, `other_methods` says which methods the path has ("GET,
// PUT").
Match FindRoute(const Head& head, std::string* other_methods);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_ROUTES_H_
