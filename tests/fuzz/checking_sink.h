// Where the fuzz targets of archives put their entries.
#ifndef LITAGS_TESTS_FUZZ_CHECKING_SINK_H_
#define LITAGS_TESTS_FUZZ_CHECKING_SINK_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/check.h"
#include "server/api/upload_files.h"
#include "server/archive/extract.h"

namespace litags {

// What must hold of anything that a sink is given.
class CheckingSink : public ArchiveSink {
 public:
  explicit CheckingSink(const ArchiveLimits& limits) : limits_(limits) {}

  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    LITAGS_CHECK(!open_ && ++entries_ <= limits_.max_entries);
    bytes_ = 0;
    const std::optional<FileRole> role = RoleInArchive(entry);
    if (!role) return false;
    // A name that is accepted becomes the name of a file.
    if (const absl::Status name = CheckName(entry.name, *role, "file"); !name.ok()) return name;
    LITAGS_CHECK(IsPlain(entry.name) && entry.name.size() <= 255);
    open_ = true;
    return true;
  }

  absl::Status Write(std::string_view bytes) override {
    bytes_ += static_cast<int64_t>(bytes.size());
    total_ += static_cast<int64_t>(bytes.size());
    LITAGS_CHECK(open_ && bytes_ <= limits_.max_entry_bytes && total_ <= limits_.max_total_bytes);
    return absl::OkStatus();
  }

  absl::Status End() override {
    LITAGS_CHECK(open_);
    open_ = false;
    return absl::OkStatus();
  }

 protected:
  static bool IsPlain(const std::string& part) {
    return !part.empty() && part != "." && part != ".." &&
           part.find_first_of(std::string_view("/\\\0", 3)) == std::string::npos;
  }

 private:
  const ArchiveLimits limits_;
  bool open_ = false;
  int64_t entries_ = 0, bytes_ = 0, total_ = 0;
};

}  // namespace litags

#endif  // LITAGS_TESTS_FUZZ_CHECKING_SINK_H_
