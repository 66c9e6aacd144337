// What a process that a file has taken over may tell the server: packets of any kind and order.
#include <cstdint>

#include "engine/core/check.h"
#include "server/api/upload_files.h"
#include "server/reader/answers.h"
#include "server/reader/channel.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags {
namespace {

constexpr ArchiveLimits kLimits{.max_entries = 20, .max_entry_bytes = 200, .max_total_bytes = 400};

// What must hold of anything that a sink is given.
class CheckingSink : public ArchiveSink {
 public:
  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    LITAGS_CHECK(!open_ && ++entries_ <= kLimits.max_entries);
    bytes_ = 0;
    const std::optional<FileRole> role = RoleInArchive(entry);
    if (!role) return false;
    if (const absl::Status name = CheckName(entry.name, *role, "file"); !name.ok()) return name;
    LITAGS_CHECK(entry.name.size() <= 255 && entry.name.find_first_of("/\\") == std::string::npos);
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
  bool open_ = false;
  int64_t entries_ = 0, bytes_ = 0, total_ = 0;
};

}  // namespace
}  // namespace litags

// A byte of length before each packet.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  std::string_view text = AsText(data, size);
  CheckingSink sink;
  const std::string field = "archives[x]";
  EntryReceiver receiver(kLimits, field, &sink);
  bool ended = false;
  while (!text.empty()) {
    const std::string_view packet = text.substr(1, static_cast<uint8_t>(text[0]));
    text.remove_prefix(1 + packet.size());
    FileRecord file;
    if (ParseVerdict(packet, field, &file).ok()) {
      LITAGS_CHECK(file.width >= 0 && file.width <= 32766 && file.height >= 0);
    }
    if (!ended) ended = !receiver.Take(packet).ok();
  }
  return 0;
}
