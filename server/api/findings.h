#ifndef LITAGS_SERVER_API_FINDINGS_H_
#define LITAGS_SERVER_API_FINDINGS_H_

#include <map>
#include <optional>
#include <string>

#include "absl/types/span.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/store/job_store.h"

namespace litags {

// What is known of a job's photos, by name, before cameras are found: `files` are all of the job.
// Photos that were stored without findings are not in it.
std::map<std::string, v1::PhotoFindings> FindingsOf(absl::Span<const FileRecord> files);

// What is known of a video; nullopt of other files, and of one that was stored without findings.
std::optional<v1::VideoFindings> FoundInVideo(const FileRecord& file);

}  // namespace litags

#endif  // LITAGS_SERVER_API_FINDINGS_H_
