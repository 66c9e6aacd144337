// Who may do what, over real sockets with TLS: every call of every service, by its job's owner, by
// another client, by an administrator, and by nobody.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "server/auth/tokens.h"
#include "server/testing/api_fixture.h"
#include "server/testing/certificates.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

// A call with a deadline, and a token if there is one.
struct ClientCall : grpc::ClientContext {
  explicit ClientCall(const std::string& token = "") {
    set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    if (!token.empty()) AddMetadata("authorization", "Bearer " + token);
  }
};

struct Stubs {
  explicit Stubs(const std::shared_ptr<grpc::Channel>& channel)
      : jobs(v1::ReconstructionService::NewStub(channel)),
        render(v1::RenderService::NewStub(channel)),
        model(v1::ModelService::NewStub(channel)) {}
  std::unique_ptr<v1::ReconstructionService::Stub> jobs;
  std::unique_ptr<v1::RenderService::Stub> render;
  std::unique_ptr<v1::ModelService::Stub> model;
};

template <typename Request>
Request Named(const std::string& job) {
  Request request;
  request.set_name(job);
  return request;
}

// Reads a stream to its end, or cancels it after the first message: it was let in.
template <typename Message>
grpc::Status FirstOf(ClientCall& call, std::unique_ptr<grpc::ClientReader<Message>> reader) {
  Message message;
  if (!reader->Read(&message)) return reader->Finish();
  call.TryCancel();
  reader->Finish();
  return grpc::Status::OK;
}

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
  rows["litags.v1.ReconstructionService.QueryUpload"] = Unary(&Stubs::jobs, &Jobs::QueryUpload);
  rows["litags.v1.ReconstructionService.UploadImages"] = [](Stubs& stubs, ClientCall& call,
                                                            const std::string& job) {
    v1::UploadImagesResponse response;
    auto writer = stubs.jobs->UploadImages(&call, &response);
    writer->Write(NameMessage(job));
    for (const auto& message : FileMessages({"x.png", TestPng()})) writer->Write(message);
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

class AccessTest : public ::testing::Test {
 protected:
  AccessTest() {
    authority_.Issue("server");
    options_.listen = "127.0.0.1:0";
    options_.tls = {authority_.Path("server.crt"), authority_.Path("server.key"), ""};
    for (const auto& [name, token] : tokens_) {
      options_.auth.token_entries.push_back(TokenEntry(name, token));
    }
    options_.auth.admins = {"root"};
  }

  void Start() {
    auto server = StartServer(options_, &jobs_, engine_.get());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    stubs_ = std::make_unique<Stubs>(Connect());
  }

  // `client`: whose certificate to show; empty: none.
  std::shared_ptr<grpc::Channel> Connect(const std::string& client = "") {
    grpc::SslCredentialsOptions ssl;
    ssl.pem_root_certs = authority_.Read("ca.crt");
    if (!client.empty()) {
      ssl.pem_cert_chain = authority_.Read(client + ".crt");
      ssl.pem_private_key = authority_.Read(client + ".key");
    }
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    return grpc::CreateCustomChannel(Address(), grpc::SslCredentials(ssl), arguments);
  }
  std::string Address() const { return absl::StrCat("127.0.0.1:", server_->port()); }

  std::string Created(const std::string& owner) {
    ClientCall call(tokens_.at(owner));
    v1::Job job;
    const grpc::Status status = stubs_->jobs->CreateJob(&call, {}, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job.name();
  }

  std::set<std::string> Listed(const std::string& client) {
    ClientCall call(tokens_.at(client));
    v1::ListJobsResponse response;
    EXPECT_TRUE(stubs_->jobs->ListJobs(&call, {}, &response).ok());
    std::set<std::string> names;
    for (const v1::Job& job : response.jobs()) names.insert(job.name());
    return names;
  }

  const std::map<std::string, std::string> tokens_ = {
      {"alice", MakeToken()}, {"bob", MakeToken()}, {"root", MakeToken()}};
  TempDir dir_;
  TestAuthority authority_{dir_.path()};
  DataDir data_ = *DataDir::Open(dir_.path() + "/data");
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{store_.get(), blobs_.get(), data_};
  std::unique_ptr<Engine> engine_ = MakeFakeEngine();
  ServerOptions options_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<Stubs> stubs_;
};

TEST_F(AccessTest, EveryCallOfEveryServiceHasARow) {
  const std::map<std::string, Row> rows = JobCalls();
  // These name no job: the next test and ListsAndRequestIdsAreTheClientsOwn.
  const std::set<std::string> others = {"litags.v1.ReconstructionService.CreateJob",
                                        "litags.v1.ReconstructionService.ListJobs"};
  const auto* pool = google::protobuf::DescriptorPool::generated_pool();
  for (const char* service : {"ReconstructionService", "RenderService", "ModelService"}) {
    const auto* descriptor = pool->FindServiceByName(absl::StrCat("litags.v1.", service));
    ASSERT_NE(descriptor, nullptr);
    for (int i = 0; i < descriptor->method_count(); ++i) {
      const std::string name = descriptor->method(i)->full_name();
      EXPECT_TRUE(rows.count(name) + others.count(name) == 1) << name << " is not tested here";
    }
  }
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

TEST_F(AccessTest, StreamsOfOneClientAreCounted) {
  options_.limits.max_streams = 2;
  Start();
  const std::string hers = Created("alice"), his = Created("bob");
  std::vector<std::unique_ptr<ClientCall>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> open;
  v1::JobEvent event;
  for (int i = 0; i < 2; ++i) {
    calls.push_back(std::make_unique<ClientCall>(tokens_.at("alice")));
    open.push_back(stubs_->jobs->WatchJob(calls.back().get(), Named<v1::WatchJobRequest>(hers)));
    ASSERT_TRUE(open.back()->Read(&event));
  }
  const auto watch = [&](const std::string& client, const std::string& job) {
    ClientCall call(tokens_.at(client));
    return FirstOf(call, stubs_->jobs->WatchJob(&call, Named<v1::WatchJobRequest>(job)));
  };
  const grpc::Status third = watch("alice", hers);
  EXPECT_EQ(third.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(third).reason, "TOO_MANY_STREAMS");
  EXPECT_THAT(third.error_message(), HasSubstr("has 2 uploads, watches, paths and exports open"));
  EXPECT_TRUE(watch("bob", his).ok());
  calls[0]->TryCancel();
  open[0]->Finish();
  // The server learns of it a moment later.
  grpc::Status again;
  for (int i = 0; i < 200 && !(again = watch("alice", hers)).ok(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(again.ok()) << again.error_message();
  calls[1]->TryCancel();
  open[1]->Finish();
}

TEST_F(AccessTest, PicturesOfOneClientAreCountedPerSecond) {
  options_.limits.pictures_per_second = 5;
  options_.limits.picture_burst = 3;
  Start();
  const auto render = [&](const std::string& client, const std::string& job) {
    ClientCall call(tokens_.at(client));
    v1::RenderedView view;
    return DetailOf(stubs_->render->RenderView(&call, Named<v1::RenderViewRequest>(job), &view))
        .reason;
  };
  const std::string hers = Created("alice"), his = Created("bob");
  std::vector<std::string> reasons;
  for (int i = 0; i < 20; ++i) reasons.push_back(render("alice", hers));
  // No scene yet, which is an answer, for the first three; one every 200 ms comes free.
  EXPECT_EQ(std::set<std::string>(reasons.begin(), reasons.begin() + 3),
            std::set<std::string>{"SCENE_NOT_READY"});
  EXPECT_THAT(reasons, Contains("PICTURE_RATE_EXCEEDED"));
  EXPECT_EQ(render("bob", his), "SCENE_NOT_READY");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(render("alice", hers), "SCENE_NOT_READY");
}

TEST_F(AccessTest, JobsOfOneClientAreCounted) {
  options_.limits.max_jobs = 2;
  Start();
  Created("alice");
  Created("alice");
  Created("bob");
  ClientCall call(tokens_.at("alice"));
  v1::Job job;
  const grpc::Status third = stubs_->jobs->CreateJob(&call, {}, &job);
  EXPECT_EQ(third.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(third).reason, "JOB_QUOTA_REACHED");
}

TEST_F(AccessTest, BytesOfOneClientAreCountedBeforeTheyAreComplete) {
  const std::string photo = TestPng(64, 48, 1), other = TestPng(64, 48, 2);
  options_.limits.max_bytes = static_cast<int64_t>(photo.size() + other.size() / 2);
  Start();
  const auto upload = [&](const std::string& client, const std::string& job,
                          const std::string& bytes, bool whole) {
    ClientCall call(tokens_.at(client));
    v1::UploadImagesResponse response;
    auto writer = stubs_->jobs->UploadImages(&call, &response);
    writer->Write(NameMessage(job));
    auto messages = FileMessages({"x.png", bytes});
    if (!whole) messages.back().mutable_chunk()->pop_back();
    for (const auto& message : messages) writer->Write(message);
    writer->WritesDone();
    return DetailOf(writer->Finish());
  };
  const std::string hers = Created("alice"), also_hers = Created("alice"), his = Created("bob");
  EXPECT_EQ(upload("alice", hers, photo, /*whole=*/false).reason, "FILE_TRUNCATED");
  const ErrorDetail refused = upload("alice", also_hers, other, true);
  EXPECT_EQ(refused.reason, "BYTE_QUOTA_REACHED");
  EXPECT_EQ(refused.field, "images[x.png]");
  EXPECT_EQ(upload("bob", his, other, true).reason, "");
}

TEST_F(AccessTest, OversizedMessagesAndHeadersAreRefused) {
  Start();
  v1::CreateJobRequest request;
  request.set_display_name(std::string(3 << 20, 'x'));
  v1::Job job;
  ClientCall large(tokens_.at("alice"));
  EXPECT_EQ(stubs_->jobs->CreateJob(&large, request, &job).error_code(), grpc::RESOURCE_EXHAUSTED);
  ClientCall headers(tokens_.at("alice"));
  headers.AddMetadata("x-large", std::string(100 << 10, 'x'));
  EXPECT_FALSE(stubs_->jobs->CreateJob(&headers, {}, &job).ok());
  Created("alice");  // and the server lives on
}

}  // namespace
}  // namespace litags
