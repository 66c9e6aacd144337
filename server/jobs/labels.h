#ifndef LITAGS_SERVER_JOBS_LABELS_H_
#define LITAGS_SERVER_JOBS_LABELS_H_

#include <map>
#include <string>

#include "absl/status/status.h"

namespace litags {

// A client's own words about its job.
using Labels = std::map<std::string, std::string>;

// INVALID_ARGUMENT (LABELS_INVALID, field "labels" or "labels.KEY") unless there are 64 at most,
// with keys of 1..63 lower-case letters, digits, '_' and '-' that begin with a letter, and values
// of at most 63 letters, digits, '_', '.' and '-'.
absl::Status CheckLabels(const Labels& labels);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_LABELS_H_
