// How the server reads what strangers upload: photos, masks, depth maps, cameras, archives.
#ifndef LITAGS_SERVER_READER_FILE_READER_H_
#define LITAGS_SERVER_READER_FILE_READER_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/archive/extract.h"
#include "server/store/job_store.h"

namespace litags {

// Thread-safe.
class FileReader {
 public:
  virtual ~FileReader() = default;

  // Reads the file at `path` as what its record says it is; sets the size of pictures. Not for
  // archives. INVALID_ARGUMENT (FILE_CHECK_FAILED and those of the formats); UNAVAILABLE
  // (FILE_CHECK_UNAVAILABLE); CANCELLED.
  virtual absl::Status Check(const std::string& path, const std::string& field, FileRecord* file,
                             const CancelToken& cancel) = 0;

  // ArchiveReader::Open(), with the two reasons above. What it returns must not outlive this.
  virtual absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const std::string& path,
                                                                     const ArchiveLimits& limits,
                                                                     const std::string& field,
                                                                     ArchiveSink* sink,
                                                                     const CancelToken& cancel) = 0;
};

// Reads in this process: for tests.
std::unique_ptr<FileReader> MakeInProcessReader();

// What reading one file may cost.
struct ReaderLimits {
  // A photo of 64 megapixels, the largest that is taken, needs half of it.
  int64_t memory_bytes = int64_t{3} << 30;
  // Of a processor. That photo takes 5 s on a slow one; a JPEG may claim a thousand passes.
  int file_seconds = 60;
  // The largest archive takes two minutes.
  int archive_seconds = 600;
};

// Reads each file in a process of its own, which has nothing of this one (no environment, no files
// but the one, no sockets), can make no system calls but those that computing needs, and ends when
// the file is read. `command` is a program that calls ReadFilesMain(); it starts with the first
// file, makes the processes, and is started again should it end.
std::unique_ptr<FileReader> MakeRemoteReader(std::vector<std::string> command,
                                             ReaderLimits limits = {});

}  // namespace litags

#endif  // LITAGS_SERVER_READER_FILE_READER_H_
