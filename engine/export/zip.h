// Inside this module: files in a ZIP file, stored as they are.
#ifndef LITAGS_ENGINE_EXPORT_ZIP_H_
#define LITAGS_ENGINE_EXPORT_ZIP_H_

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace litags {

// (name, content) of each. FAILED_PRECONDITION (EXPORT_OUT_OF_RANGE) beyond 4 GiB.
absl::StatusOr<std::string> StoredZip(
    const std::vector<std::pair<std::string, std::string>>& files);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_ZIP_H_
