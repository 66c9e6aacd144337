// OK is the answer to an upload of which everything came, and to no other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "server/api/upload_session.h"
#include "server/testing/api_fixture.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

class WholeUpload : public ApiTest {
 protected:
  // The job, then the files, then what follows.
  std::vector<v1::UploadImagesRequest> Messages(
      const std::vector<TestFile>& files, const std::vector<v1::UploadImagesRequest>& rest = {}) {
    std::vector<v1::UploadImagesRequest> messages = {NameMessage(job_)};
    for (const TestFile& file : files) {
      for (auto& message : FileMessages(file)) messages.push_back(std::move(message));
    }
    messages.insert(messages.end(), rest.begin(), rest.end());
    return messages;
  }

  int Photos() {
    v1::Job job;
    EXPECT_TRUE(client_.Get(job_, &job).ok());
    return job.photos();
  }

  const std::string job_ = NewJob();
  const TestFile a_{"a.png", TestPng(64, 48, 1)}, b_{"b.png", TestPng(64, 48, 2)};
};

TEST_F(WholeUpload, AMessageThatDoesNotParseIsNoEndOfTheStream) {
  auto messages = Messages({a_});
  // Protobuf writes the name, with a complaint on stderr, and does not read it.
  for (auto& message : FileMessages({"caf\xE9.png", b_.bytes})) messages.push_back(message);
  EXPECT_REFUSED(client_.UploadRaw(messages), INVALID_ARGUMENT, "MESSAGE_UNREADABLE", "");
  EXPECT_EQ(Photos(), 1);  // what came before is kept
}

TEST_F(WholeUpload, TheEndSaysHowManyFilesThereAre) {
  EXPECT_REFUSED(client_.UploadRaw(Messages({a_}, {EndMessage(2)})), INVALID_ARGUMENT,
                 "UPLOAD_INCOMPLETE", "end.files");
  EXPECT_REFUSED(client_.UploadRaw(Messages({a_}, {EndMessage(0)})), INVALID_ARGUMENT,
                 "UPLOAD_INCOMPLETE", "end.files");
  EXPECT_TRUE(client_.UploadRaw(Messages({a_, b_}, {EndMessage(2)})).ok());
  EXPECT_REFUSED(client_.UploadRaw(Messages({a_, b_})), INVALID_ARGUMENT, "UPLOAD_INCOMPLETE",
                 "end");
  EXPECT_TRUE(client_.UploadRaw(Messages({}, {EndMessage(0)})).ok());
  EXPECT_REFUSED(client_.UploadRaw(Messages({}, {EndMessage(0), EndMessage(0)})), INVALID_ARGUMENT,
                 "UPLOAD_ORDER", "part");
  auto cut = Messages({a_, {"c.png", TestPng(64, 48, 3)}});
  cut.back() = EndMessage(2);
  EXPECT_REFUSED(client_.UploadRaw(cut), INVALID_ARGUMENT, "FILE_TRUNCATED", "images[c.png]");
}

TEST_F(WholeUpload, TheAnswerSaysHowManyFilesCame) {
  v1::UploadImagesResponse response;
  ASSERT_TRUE(client_.Upload(job_, {a_}, &response).ok());
  EXPECT_EQ(response.files_received(), 1);
  // One is stored already, and one has the same bytes as that.
  ASSERT_TRUE(client_.Upload(job_, {a_, {"a2.png", a_.bytes}, b_}, &response).ok());
  EXPECT_EQ(response.files_received(), 3);
  EXPECT_EQ(response.files_unchanged(), 1);
}

TEST_F(WholeUpload, OfADeletedJobTheStreamIsNotTold404) {
  const std::unique_ptr<FileReader> reader = MakeInProcessReader();
  UploadSession session(&jobs_, reader.get(), CancelToken());
  UploadSession ended(&jobs_, reader.get(), CancelToken());
  for (const auto& message : Messages({a_})) ASSERT_TRUE(session.Handle(message).ok());
  for (const auto& message : Messages({a_}, {EndMessage(1)})) {
    ASSERT_TRUE(ended.Handle(message).ok());
  }
  ASSERT_TRUE(client_.Delete(job_).ok());
  v1::UploadImagesResponse response;
  for (const absl::Status& status : {session.Handle(FileMessages(b_)[0]), ended.End(&response)}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kAborted);
    EXPECT_EQ(GetErrorDetail(status)->reason, "UPLOAD_TAKEN_OVER");
  }
}

// Calls a function when it has read a file.
class InterruptedReader : public FileReader {
 public:
  explicit InterruptedReader(std::function<void()> after) : after_(std::move(after)) {}
  absl::Status Check(const std::string& path, const std::string& field, FileRecord* file,
                     const CancelToken& cancel) override {
    const absl::Status status = reader_->Check(path, field, file, cancel);
    after_();
    return status;
  }
  absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const std::string& path,
                                                             const ArchiveLimits& limits,
                                                             const std::string& field,
                                                             ArchiveSink* sink,
                                                             const CancelToken& cancel) override {
    return reader_->OpenArchive(path, limits, field, sink, cancel);
  }

 private:
  const std::unique_ptr<FileReader> reader_ = MakeInProcessReader();
  const std::function<void()> after_;
};

// It would be stored with whatever the other stream writes.
TEST_F(WholeUpload, AFileThatAnotherStreamTakesOverWhileItIsCheckedIsNotStored) {
  const std::unique_ptr<FileReader> plain = MakeInProcessReader();
  UploadSession other(&jobs_, plain.get(), CancelToken());
  const auto messages = Messages({a_});
  InterruptedReader reader([&] {
    for (size_t i = 0; i < 2; ++i) ASSERT_TRUE(other.Handle(messages[i]).ok());
  });
  UploadSession session(&jobs_, &reader, CancelToken());
  absl::Status status;
  for (const auto& message : messages) status.Update(session.Handle(message));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(GetErrorDetail(status)->reason, "UPLOAD_TAKEN_OVER");
  EXPECT_EQ(Photos(), 0);
  for (size_t i = 2; i < messages.size(); ++i) ASSERT_TRUE(other.Handle(messages[i]).ok());
  EXPECT_EQ(Photos(), 1);
}

TEST_F(WholeUpload, AFileThatComesSlowlyKeepsItsJob) {
  UploadLimits limits;
  limits.keep_seconds = 2;
  Jobs jobs(store_.get(), blobs_.get(), data_, nullptr, limits);
  const std::string id = jobs.Create({})->id;
  const std::unique_ptr<FileReader> reader = MakeInProcessReader();
  UploadSession session(&jobs, reader.get(), CancelToken());
  ASSERT_TRUE(session.Handle(NameMessage("jobs/" + id)).ok());
  auto messages = FileMessages(a_);
  ASSERT_TRUE(session.Handle(messages[0]).ok());
  const int64_t expires_ms = jobs.Get(id)->expire_time_ms;
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  messages[1].set_chunk(messages[1].chunk().substr(0, 1));
  ASSERT_TRUE(session.Handle(messages[1]).ok());
  EXPECT_GT(jobs.Get(id)->expire_time_ms, expires_ms);
}

TEST_F(WholeUpload, TextsThatForgeOthersAreRefused) {
  const auto create = [&](const std::string& title, const std::string& id) {
    v1::CreateJobRequest request;
    request.set_display_name(title);
    request.set_request_id(id);
    v1::Job job;
    return client_.Create(request, &job);
  };
  for (const std::string& bad :
       {std::string("a\0b", 3), std::string("\x1b[2J"), std::string("a\nb"),
        std::string("a\xE2\x80\xAEgpj"), std::string("a\xC2\x9B")}) {
    EXPECT_REFUSED(create(bad, ""), INVALID_ARGUMENT, "TEXT_INVALID", "display_name");
    EXPECT_REFUSED(create("", bad), INVALID_ARGUMENT, "TEXT_INVALID", "request_id");
    EXPECT_REFUSED(client_.UploadRaw(Messages({{bad + ".png", a_.bytes}})), INVALID_ARGUMENT,
                   "BAD_FILE_NAME", "images[" + bad + ".png]");
  }
  EXPECT_TRUE(create("\xD7\x90 caf\xC3\xA9 \xE2\x80\x8F", "id 1").ok());
  grpc::ClientContext call;
  v1::ListJobsRequest list;
  list.set_page_token(std::string("12-a\0b", 6));
  v1::ListJobsResponse jobs;
  EXPECT_REFUSED(client_.jobs->ListJobs(&call, list, &jobs), INVALID_ARGUMENT, "PAGE_TOKEN_INVALID",
                 "page_token");
}

}  // namespace
}  // namespace litags
