// What one client makes the server do, and the others meanwhile, over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/image.h"
#include "engine/io/picture_io.h"
#include "server/api/cpu_budget.h"
#include "server/reader/file_reader.h"
#include "server/store/digest.h"
#include "server/testing/access_fixture.h"
#include "server/testing/archives.h"
#include "server/testing/eventually.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

// So many photos that take long to decode and little to send, each with other bytes.
std::string ArchiveOfLargePhotos(int photos) {
  static const std::string kPhoto = [] { return *EncodePng(ImageU8(3000, 3000)); }();
  std::vector<std::pair<std::string, std::string>> files;
  for (int i = 0; i < photos; ++i) {
    files.emplace_back(absl::StrCat(i, ".png"), absl::StrCat(kPhoto, "after its end ", i));
  }
  return Tar(files);
}

class FairTurns : public AccessTest {
 protected:
  // The answer of an upload of one file.
  ErrorDetail Send(ClientCall* call, const std::string& job, const TestFile& file,
                   v1::UploadImagesResponse* response = nullptr) {
    v1::UploadImagesResponse unused;
    const auto writer = stubs_->jobs->UploadImages(call, response ? response : &unused);
    writer->Write(NameMessage(job));
    for (const auto& message : FileMessages(file)) writer->Write(message);
    writer->Write(EndMessage(1));
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (status.ok()) return {};
    const ErrorDetail detail = DetailOf(status);
    return detail.reason.empty() ? ErrorDetail{absl::StrCat(status.error_code()), ""} : detail;
  }
  ErrorDetail Upload(const std::string& client, const std::string& job, const TestFile& file,
                     v1::UploadImagesResponse* response = nullptr) {
    ClientCall call(tokens_.at(client));
    return Send(&call, job, file, response);
  }

  int64_t Photos(const std::string& client, const std::string& name) {
    ClientCall call(tokens_.at(client));
    v1::Job job;
    EXPECT_TRUE(stubs_->jobs->GetJob(&call, Named<v1::GetJobRequest>(name), &job).ok());
    return job.photos();
  }

  // Until the job has some photos.
  void AwaitPhotos(const std::string& client, const std::string& job, int64_t photos) {
    for (int i = 0; i < 2000 && Photos(client, job) < photos; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    ASSERT_GE(Photos(client, job), photos);
  }
};

TEST_F(FairTurns, OthersHaveTheirTurnBetweenTheFilesOfAnArchive) {
  options_.blob_threads = 1;
  Start();
  constexpr int kPhotos = 40;
  const std::string hers = Created("alice"), his = Created("bob");
  ClientCall call(tokens_.at("alice"));
  call.set_deadline(std::chrono::system_clock::now() + std::chrono::minutes(5));
  std::thread upload([&, tar = ArchiveOfLargePhotos(kPhotos)] {
    Send(&call, hers, {"a.tar", tar, v1::FILE_ROLE_ARCHIVE});
  });
  AwaitPhotos("alice", hers, 1);
  EXPECT_EQ(Upload("bob", his, {"b.png", TestPng()}).reason, "");
  EXPECT_LT(Photos("alice", hers), kPhotos);  // she is not done yet
  call.TryCancel();
  upload.join();
}

TEST_F(FairTurns, UploadsBeyondTheBudgetOfTheirClientWait) {
  options_.upload_cpu = {.per_second = 1e-9, .burst_seconds = 0.15};
  Start();
  constexpr int kPhotos = 8;
  const std::string hers = Created("alice"), his = Created("bob");
  ClientCall call(tokens_.at("alice"));
  call.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(3));
  const std::string tar = ArchiveOfLargePhotos(kPhotos);
  EXPECT_EQ(Send(&call, hers, {"a.tar", tar, v1::FILE_ROLE_ARCHIVE}).reason,
            absl::StrCat(grpc::DEADLINE_EXCEEDED));
  EXPECT_LT(Photos("alice", hers), kPhotos);
  EXPECT_EQ(Upload("bob", his, {"b.png", TestPng()}).reason, "");
}

// Reads in this process, slowly, and knows how many archives were open at one time.
class CountingReader : public FileReader {
 public:
  absl::Status Check(const std::string& path, const std::string& field, FileRecord* file,
                     const CancelToken& cancel) override {
    return reader_->Check(path, field, file, cancel);
  }
  absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const std::string& path,
                                                             const ArchiveLimits& limits,
                                                             const std::string& field,
                                                             ArchiveSink* sink,
                                                             const CancelToken& cancel) override {
    auto archive = reader_->OpenArchive(path, limits, field, sink, cancel);
    if (!archive.ok()) return archive.status();
    return std::make_unique<Archive>(this, *std::move(archive));
  }
  int most() const { return most_; }

 private:
  class Archive : public ArchiveReader {
   public:
    Archive(CountingReader* counter, std::unique_ptr<ArchiveReader> archive)
        : counter_(counter), archive_(std::move(archive)) {
      const int open = ++counter_->open_;
      for (int most = counter_->most_; open > most;) {
        if (counter_->most_.compare_exchange_weak(most, open)) break;
      }
    }
    ~Archive() override { --counter_->open_; }
    absl::StatusOr<bool> ReadNext() override {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      return archive_->ReadNext();
    }

   private:
    CountingReader* const counter_;
    const std::unique_ptr<ArchiveReader> archive_;
  };

  const std::unique_ptr<FileReader> reader_ = MakeInProcessReader();
  std::atomic<int> open_ = 0, most_ = 0;
};

TEST_F(FairTurns, OneClientUnpacksSomeArchivesAtATime) {
  CountingReader reader;
  options_.reader = &reader;
  Start();
  constexpr int kArchives = 24, kFiles = 30;
  const std::string job = Created("alice");
  std::vector<std::thread> uploads;
  for (int i = 0; i < kArchives; ++i) {
    std::vector<std::pair<std::string, std::string>> files;
    for (int k = 0; k < kFiles; ++k) {
      files.emplace_back(absl::StrCat(i, "-", k, ".png"), TestPng(16, 16, kFiles * i + k));
    }
    uploads.emplace_back([&, i, tar = Tar(files)] {
      EXPECT_EQ(Upload("alice", job, {absl::StrCat(i, ".tar"), tar, v1::FILE_ROLE_ARCHIVE}).reason,
                "");
    });
  }
  for (std::thread& upload : uploads) upload.join();
  EXPECT_EQ(Photos("alice", job), kArchives * kFiles);
  EXPECT_GT(reader.most(), 3);
  // Half of all, and those that other threads open at the same moment.
  EXPECT_LE(reader.most(), 8 + options_.blob_threads);
}

// A process that reads for a client takes from what the client may have.
TEST_F(FairTurns, TheTimeOfAReaderCounts) {
  CountingReader slow;  // and takes hardly any of the thread's time
  options_.reader = &slow;
  options_.upload_cpu = {.per_second = 1e-9, .burst_seconds = 0.2};
  Start();
  std::vector<std::pair<std::string, std::string>> files;
  for (int i = 0; i < 200; ++i) files.emplace_back(absl::StrCat(i, ".txt"), "");
  files.emplace_back("last.png", TestPng());
  ClientCall call(tokens_.at("alice"));
  call.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(3));
  const std::string job = Created("alice");
  EXPECT_EQ(Send(&call, job, {"a.tar", Tar(files), v1::FILE_ROLE_ARCHIVE}).reason,
            absl::StrCat(grpc::DEADLINE_EXCEEDED));
  EXPECT_EQ(Photos("alice", job), 0);
  server_.reset();  // the call may still read
}

TEST(CpuBudget, IsOfEachClientAndComesBack) {
  CpuBudget budget({.per_second = 50, .burst_seconds = 1});
  EXPECT_EQ(budget.SecondsToWait("alice"), 0);
  budget.Spend("alice", 0.5);
  EXPECT_EQ(budget.SecondsToWait("alice"), 0);
  budget.Spend("alice", 1000);
  const double wait = budget.SecondsToWait("alice");
  EXPECT_GT(wait, 1);
  EXPECT_LE(wait, 20);
  EXPECT_EQ(budget.SecondsToWait("bob"), 0);
  budget.Spend("bob", 3);
  for (int i = 0; i < 1000 && budget.SecondsToWait("bob") > 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(budget.SecondsToWait("bob"), 0);
}

// What a job of the client has is not decoded again: here it could not be.
TEST_F(FairTurns, BytesThatTheClientHasAreNotDecodedAgain) {
  Start();
  const std::string known = "no picture at all";
  const auto alice = jobs_.For({.owner = "alice"});
  const std::string path = dir_.path() + "/known";
  std::ofstream(path) << known;
  ASSERT_TRUE(alice->uploads()
                  .Add(alice->Create({})->id,
                       {"known.png", FileRole::kPhoto, static_cast<int64_t>(known.size()),
                        Sha256::Hex(known), 64, 48},
                       path)
                  .ok());
  const std::string hers = Created("alice"), his = Created("bob");
  v1::UploadImagesResponse response;
  EXPECT_EQ(Upload("alice", hers, {"sent.png", known}, &response).reason, "");
  EXPECT_EQ(response.files_stored(), 1);
  const std::string tar = Tar({{"packed.png", known}, {"again.png", known}});
  EXPECT_EQ(Upload("alice", hers, {"a.tar", tar, v1::FILE_ROLE_ARCHIVE}, &response).reason, "");
  EXPECT_EQ(response.files_stored(), 2);
  EXPECT_EQ(Photos("alice", hers), 3);
  EXPECT_EQ(Upload("bob", his, {"sent.png", known}).reason, "IMAGE_NOT_RECOGNIZED");
}

class LongExports : public ApiTest {
 protected:
  std::string Finished(const std::string& first_photo) {
    const std::string job = client_.StartedJob({first_photo, "b", "c"}, 10);
    client_.WaitFor(job, v1::JOB_STATE_SUCCEEDED);
    return job;
  }
  int FilesInFlight() const {
    const std::filesystem::directory_iterator files(data_.tmp());
    return static_cast<int>(std::distance(begin(files), end(files)));
  }
};

TEST_F(LongExports, AreWrittenOneAtATimeAndHoldUpNoPictures) {
  StartWorker();
  const std::string heavy = Finished("heavy"), light = Finished("a");
  ServerOptions options = Options();
  options.listen = "127.0.0.1:0";
  options.render_threads = 1;
  server_ = *StartServer(options, &jobs_, engine_.get());
  const Stubs stubs(grpc::CreateChannel(absl::StrCat("127.0.0.1:", server_->port()),
                                        grpc::InsecureChannelCredentials()));
  std::vector<std::unique_ptr<ClientCall>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::ExportModelResponse>>> exports;
  for (int i = 0; i < 3; ++i) {  // each takes 20 s
    calls.push_back(std::make_unique<ClientCall>());
    exports.push_back(
        stubs.model->ExportModel(calls.back().get(), Named<v1::ExportModelRequest>(heavy)));
  }
  ASSERT_TRUE(Eventually([&] { return FilesInFlight() > 0; }));
  v1::RenderViewRequest request;
  request.set_name(light);
  request.mutable_pose()->set_camera("b.png");
  ClientCall call;
  call.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
  v1::RenderedView view;
  const grpc::Status status = stubs.render->RenderView(&call, request, &view);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(FilesInFlight(), 1);
  for (const auto& export_call : calls) export_call->TryCancel();
  for (const auto& reader : exports) EXPECT_EQ(reader->Finish().error_code(), grpc::CANCELLED);
}

class MaxWait : public ApiTest {};

TEST_F(MaxWait, CountsWhileNoThreadIsFree) {
  StartWorker();
  const std::string job = client_.StartedJob({"heavy", "b", "c"}, 10);
  client_.WaitFor(job, v1::JOB_STATE_SUCCEEDED);
  ServerOptions options = Options();
  options.listen = "127.0.0.1:0";
  options.render_threads = 1;
  options.connections.max_wait_seconds = 0.3;
  server_ = *StartServer(options, &jobs_, engine_.get());
  const Stubs stubs(grpc::CreateChannel(absl::StrCat("127.0.0.1:", server_->port()),
                                        grpc::InsecureChannelCredentials()));
  ClientCall heavy_call;  // takes 20 s, and the only thread
  std::atomic<bool> heavy_is_over = false;
  std::thread heavy([&] {
    v1::RenderViewRequest request;
    request.set_name(job);
    request.mutable_pose()->set_camera("b.png");
    v1::RenderedView view;
    stubs.render->RenderView(&heavy_call, request, &view);
    heavy_is_over = true;
  });
  std::string reason;
  for (int i = 0; i < 1000 && reason.empty(); ++i) {
    ClientCall call;
    v1::ListCamerasResponse response;
    const auto request = Named<v1::ListCamerasRequest>(job);
    reason = DetailOf(stubs.render->ListCameras(&call, request, &response)).reason;
  }
  EXPECT_EQ(reason, "WAITED_TOO_LONG");
  EXPECT_FALSE(heavy_is_over);
  heavy_call.TryCancel();
  heavy.join();
}

}  // namespace
}  // namespace litags
