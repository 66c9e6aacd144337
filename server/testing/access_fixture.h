// A server with TLS and three clients, and calls by them.
#ifndef LITAGS_SERVER_TESTING_ACCESS_FIXTURE_H_
#define LITAGS_SERVER_TESTING_ACCESS_FIXTURE_H_

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/auth/tokens.h"
#include "server/testing/api_fixture.h"
#include "server/testing/certificates.h"

namespace litags {

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

// The clients alice and bob, and root, who is an administrator.
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

  // A connection of its own. `client`: whose certificate to show; empty: none.
  std::shared_ptr<grpc::Channel> Connect(const std::string& client = "",
                                         grpc::ChannelArguments arguments = {}) {
    grpc::SslCredentialsOptions ssl;
    ssl.pem_root_certs = authority_.Read("ca.crt");
    if (!client.empty()) {
      ssl.pem_cert_chain = authority_.Read(client + ".crt");
      ssl.pem_private_key = authority_.Read(client + ".key");
    }
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
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

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_ACCESS_FIXTURE_H_
