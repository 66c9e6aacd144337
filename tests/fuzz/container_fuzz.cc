// Our own container file, as bytes: its table and its checksums.
#include "engine/core/check.h"
#include "engine/io/container.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  const auto file = Container::Parse(std::string(AsText(data, size)), "x", "checkpoint", 1, 2);
  if (!file.ok()) return 0;
  for (const std::string& name : file->SectionNames()) {
    LITAGS_CHECK(file->Section(name).ok());
    file->Array<float>(name).status().IgnoreError();
  }
  return 0;
}
