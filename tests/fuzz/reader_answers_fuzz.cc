// What a process that a file has taken over may tell the server: packets of any kind and order.
#include <cstdint>

#include "engine/core/check.h"
#include "server/reader/answers.h"
#include "tests/fuzz/checking_sink.h"
#include "tests/fuzz/fuzz_support.h"

constexpr litags::ArchiveLimits kLimits{
    .max_entries = 20, .max_entry_bytes = 200, .max_total_bytes = 400};

// A byte of length before each packet.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  std::string_view text = AsText(data, size);
  CheckingSink sink(kLimits);
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
