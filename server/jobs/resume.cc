#include "server/jobs/resume.h"

#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"

namespace litags {
namespace {

// What no iteration that is done would have done otherwise. schedule_iterations would have, and
// follows from `iterations`.
bool MayChange(std::string_view name) {
  bool may = false;
  const ReconstructOptions options;
  VisitFields(FieldsOf<ReconstructOptions>(), options,
              [&](const char* field, const auto&, const FieldRule& rule) {
                may |= name == field && !rule.shapes_scene;
              });
  return may && name != "schedule_iterations";
}

}  // namespace

absl::StatusOr<ReconstructOptions> ResumedOptions(const ReconstructOptions& before,
                                                  ReconstructOptions wanted) {
  for (const std::string& name : Differences(before, wanted)) {
    if (MayChange(name)) continue;
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
