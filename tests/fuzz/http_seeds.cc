#include "tests/fuzz/http_seeds.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/web/routes.h"

namespace litags {
namespace {

constexpr char kDigest[] =
    "Repr-Digest: sha-256=:LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOLmCQ=:\r\n";  // of "hello"

std::string Request(const std::string& method, const std::string& target,
                    const std::string& headers, const std::string& body) {
  std::string length;
  if (!body.empty()) length = absl::StrCat("Content-Length: ", body.size(), "\r\n");
  return absl::StrCat(method, " ", target, " HTTP/1.1\r\nHost: localhost:8080\r\n", headers, length,
                      "\r\n", body);
}

std::string RequestOf(const web::Route& route) {
  const std::string path =
      absl::StrReplaceAll(std::string(route.path), {{"{name=jobs/*}", "jobs/0123456789abcdef"},
                                                    {"{job.name=jobs/*}", "jobs/0123456789abcdef"},
                                                    {"{file_name}", "a%20b.jpg"}});
  if (route.kind == web::AnswerKind::kUpload) {
    return Request("PUT", path + "?role=FILE_ROLE_PHOTO", kDigest, "hello");
  }
  if (route.kind == web::AnswerKind::kEvents) {
    return Request(std::string(route.method), path, "Last-Event-ID: 3\r\n",
                   route.body.empty() ? "" : R"({"frames":3,"orbit":{"sweepDeg":90}})");
  }
  const std::string body = route.body.empty() ? "" : R"({"requestId":"abc"})";
  return Request(std::string(route.method), path, "Connection: close\r\n", body);
}

}  // namespace

std::map<std::string, std::string> HttpSeeds() {
  std::map<std::string, std::string> seeds;
  for (const web::Route& route : web::Routes()) {
    std::string name = absl::StrCat(std::string(route.method), "-", std::string(route.path));
    std::replace_if(
        name.begin(), name.end(), [](char c) { return !isalnum(static_cast<unsigned char>(c)); },
        '-');
    seeds[name] = RequestOf(route);
  }
  const std::string close = "Connection: close\r\n";
  seeds["page"] = Request("GET", "/", "If-None-Match: \"0\"\r\n" + close, "");
  seeds["head"] = Request("HEAD", "/v1/jobs?pageSize=3&filter=state%3DFAILED", close, "");
  seeds["session"] = Request("POST", "/v1/session", close, R"({"token":"abc"})");
  seeds["session-ends"] = Request("DELETE", "/v1/session", "Cookie: litags_token=abc; x=1\r\n", "");
  seeds["token"] = Request("GET", "/v1/serverInfo", "Authorization: Bearer abc\r\n" + close, "");
  seeds["other-site"] = Request(
      "POST", "/v1/jobs", "Origin: https://evil.example\r\nSec-Fetch-Site: cross-site\r\n", "{}");
  seeds["same-site"] = Request(
      "POST", "/v1/jobs", "Origin: http://localhost:8080\r\nSec-Fetch-Site: same-origin\r\n", "{}");
  seeds["other-host"] = "GET /v1/jobs HTTP/1.1\r\nHost: evil.example\r\n\r\n";
  seeds["view-query"] = Request(
      "GET", "/v1/jobs/a/view?pose.camera=a+b.png&settings.width=320&settings.light=0.5", "", "");
  seeds["view-body"] = Request(
      "POST", "/v1/jobs/a:renderView", close,
      R"({"pose":{"lookAt":{"eye":{"z":-4},"target":{"x":1}}},"settings":{"width":32,"light":1}})");
  seeds["job-options"] = Request("POST", "/v1/jobs", close,
                                 R"({"displayName":"\u00e9","options":{"method":"METHOD_LITAGS",)"
                                 R"("iterations":"100"},"labels":{"site":"north"}})");
  seeds["update"] = Request("PATCH", "/v1/jobs/a?updateMask=displayName,labels", close,
                            R"({"displayName":"x","labels":{}})");
  seeds["part-of-file"] = Request(
      "PUT", "/v1/jobs/a/files/a.jpg",
      absl::StrCat("Content-Range: bytes 2-6/9\r\nExpect: 100-continue\r\n", kDigest), "hello");
  seeds["chunked"] =
      "POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n"
      "2;x=y\r\n{}\r\n0\r\nTrailer: 1\r\n\r\n";
  seeds["two"] = seeds["token"] + seeds["view-query"];
  seeds["old"] = "GET /v1/jobs/a/events HTTP/1.0\r\nHost: [::1]:80\r\n\r\n";
  return seeds;
}

}  // namespace litags
