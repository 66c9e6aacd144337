#ifndef LITAGS_SERVER_TESTING_TEST_CLIENT_H_
#define LITAGS_SERVER_TESTING_TEST_CLIENT_H_

#include <grpcpp/channel.h>

#include <memory>
#include <string>
#include <vector>

#include "engine/core/error.h"
#include "litags/v1/errors.pb.h"
#include "litags/v1/model_service.grpc.pb.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "litags/v1/render_service.grpc.pb.h"

namespace litags {

// The ErrorDetail in the answer's binary details; empty strings if there is none.
ErrorDetail DetailOf(const grpc::Status& status);

// A file to upload.
struct TestFile {
  std::string name;
  std::string bytes;
  v1::FileRole role = v1::FILE_ROLE_PHOTO;
};

// The service as a test calls it: each call one line, with a deadline so that nothing hangs.
class TestClient {
 public:
  explicit TestClient(const std::shared_ptr<grpc::Channel>& channel);

  grpc::Status Create(const v1::CreateJobRequest& request, v1::Job* job);
  grpc::Status Upload(const std::string& name, const std::vector<TestFile>& files,
                      v1::UploadImagesResponse* response = nullptr);
  grpc::Status Query(const std::string& name, const std::vector<TestFile>& files,
                     v1::QueryUploadResponse* response);
  // The messages as they are, then half-close.
  grpc::Status UploadRaw(const std::vector<v1::UploadImagesRequest>& messages);
  grpc::Status Start(const std::string& name, v1::Job* job = nullptr);
  grpc::Status Get(const std::string& name, v1::Job* job);
  grpc::Status Cancel(const std::string& name);
  grpc::Status Resume(const std::string& name, v1::Job* job = nullptr);
  grpc::Status Resume(const v1::ResumeJobRequest& request, v1::Job* job = nullptr);
  grpc::Status Delete(const std::string& name);
  // Reads until the stream ends, or until `at_most` events came (then it cancels).
  grpc::Status Watch(const std::string& name, int64_t after, std::vector<v1::JobEvent>* events,
                     size_t at_most = SIZE_MAX, bool previews = false);
  // The states a job goes through until it ends, "UPLOADING QUEUED ... "; expects events 1, 2, 3,
  // ...
  std::string History(const std::string& name);
  grpc::Status Render(const v1::RenderViewRequest& request, v1::RenderedView* view);

  // A started job of these photos; each name is "STEM.png".
  std::string StartedJob(const std::vector<std::string>& stems, int iterations = 40);
  // Polls until the job is in the state, or in another end state; returns the job.
  v1::Job WaitFor(const std::string& name, v1::JobState state, double seconds = 20);

  std::unique_ptr<v1::ReconstructionService::Stub> jobs;
  std::unique_ptr<v1::RenderService::Stub> render;
  std::unique_ptr<v1::ModelService::Stub> model;
};

// The messages that upload one file; `sha256` empty: the right one.
std::vector<v1::UploadImagesRequest> FileMessages(const TestFile& file, std::string sha256 = "",
                                                  int64_t size = -1);
v1::UploadImagesRequest NameMessage(const std::string& name);
v1::UploadImagesRequest EndMessage(int files);

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_TEST_CLIENT_H_
