#include "server/jobs/resume.h"

#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

// What no iteration that is done would have done otherwise. An option that is not named here can
// not be changed.
constexpr std::string_view kChangeable[] = {"iterations", "threads", "checkpoint_every",
                                            "preview_every"};

}  // namespace

absl::StatusOr<ReconstructOptions> ResumedOptions(const ReconstructOptions& before,
                                                  ReconstructOptions wanted) {
  for (const std::string& name : Differences(before, wanted)) {
    if (std::find(std::begin(kChangeable), std::end(kChangeable), name) != std::end(kChangeable)) {
      continue;
    }
    return InvalidInput("OPTION_NOT_RESUMABLE", absl::StrCat("options.", name),
                        absl::StrCat("options.", name,
                                     ": the job was begun with another value, which its scene is "
                                     "made of; make a new job (photos that are here already need "
                                     "not be sent again)"));
  }
  if (wanted.iterations < before.iterations) {
    return InvalidInput(
        "ITERATIONS_REDUCED", "options.iterations",
        absl::StrCat("options.iterations: the job has ", before.iterations,
                     " iterations, and can go on for more of them, not ", wanted.iterations));
  }
  if (wanted.iterations > before.iterations) {
    wanted.schedule_iterations = before.ScheduleIterations();
  }
  return wanted;
}

}  // namespace litags
