// Command-line options made from the fields of JobOptions.
#ifndef LITAGS_CLIENT_OPTION_FLAGS_H_
#define LITAGS_CLIENT_OPTION_FLAGS_H_

#include <CLI/App.hpp>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "litags/v1/job.pb.h"

namespace litags::client {

// Adds --<name> for every field of JobOptions, or for those in `names` alone, with the field's help
// (help.proto). Only what is given is set in `options`, which must outlive parsing: the service has
// the defaults.
void AddOptionFlags(CLI::App& command, v1::JobOptions& options, const std::string& group,
                    const std::set<std::string>& names = {});

// INVALID_ARGUMENT (OPTION_UNUSED) if `options` name a source of depth or a white balance that
// their method or tone does not use.
absl::Status CheckMethodUses(const v1::JobOptions& options);

// INVALID_ARGUMENT (OPTION_UNUSED) if `options` say how many frames become photos of what is no
// video.
absl::Status CheckFramesAreOfVideo(const v1::JobOptions& options, bool is_video);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_OPTION_FLAGS_H_
