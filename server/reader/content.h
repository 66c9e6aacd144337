#ifndef LITAGS_SERVER_READER_CONTENT_H_
#define LITAGS_SERVER_READER_CONTENT_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/store/job_store.h"

namespace litags {

// What a file holds.
struct Content {
  int width = 0, height = 0;  // px; 0 of cameras and COLMAP's files
  std::string about;          // its findings (file_findings.h); empty: none
};

// Reads a file, in this process, as what its role says it is, and of COLMAP's files its name. Not
// for archives.
absl::StatusOr<Content> CheckContent(std::string_view bytes, FileRole role, const std::string& name,
                                     const std::string& field);

}  // namespace litags

#endif  // LITAGS_SERVER_READER_CONTENT_H_
