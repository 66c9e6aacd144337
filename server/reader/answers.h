// What the server makes of the answers of a process that read a stranger's file. Whoever made the
// file may have taken the process over: it is believed nothing but that the file is good or bad.
#ifndef LITAGS_SERVER_READER_ANSWERS_H_
#define LITAGS_SERVER_READER_ANSWERS_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/archive/extract.h"
#include "server/store/job_store.h"

namespace litags {

// INVALID_ARGUMENT (FILE_CHECK_FAILED): the process that read it `how`.
absl::Status CheckFailed(const std::string& field, const std::string& how);

// The verdict on a file; sets its size if it is good. INVALID_ARGUMENT, RESOURCE_EXHAUSTED.
absl::Status ParseVerdict(std::string_view packet, const std::string& field, FileRecord* file);

// Takes what a process unpacks, and holds it to limits and order. The sink checks names.
class EntryReceiver {
 public:
  // All must outlive this.
  EntryReceiver(const ArchiveLimits& limits, const std::string& field, ArchiveSink* sink)
      : limits_(limits), field_(field), sink_(sink) {}

  // The packet to answer, packet::kWanted or kNotWanted; 0: none. Errors are the sink's, and
  // INVALID_ARGUMENT (FILE_CHECK_FAILED).
  absl::StatusOr<char> Take(std::string_view packet);

 private:
  const ArchiveLimits& limits_;
  const std::string& field_;
  ArchiveSink* const sink_;
  bool open_ = false;  // an entry that is wanted
  int64_t entries_ = 0, entry_bytes_ = 0, total_bytes_ = 0;
};

}  // namespace litags

#endif  // LITAGS_SERVER_READER_ANSWERS_H_
