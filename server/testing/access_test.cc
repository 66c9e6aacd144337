// Who may do what, over real sockets with TLS: every call of every service, by its job's owner, by
// another client, by an administrator, and by nobody.
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "server/api/self_call.h"
#include "server/main/preflight.h"
#include "server/main/server_flags.h"
#include "server/testing/access_fixture.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

// One call about a job.
using Row = std::function<grpc::Status(Stubs&, ClientCall&, const std::string& job)>;

template <typename Request, typename Response, typename Stub>
Row Unary(std::unique_ptr<Stub> Stubs::*stub,
          grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*)) {
  return [=](Stubs& stubs, ClientCall& call, const std::string& job) {
    Response response;
    return ((*(stubs.*stub)).*method)(&call, Named<Request>(job), &response);
  };
}

// Every call that names a job.
std::map<std::string, Row> JobCalls() {
  using Jobs = v1::ReconstructionService::Stub;
  using Render = v1::RenderService::Stub;
  std::map<std::string, Row> rows;
  const auto jobs = [&](const char* name, auto method) {
    rows[absl::StrCat("litags.v1.ReconstructionService.", name)] = Unary(&Stubs::jobs, method);
  };
  jobs("StartJob", &Jobs::StartJob);
  jobs("GetJob", &Jobs::GetJob);
  jobs("CancelJob", &Jobs::CancelJob);
  jobs("ResumeJob", &Jobs::ResumeJob);
  jobs("DeleteJob", &Jobs::DeleteJob);
  jobs("CloneJob", &Jobs::CloneJob);
  jobs("ListFiles", &Jobs::ListFiles);
  rows["litags.v1.ReconstructionService.DeleteFile"] = [](Stubs& stubs, ClientCall& call,
                                                          const std::string& job) {
    auto request = Named<v1::DeleteFileRequest>(job);
    request.set_allow_missing(true);
    google::protobuf::Empty empty;
    return stubs.jobs->DeleteFile(&call, request, &empty);
  };
  rows["litags.v1.ReconstructionService.UpdateJob"] = [](Stubs& stubs, ClientCall& call,
                                                         const std::string& job) {
    v1::UpdateJobRequest request;
    request.mutable_job()->set_name(job);
    request.mutable_update_mask()->add_paths("display_name");
    v1::Job changed;
    return stubs.jobs->UpdateJob(&call, request, &changed);
  };
  rows["litags.v1.ReconstructionService.GetLog"] = [](Stubs& stubs, ClientCall& call,
                                                      const std::string& job) {
    return FirstOf(call, stubs.jobs->GetLog(&call, Named<v1::GetLogRequest>(job)));
  };
  rows["litags.v1.ReconstructionService.QueryUpload"] = Unary(&Stubs::jobs, &Jobs::QueryUpload);
  rows["litags.v1.ReconstructionService.UploadImages"] = [](Stubs& stubs, ClientCall& call,
                                                            const std::string& job) {
    v1::UploadImagesResponse response;
    auto writer = stubs.jobs->UploadImages(&call, &response);
    writer->Write(NameMessage(job));
    for (const auto& message : FileMessages({"x.png", TestPng()})) writer->Write(message);
    writer->Write(EndMessage(1));
    writer->WritesDone();
    return writer->Finish();
  };
  rows["litags.v1.ReconstructionService.WatchJob"] = [](Stubs& stubs, ClientCall& call,
                                                        const std::string& job) {
    return FirstOf(call, stubs.jobs->WatchJob(&call, Named<v1::WatchJobRequest>(job)));
  };
  rows["litags.v1.RenderService.RenderView"] = Unary(&Stubs::render, &Render::RenderView);
  rows["litags.v1.RenderService.ListCameras"] = Unary(&Stubs::render, &Render::ListCameras);
  rows["litags.v1.RenderService.RenderPath"] = [](Stubs& stubs, ClientCall& call,
                                                  const std::string& job) {
    return FirstOf(call, stubs.render->RenderPath(&call, Named<v1::RenderPathRequest>(job)));
  };
  rows["litags.v1.ModelService.ExportModel"] = [](Stubs& stubs, ClientCall& call,
                                                  const std::string& job) {
    return FirstOf(call, stubs.model->ExportModel(&call, Named<v1::ExportModelRequest>(job)));
  };
  return rows;
}

TEST_F(AccessTest, EveryCallOfEveryServiceHasARow) {
  const std::map<std::string, Row> rows = JobCalls();
  // These name no job, or several: the tests after the next.
  const std::set<std::string> others = {"litags.v1.ReconstructionService.CreateJob",
                                        "litags.v1.ReconstructionService.ListJobs",
                                        "litags.v1.ReconstructionService.GetServerInfo",
                                        "litags.v1.ReconstructionService.BatchDeleteJobs"};
  // A service may have a file of its own.
  const auto* pool = google::protobuf::DescriptorPool::generated_pool();
  int services = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(LITAGS_SOURCE_DIR "/proto/litags/v1")) {
    if (entry.path().extension() != ".proto") continue;
    const auto* file = pool->FindFileByName("litags/v1/" + entry.path().filename().string());
    ASSERT_NE(file, nullptr) << entry.path();
    services += file->service_count();
    for (int s = 0; s < file->service_count(); ++s) {
      for (int i = 0; i < file->service(s)->method_count(); ++i) {
        const std::string name = file->service(s)->method(i)->full_name();
        EXPECT_TRUE(rows.count(name) + others.count(name) == 1) << name << " is not tested here";
      }
    }
  }
  EXPECT_GE(services, 3);
}

TEST_F(AccessTest, EveryCallIsForOwnersAndAdministratorsOnly) {
  Start();
  for (const auto& [name, row] : JobCalls()) {
    for (const std::string client : {"alice", "root", "bob", "", "mallory"}) {
      const std::string job = Created("alice");
      const std::string token = client == "mallory" ? MakeToken()
                                : client.empty()    ? ""
                                                    : tokens_.at(client);
      ClientCall call(token);
      const grpc::Status status = row(*stubs_, call, job);
      const std::string reason = DetailOf(status).reason;
      const std::string what = absl::StrCat(name, " by \"", client, "\": ", status.error_message());
      if (client == "alice" || client == "root") {
        EXPECT_NE(status.error_code(), grpc::UNAUTHENTICATED) << what;
        EXPECT_NE(status.error_code(), grpc::NOT_FOUND) << what;
      } else if (client == "bob") {
        EXPECT_EQ(status.error_code(), grpc::NOT_FOUND) << what;
        EXPECT_EQ(reason, "JOB_NOT_FOUND") << what;
      } else {
        EXPECT_EQ(status.error_code(), grpc::UNAUTHENTICATED) << what;
        EXPECT_EQ(reason, client.empty() ? "TOKEN_MISSING" : "TOKEN_INVALID") << what;
      }
    }
  }
}

TEST_F(AccessTest, ListsAndRequestIdsAreTheClientsOwn) {
  Start();
  const std::string hers = Created("alice"), his = Created("bob");
  EXPECT_EQ(Listed("alice"), std::set<std::string>{hers});
  EXPECT_EQ(Listed("bob"), std::set<std::string>{his});
  EXPECT_EQ(Listed("root"), (std::set<std::string>{hers, his}));
  v1::CreateJobRequest request;
  request.set_request_id("same");
  std::set<std::string> made;
  for (const char* client : {"alice", "bob", "alice"}) {
    ClientCall call(tokens_.at(client));
    v1::Job job;
    ASSERT_TRUE(stubs_->jobs->CreateJob(&call, request, &job).ok());
    made.insert(job.name());
  }
  EXPECT_EQ(made.size(), 2u);
  v1::Job job;
  v1::ListJobsResponse jobs;
  ClientCall create, list;
  EXPECT_EQ(stubs_->jobs->CreateJob(&create, {}, &job).error_code(), grpc::UNAUTHENTICATED);
  EXPECT_EQ(stubs_->jobs->ListJobs(&list, {}, &jobs).error_code(), grpc::UNAUTHENTICATED);
}

TEST_F(AccessTest, NobodyDeletesAnothersJobsAmongSeveral) {
  Start();
  const std::string hers = Created("alice"), his = Created("bob");
  v1::BatchDeleteJobsRequest request;
  request.add_names(hers);
  request.add_names(his);
  request.set_allow_missing(true);
  v1::BatchDeleteJobsResponse response;
  ClientCall stranger, bob(tokens_.at("bob"));
  EXPECT_EQ(stubs_->jobs->BatchDeleteJobs(&stranger, request, &response).error_code(),
            grpc::UNAUTHENTICATED);
  EXPECT_TRUE(stubs_->jobs->BatchDeleteJobs(&bob, request, &response).ok());
  EXPECT_EQ(Listed("root"), std::set<std::string>{hers});
}

TEST_F(AccessTest, TheServerSaysWhoItTakesTheCallerFor) {
  Start();
  Created("alice");
  const auto info = [&](const std::string& client) {
    ClientCall call(tokens_.at(client));
    v1::ServerInfo info;
    EXPECT_TRUE(stubs_->jobs->GetServerInfo(&call, {}, &info).ok());
    return info.client();
  };
  EXPECT_EQ(info("alice").name(), "alice");
  EXPECT_EQ(info("alice").jobs(), 1);
  EXPECT_FALSE(info("alice").admin());
  EXPECT_EQ(info("bob").jobs(), 0);
  EXPECT_TRUE(info("root").admin());
  ClientCall stranger;
  v1::ServerInfo nothing;
  EXPECT_EQ(stubs_->jobs->GetServerInfo(&stranger, {}, &nothing).error_code(),
            grpc::UNAUTHENTICATED);
}

TEST_F(AccessTest, HealthIsForEverybody) {
  Start();
  ClientCall call;
  grpc::GenericStub stub(Connect());
  grpc::CompletionQueue queue;
  const grpc::Slice empty;  // the whole server
  const grpc::ByteBuffer request(&empty, 1);
  grpc::ByteBuffer response;
  grpc::Status status;
  auto check = stub.PrepareUnaryCall(&call, "/grpc.health.v1.Health/Check", request, &queue);
  check->StartCall();
  check->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  ASSERT_TRUE(queue.Next(&tag, &ok));
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(AccessTest, PlaintextAndForeignCertificatesDoNotConnect) {
  Start();
  TempDir other_dir;
  TestAuthority other(other_dir.path());
  grpc::SslCredentialsOptions foreign;
  foreign.pem_root_certs = other.Read("ca.crt");
  for (const auto& credentials :
       {grpc::InsecureChannelCredentials(), grpc::SslCredentials(foreign)}) {
    Stubs stubs(grpc::CreateChannel(Address(), credentials));
    ClientCall call(tokens_.at("alice"));
    v1::ListJobsResponse jobs;
    EXPECT_EQ(stubs.jobs->ListJobs(&call, {}, &jobs).error_code(), grpc::UNAVAILABLE);
  }
}

TEST_F(AccessTest, ClientCertificateNamesTheClient) {
  authority_.Issue("carol");
  authority_.Issue("ended", -60);
  options_.tls.client_ca = authority_.Path("ca.crt");
  options_.auth = {};
  Start();
  const auto list = [&](const std::string& client) {
    Stubs stubs(Connect(client));
    ClientCall call;
    v1::ListJobsResponse jobs;
    return stubs.jobs->ListJobs(&call, {}, &jobs).error_code();
  };
  EXPECT_EQ(list("carol"), grpc::OK);
  EXPECT_EQ(list(""), grpc::UNAVAILABLE);
  EXPECT_EQ(list("ended"), grpc::UNAVAILABLE);
  Stubs carol(Connect("carol")), server(Connect("server"));
  v1::Job job, seen;
  ClientCall create, get, get_other;
  ASSERT_TRUE(carol.jobs->CreateJob(&create, {}, &job).ok());
  EXPECT_TRUE(carol.jobs->GetJob(&get, Named<v1::GetJobRequest>(job.name()), &seen).ok());
  EXPECT_EQ(
      server.jobs->GetJob(&get_other, Named<v1::GetJobRequest>(job.name()), &seen).error_code(),
      grpc::NOT_FOUND);
  EXPECT_EQ(store_->Get(job.name().substr(5))->owner, "carol");
}

// A handshake over a connection of its own, by a client that trusts `ca` and shows the certificate
// `shown`, if there is one.
grpc::StatusCode Handshake(const std::string& address, const std::string& token,
                           const TestAuthority& ca, const TestAuthority* shown = nullptr) {
  grpc::SslCredentialsOptions ssl;
  ssl.pem_root_certs = ca.Read("ca.crt");
  if (shown) {
    ssl.pem_cert_chain = shown->Read("carol.crt");
    ssl.pem_private_key = shown->Read("carol.key");
  }
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  Stubs stubs(grpc::CreateCustomChannel(address, grpc::SslCredentials(ssl), arguments));
  ClientCall call(token);
  v1::ListJobsResponse jobs;
  return stubs.jobs->ListJobs(&call, {}, &jobs).error_code();
}

// The server looks at its files once a second at most.
void AwaitHandshake(grpc::StatusCode code, const std::function<grpc::StatusCode()>& handshake) {
  grpc::StatusCode found;
  for (int i = 0; i < 200 && (found = handshake()) != code; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(found, code);
}

TEST_F(AccessTest, ARenewedCertificateIsShownAndOpenConnectionsStay) {
  Start();
  TempDir renewed_dir;
  TestAuthority renewed(renewed_dir.path());
  renewed.Issue("server");
  const std::string& token = tokens_.at("alice");
  const auto by_old = [&] { return Handshake(Address(), token, authority_); };
  const auto by_new = [&] { return Handshake(Address(), token, renewed); };
  EXPECT_EQ(by_old(), grpc::OK);
  EXPECT_EQ(by_new(), grpc::UNAVAILABLE);
  Created("alice");  // opens a connection that stays

  // Half a renewal: the key is that of the old certificate.
  const auto copy = [&](const std::string& file) {
    std::filesystem::copy_file(renewed.Path(file), authority_.Path(file),
                               std::filesystem::copy_options::overwrite_existing);
  };
  copy("server.crt");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // until it is looked at
  EXPECT_EQ(by_old(), grpc::OK);
  EXPECT_EQ(by_new(), grpc::UNAVAILABLE);

  copy("server.key");
  AwaitHandshake(grpc::OK, by_new);
  EXPECT_EQ(by_old(), grpc::UNAVAILABLE);
  Created("alice");  // over the connection of before
}

TEST_F(AccessTest, RenewedClientAuthoritiesDecideAboutNewConnections) {
  TempDir renewed_dir;
  TestAuthority renewed(renewed_dir.path());
  renewed.Issue("carol");
  authority_.Issue("carol");
  std::filesystem::copy_file(authority_.Path("ca.crt"), authority_.Path("clients.crt"));
  options_.tls.client_ca = authority_.Path("clients.crt");
  options_.auth = {};
  Start();
  const auto by_old = [&] { return Handshake(Address(), "", authority_, &authority_); };
  const auto by_new = [&] { return Handshake(Address(), "", authority_, &renewed); };
  EXPECT_EQ(by_old(), grpc::OK);
  EXPECT_EQ(by_new(), grpc::UNAVAILABLE);
  std::filesystem::rename(renewed.Path("ca.crt"), authority_.Path("clients.crt"));
  AwaitHandshake(grpc::OK, by_new);
  EXPECT_EQ(by_old(), grpc::UNAVAILABLE);
}

TEST_F(AccessTest, SelfCallThatIsRefusedForItsCertificateFindsTheServerAlive) {
  TempDir renewed_dir;
  TestAuthority renewed(renewed_dir.path());
  authority_.Issue("carol");
  std::filesystem::copy_file(authority_.Path("ca.crt"), authority_.Path("clients.crt"));
  options_.tls.client_ca = authority_.Path("clients.crt");
  options_.auth = {};
  Start();
  std::atomic<bool> deaf = false;
  const SelfCall self_call({Address(), options_.tls, 0.05, 5, 3}, [&] { deaf = true; });
  AwaitHandshake(grpc::OK, [&] { return Handshake(Address(), "", authority_, &authority_); });
  std::filesystem::rename(renewed.Path("ca.crt"), authority_.Path("clients.crt"));
  AwaitHandshake(grpc::UNAVAILABLE,
                 [&] { return Handshake(Address(), "", authority_, &authority_); });
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_FALSE(deaf);
  server_->Shutdown();
  for (int i = 0; i < 200 && !deaf; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_TRUE(deaf);
}

TEST(ServerFlagsTest, ValuesThatNoWorkerAndNoCallCouldWorkWithAreRefusedAtTheStart) {
  const auto reason = [](const char* flag, const char* value,
                         const char* worker = "/bin/true") -> std::string {
    ServerFlags flags;
    CLI::App app;
    AddServerFlags(&app, &flags);
    const char* arguments[] = {"litags-server", flag, value};
    try {
      app.parse(3, arguments);
    } catch (const CLI::ValidationError&) {
      return "not parsed";
    }
    const auto detail = GetErrorDetail(CheckPrograms(flags, worker));
    return detail ? detail->reason : "OK";
  };
  EXPECT_EQ(reason("--worker-memory", "100MiB"), "OUT_OF_RANGE");
  EXPECT_EQ(reason("--worker-memory", "0"), "OK");
  EXPECT_EQ(reason("--worker-memory", "6GiB"), "OK");
  EXPECT_EQ(reason("--worker-labels", "a b"), "LABEL_INVALID");
  EXPECT_EQ(reason("--worker-labels", "avx512,site-b"), "OK");
  EXPECT_EQ(reason("--workers", "1", "/none"), "WORKER_NOT_FOUND");
  EXPECT_EQ(reason("--workers", "0", "/none"), "OK");
  EXPECT_EQ(reason("--depth-model", "/none.onnx"), "DEPTH_MODEL_NOT_FOUND");
  EXPECT_EQ(reason("--depth-model", "/bin/true"), "OK");
  EXPECT_EQ(reason("--picture-burst", "0"), "not parsed");
  EXPECT_EQ(reason("--picture-burst", "1"), "OK");
  for (const char* room : {"--max-export-bytes", "--max-unread-bytes"}) {
    EXPECT_EQ(reason(room, "0"), "not parsed") << room;
    EXPECT_EQ(reason(room, "64MiB"), "OK") << room;
  }
}

TEST_F(AccessTest, OthersAreLetInOnlyEncryptedAndByName) {
  const auto reason = [&](std::function<void(ServerOptions&)> change) {
    ServerOptions options;
    options.listen = "0.0.0.0:0";
    change(options);
    const auto detail = GetErrorDetail(CheckListening(options));
    return detail ? detail->reason : "OK";
  };
  const TlsOptions tls = options_.tls;
  const AuthOptions auth = options_.auth;
  EXPECT_EQ(reason([](ServerOptions&) {}), "PLAINTEXT_NOT_ASKED_FOR");
  EXPECT_EQ(reason([&](ServerOptions& o) { o.auth = auth; }), "PLAINTEXT_NOT_ASKED_FOR");
  EXPECT_EQ(reason([&](ServerOptions& o) { o.tls = tls; }), "NOBODY_IS_ASKED");
  EXPECT_EQ(reason([&](ServerOptions& o) { o.tls = tls, o.auth = auth; }), "OK");
  EXPECT_EQ(reason([&](ServerOptions& o) { o.tls = tls, o.tls.client_ca = "x"; }), "OK");
  EXPECT_EQ(reason([](ServerOptions& o) { o.insecure = true; }), "OK");
  EXPECT_EQ(reason([](ServerOptions& o) { o.listen = "127.0.0.1:0"; }), "OK");
  EXPECT_EQ(reason([](ServerOptions& o) { o.listen = "unix:/run/litags"; }), "OK");
  for (const char* none : {"foo", "unixbox", "unixbox:x", "[]:0", ":0", "foo:", "0.0.0.0:http",
                           "0.0.0.0:65536", "::"}) {
    EXPECT_EQ(reason([&](ServerOptions& o) { o.listen = none; }), "CANNOT_LISTEN") << none;
    EXPECT_EQ(GetErrorDetail(CheckMetricsListening(none, true))->field, "--metrics-listen") << none;
  }
  options_.listen = "0.0.0.0:0";
  options_.tls = {};
  EXPECT_FALSE(StartServer(options_, &jobs_, engine_.get()).ok());
}

TEST_F(AccessTest, AnswersCarryARequestId) {
  Start();
  const auto id_of = [&](const std::string& wanted) {
    ClientCall call(tokens_.at("alice"));
    if (!wanted.empty()) call.AddMetadata("x-request-id", wanted);
    v1::ListJobsResponse jobs;
    EXPECT_TRUE(stubs_->jobs->ListJobs(&call, {}, &jobs).ok());
    const auto& headers = call.GetServerInitialMetadata();
    const auto found = headers.find("x-request-id");
    return found == headers.end() ? "" : std::string(found->second.data(), found->second.size());
  };
  EXPECT_EQ(id_of("trace-7f.3"), "trace-7f.3");
  EXPECT_EQ(id_of("").size(), 16u);
  EXPECT_EQ(id_of("two words").size(), 16u);
  EXPECT_EQ(id_of(std::string(65, 'x')).size(), 16u);
}

}  // namespace
}  // namespace litags
