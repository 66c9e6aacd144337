#ifndef LITAGS_SERVER_ARCHIVE_EXTRACT_H_
#define LITAGS_SERVER_ARCHIVE_EXTRACT_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/core/limits.h"

namespace litags {

// What an archive may cost, however small it is itself.
struct ArchiveLimits {
  int64_t max_entries = 20000;               // files and folders
  int64_t max_entry_bytes = kMaxImageBytes;  // unpacked, of an entry that is wanted
  int64_t max_total_bytes = kMaxJobBytes;    // unpacked
  // Unpacked bytes per byte of the archive, once the former are more than 64 MiB: photos hardly
  // shrink, bombs do.
  int64_t max_ratio = 100;
};

// A regular file in an archive. Its name is data: it never becomes a path here.
struct ArchiveEntry {
  std::vector<std::string> folders;  // "capture", "images"; none is "." or ".."
  // "0001.jpg". UTF-8, but in TAR archives whose names are not.
  std::string name;
};

// A name as messages show it: UTF-8, without control characters, and not endlessly.
std::string ShownName(std::string_view name);

// Takes the files of an archive, one after the other. An error of any call ends the extraction and
// is its result.
class ArchiveSink {
 public:
  virtual ~ArchiveSink() = default;
  // False: its bytes are not wanted, and no End() follows.
  virtual absl::StatusOr<bool> Begin(const ArchiveEntry& entry) = 0;
  virtual absl::Status Write(std::string_view bytes) = 0;
  virtual absl::Status End() = 0;
};

// Reads a ZIP or TAR archive (the latter plain or gzipped) of strangers, in one pass and in little
// memory; file by file, so that others get their turn in between. `field` names it in errors,
// beside the entry at fault. Also wanted files that come before an error have been given to the
// sink. INVALID_ARGUMENT: ARCHIVE_NOT_RECOGNIZED, ARCHIVE_CORRUPT, ARCHIVE_ENCRYPTED, ARCHIVE_EMPTY
// (no
//   file in it), ARCHIVE_ENTRY_UNSAFE (links, devices, absolute names, "..", backslashes).
// RESOURCE_EXHAUSTED: ARCHIVE_TOO_MANY_ENTRIES, ARCHIVE_ENTRY_TOO_LARGE, ARCHIVE_TOO_LARGE,
//   ARCHIVE_RATIO_TOO_LARGE.
// CANCELLED.
class ArchiveReader {
 public:
  // `sink` must outlive it.
  static absl::StatusOr<std::unique_ptr<ArchiveReader>> Open(const std::string& path,
                                                             const ArchiveLimits& limits,
                                                             std::string_view field,
                                                             ArchiveSink* sink,
                                                             const CancelToken& cancel);
  virtual ~ArchiveReader() = default;
  // Gives the sink the next file. False: there was none left. Not to be called after an error.
  virtual absl::StatusOr<bool> ReadNext() = 0;
};

// All files of an archive in memory.
absl::Status ExtractArchiveBytes(std::string_view bytes, const ArchiveLimits& limits,
                                 std::string_view field, ArchiveSink* sink);

}  // namespace litags

#endif  // LITAGS_SERVER_ARCHIVE_EXTRACT_H_
