// What stages read in place of what was given.
#ifndef LITAGS_ENGINE_PIPELINE_CUT_INPUT_H_
#define LITAGS_ENGINE_PIPELINE_CUT_INPUT_H_

#include <utility>

#include "engine/io/rig.h"
#include "engine/pipeline/engine.h"

namespace litags {

// An input whose wide photos are views (wide_views.h).
struct CutInput : ReconstructInput {
  CutInput() = default;
  explicit CutInput(ReconstructInput given) : ReconstructInput(std::move(given)) {}

  RigViews rig_views;  // of the photos, those taken from one place at once
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CUT_INPUT_H_
