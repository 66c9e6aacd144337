// litags doctor: is everything in place?
#include <chrono>
#include <cstdio>
#include <memory>

#include "client/cli.h"
#include "grpcpp/grpcpp.h"

namespace litags::client {
namespace {

int Doctor(Session& session, bool health_only, bool alive_only) {
  std::printf("client   litags %s, gRPC %s, protobuf %d.%d.%d\n", LITAGS_VERSION,
              grpc::Version().c_str(), GOOGLE_PROTOBUF_VERSION / 1000000,
              GOOGLE_PROTOBUF_VERSION / 1000 % 1000, GOOGLE_PROTOBUF_VERSION % 1000);
  const auto begin = std::chrono::steady_clock::now();
  const auto serving = session.client().IsServing();
  if (absl::IsCancelled(serving.status())) return ReportError(session, serving.status());
  if (!serving.ok() && ExitCodeOf(serving.status()) == kExitUnreachable) {
    std::printf("server   %s: no answer\n", session.connection.server.c_str());
    return ReportError(session, serving.status());
  }
  const std::chrono::duration<double, std::milli> elapsed =
      std::chrono::steady_clock::now() - begin;
  std::printf("server   %s: answers (%.1f ms with connecting)\n", session.connection.server.c_str(),
              elapsed.count());
  std::printf("health   %s\n", !serving.ok() ? "not offered"
                               : *serving    ? "serving"
                                             : "NOT serving");
  if (alive_only) return serving.ok() ? kExitOk : kExitServerError;
  if (health_only) return serving.ok() && *serving ? kExitOk : kExitServerError;

  v1::ListJobsRequest request;
  request.set_page_size(1);
  const auto jobs = session.client().ListJobs(request);
  if (!jobs.ok()) {
    std::printf("service  litags.v1: %s\n", absl::IsUnimplemented(jobs.status())
                                                ? "not offered: is it another service?"
                                                : "fails");
    return ReportError(session, jobs.status());
  }
  std::printf("service  litags.v1: works\n");
  return serving.ok() && !*serving ? kExitServerError : kExitOk;
}

}  // namespace

void AddDoctorCommand(CLI::App& app, Session& session) {
  CLI::App* command = app.add_subcommand("doctor", "Check that the server answers and works");
  const auto health_only = std::make_shared<bool>(false);
  CLI::Option* health = command->add_flag(
      "--health", *health_only, "Ask the health service only, which needs no token: for probes");
  const auto alive_only = std::make_shared<bool>(false);
  command
      ->add_flag("--alive", *alive_only,
                 "The same, but it is enough that the server answers, well or not: for probes "
                 "that restart it")
      ->excludes(health);
  command->callback([&session, health_only, alive_only] {
    session.exit_code = Doctor(session, *health_only, *alive_only);
  });
}

}  // namespace litags::client
