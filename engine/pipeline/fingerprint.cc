#include "engine/pipeline/fingerprint.h"

#include "engine/core/error.h"
#include "engine/io/file_util.h"

namespace litags {

absl::Status Fingerprint::AddFile(const std::string& path, std::string_view field,
                                  int64_t max_bytes) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, max_bytes));
  Add(bytes.data(), bytes.size());
  return absl::OkStatus();
}

}  // namespace litags
