// Photos as the engine looks at them, by what was found in them when they were uploaded.
#ifndef LITAGS_SERVER_JOBS_PHOTO_LOOKS_H_
#define LITAGS_SERVER_JOBS_PHOTO_LOOKS_H_

#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/pipeline/photo_look.h"
#include "server/reader/file_findings.h"
#include "server/store/job_store.h"

namespace litags {

// `with_cameras`: cameras are given, and say which photos are cut into views.
ScreenedPhoto LookOf(const FileRecord& photo, const PhotoFindings& findings, bool with_cameras);

// As WhyLeftOut(), of looks by LookOf(), which do not know what the one colour of a photo is.
std::vector<std::string> WhyLeftOutAsFound(absl::Span<const ScreenedPhoto> photos);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_PHOTO_LOOKS_H_
