#include "engine/tools/failure/failure.h"

#include <cstdio>

#include "engine/core/error.h"
#include "engine/tools/interrupt/interrupt.h"
#include "proto/arguments/arguments.h"

namespace litags {

int ExitCodeOf(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  if (status.ok()) return 0;
  if (absl::IsCancelled(status)) return kInterruptedExit;
  const bool of_input = detail.has_value() && (detail->reason == "TOO_FEW_PHOTOS" ||
                                               detail->reason == "VIDEO_NOT_ALONE" ||
                                               detail->reason == "FOLDER_NOT_OURS");
  return absl::IsInvalidArgument(status) || absl::IsNotFound(status) || of_input ? 2 : 1;
}

void PrintError(const std::string& program, const absl::Status& status, const std::string& hint) {
  std::fprintf(stderr, "%s: %s%s\n", program.c_str(),
               WithoutControls(std::string(status.message())).c_str(), hint.c_str());
  if (const auto detail = GetErrorDetail(status); detail.has_value()) {
    std::fprintf(stderr, "  reason %s, field %s\n", detail->reason.c_str(),
                 WithoutControls(detail->field).c_str());
  }
}

}  // namespace litags
