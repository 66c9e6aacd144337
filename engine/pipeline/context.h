// What every stage of a reconstruction gets besides the result of the stage before.
#ifndef LITAGS_ENGINE_PIPELINE_CONTEXT_H_
#define LITAGS_ENGINE_PIPELINE_CONTEXT_H_

#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "engine/core/cancel.h"
#include "engine/pipeline/cut_input.h"

namespace litags {

// A stage begins or goes on, with a message for the user.
using StageReport = std::function<void(Stage stage, const std::string& message)>;
// A line of a program that a stage runs; called by any thread.
using LineReport = std::function<void(std::string_view)>;

// Refers to what it is made of, but for the input; lives as long as one reconstruction.
struct Context {
  Context(const ReconstructInput& input, const ReconstructOptions& options,
          const CancelToken& cancel, StageReport progress, ReconstructReport* report,
          LineReport on_line = nullptr)
      : Context(CutInput(input), options, cancel, std::move(progress), report, std::move(on_line)) {
  }
  Context(CutInput input, const ReconstructOptions& options, const CancelToken& cancel,
          StageReport progress, ReconstructReport* report, LineReport on_line = nullptr)
      : input(std::move(input)),
        options(options),
        recipe(options.ResolveRecipe()),
        cancel(cancel),
        progress(std::move(progress)),
        report(report),
        on_line(std::move(on_line)) {}

  void Note(std::string note) const { report->notes.push_back(std::move(note)); }

  const CutInput input;
  const ReconstructOptions& options;
  const Recipe recipe;
  const CancelToken& cancel;
  const StageReport progress;
  ReconstructReport* const report;
  const LineReport on_line;  // may be empty
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CONTEXT_H_
