#ifndef LITAGS_SERVER_API_UPLOAD_SESSION_H_
#define LITAGS_SERVER_API_UPLOAD_SESSION_H_

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/api/unpack.h"
#include "server/api/upload_files.h"
#include "server/archive/extract.h"
#include "server/jobs/jobs.h"
#include "server/reader/file_reader.h"

namespace litags {

// One UploadImages stream without its transport: takes the messages in order, checks and stores
// each file. Memory stays bounded by one message and one decoded file. What came of a file that is
// not complete when the stream ends is kept for the next one.
class UploadSession {
 public:
  // A file that is being read is left when `cancel` is raised. The others must outlive this.
  UploadSession(Jobs* jobs, FileReader* reader, CancelToken cancel)
      : jobs_(jobs), reader_(reader), cancel_(std::move(cancel)) {}

  absl::Status Handle(const v1::UploadImagesRequest& request);
  // Whether the last message leaves work to do, which may take long: then Continue() is to be
  // called until it does not, and nothing else. Each call does a part, a second or so.
  bool busy() const { return catching_up_ || archive_ || unpacking_; }
  absl::Status Continue();
  // Whether Continue() will begin to unpack an archive, and whether one is being unpacked.
  bool wants_to_unpack() const { return archive_.has_value(); }
  bool unpacks() const { return unpacking_ != nullptr; }
  // How long its files were being read since the last call.
  double TakeReadingSeconds() { return std::exchange(reading_seconds_, 0.0); }
  // The stream is complete. INVALID_ARGUMENT (FILE_TRUNCATED) inside a file.
  absl::Status End(v1::UploadImagesResponse* response);

 private:
  // The file that is coming in.
  struct Incoming : UploadHeader {
    int64_t received = 0;                  // bytes, those of earlier streams included
    std::unique_ptr<PartialFile> partial;  // null: stored before, the bytes are only counted
  };

  // An archive that has come.
  struct Unpacking {
    Incoming file;
    std::unique_ptr<ArchiveSurvey> survey;  // the first reading's; null in the second
    std::unique_ptr<Unpacker> unpacker;     // the second one's
    std::unique_ptr<ArchiveReader> archive;
  };

  absl::Status Take(const v1::UploadImagesRequest& request);
  void KeepJob();  // from expiring while a file comes in for long
  absl::Status Begin(const v1::FileHeader& header);
  absl::Status Conclude(const v1::UploadEnd& end);
  absl::Status Append(const std::string& chunk);
  absl::Status CheckWhole() const;
  absl::Status CatchUp();
  absl::Status Complete();
  absl::Status Store(Incoming& file);
  absl::Status BeginUnpacking(Incoming file);
  absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const Incoming& file,
                                                             ArchiveSink* sink) const;
  // The second reading: from now on files are stored.
  absl::Status BeginStoring();
  absl::StatusOr<bool> ReadNext();  // of the archive; false: it was read twice
  absl::Status UnpackNext();
  void Count(const Unpacker& unpacker);

  Jobs* const jobs_;
  FileReader* const reader_;
  const CancelToken cancel_;
  std::string job_id_;
  std::chrono::steady_clock::time_point kept_ = std::chrono::steady_clock::now();
  std::optional<Incoming> file_;
  bool ended_ = false;               // by the client's word
  int received_ = 0;                 // files of the stream
  bool catching_up_ = false;         // with what earlier streams sent of file_
  std::optional<Incoming> archive_;  // has come
  std::unique_ptr<Unpacking> unpacking_;
  double reading_seconds_ = 0;
  int stored_ = 0, unchanged_ = 0;
  SkippedNames skipped_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_SESSION_H_
