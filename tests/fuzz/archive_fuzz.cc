// ZIP and TAR uploads: names, sizes and contents of their entries, up to what each is for.
#include "server/archive/extract.h"
#include "tests/fuzz/checking_sink.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags {
namespace {

// Small, so that limits are met: 1 MiB of zeros takes a kilobyte.
constexpr ArchiveLimits kLimits{
    .max_entries = 20, .max_entry_bytes = 1 << 20, .max_total_bytes = 2 << 20};

// Entries that nobody takes, too, have names that are no paths.
class ExtractionSink : public CheckingSink {
 public:
  ExtractionSink() : CheckingSink(kLimits) {}

  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    LITAGS_CHECK(IsPlain(entry.name));
    for (const std::string& folder : entry.folders) LITAGS_CHECK(IsPlain(folder));
    return CheckingSink::Begin(entry);
  }
};

}  // namespace
}  // namespace litags

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  ExtractionSink sink;
  ExtractArchiveBytes(AsText(data, size), kLimits, "archives[x]", &sink).IgnoreError();
  return 0;
}
