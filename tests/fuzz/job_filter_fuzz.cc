// The filter of ListJobs: whatever parses can be asked about any job.
#include <string>

#include "server/api/job_filter.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text{litags::AsText(data, size)};
  const auto filter = litags::ParseJobFilter(text);
  if (!filter.ok()) return 0;
  litags::JobRecord job;
  (*filter)(job);
  job.id = "0123456789abcdef";
  job.display_name = text;
  job.labels = R"({"site":"north"})";
  job.create_time_ms = 1793491200000;
  (*filter)(job);
  job.labels = text;  // a row that is broken
  (*filter)(job);
  return 0;
}
