// How far a reconstruction is, as lines for a terminal or a log.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_PROGRESS_LINES_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_PROGRESS_LINES_H_

#include <chrono>
#include <string>

#include "engine/pipeline/report.h"

namespace litags {

// Prints to stderr: every message, every snapshot with a preview, and iterations in between if ten
// seconds went by without a line.
class ProgressLines : public ReconstructObserver {
 public:
  void OnProgress(const Progress& progress) override;
  void OnSnapshot(const std::string&) override {}

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_PROGRESS_LINES_H_
