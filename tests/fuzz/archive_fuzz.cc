// ZIP and TAR uploads: names, sizes and contents of their entries, up to what each is for.
#include <cstdint>

#include "engine/core/check.h"
#include "server/api/upload_files.h"
#include "server/archive/extract.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags {
namespace {

// Small, so that limits are met: 1 MiB of zeros takes a kilobyte.
constexpr ArchiveLimits kLimits{
    .max_entries = 20, .max_entry_bytes = 1 << 20, .max_total_bytes = 2 << 20};

// What must hold of anything that a sink is given.
class CheckingSink : public ArchiveSink {
 public:
  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    LITAGS_CHECK(!open_ && ++entries_ <= kLimits.max_entries);
    LITAGS_CHECK(IsPlain(entry.name));
    for (const std::string& folder : entry.folders) LITAGS_CHECK(IsPlain(folder));
    bytes_ = 0;
    const std::optional<FileRole> role = RoleInArchive(entry);
    if (!role) return false;
    // A name that is accepted becomes the name of a file.
    if (const absl::Status name = CheckName(entry.name, *role, "file"); !name.ok()) return name;
    LITAGS_CHECK(entry.name.size() <= 255 && entry.name.find('\0') == std::string::npos);
    open_ = true;
    return true;
  }

  absl::Status Write(std::string_view bytes) override {
    bytes_ += static_cast<int64_t>(bytes.size());
    total_ += static_cast<int64_t>(bytes.size());
    LITAGS_CHECK(open_ && bytes_ <= kLimits.max_entry_bytes && total_ <= kLimits.max_total_bytes);
    return absl::OkStatus();
  }

  absl::Status End() override {
    LITAGS_CHECK(open_);
    open_ = false;
    return absl::OkStatus();
  }

 private:
  static bool IsPlain(const std::string& part) {
    return !part.empty() && part != "." && part != ".." &&
           part.find_first_of("/\\") == std::string::npos;
  }

  bool open_ = false;
  int64_t entries_ = 0, bytes_ = 0, total_ = 0;
};

}  // namespace
}  // namespace litags

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  CheckingSink sink;
  ExtractArchiveBytes(AsText(data, size), kLimits, "archives[x]", &sink).IgnoreError();
  return 0;
}
