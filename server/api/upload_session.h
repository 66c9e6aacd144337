#ifndef LITAGS_SERVER_API_UPLOAD_SESSION_H_
#define LITAGS_SERVER_API_UPLOAD_SESSION_H_

#include <cstdint>
#include <fstream>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/jobs/jobs.h"
#include "server/store/digest.h"

namespace litags {

// One UploadImages stream without its transport: takes the messages in order, checks and stores
// each file. Memory stays bounded by one message and one decoded file.
class UploadSession {
 public:
  UploadSession(Jobs* jobs, UploadLimits limits);
  ~UploadSession();  // removes what was not stored

  absl::Status Handle(const v1::UploadImagesRequest& request);
  // The stream is complete. INVALID_ARGUMENT (FILE_TRUNCATED) inside a file.
  absl::Status End(v1::UploadImagesResponse* response);

 private:
  // The file that is coming in.
  struct Incoming {
    FileRecord record;
    std::string field;   // "images[NAME]"
    bool known = false;  // stored before: the bytes are only counted
    int64_t received = 0;
    Sha256 sha;
    std::ofstream out;
  };

  absl::Status Begin(const v1::FileHeader& header);
  absl::Status Append(const std::string& chunk);
  absl::Status Complete();

  Jobs* const jobs_;
  const UploadLimits limits_;
  const std::string staging_path_;
  std::string job_id_;
  std::optional<Incoming> file_;
  int stored_ = 0, unchanged_ = 0;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_SESSION_H_
