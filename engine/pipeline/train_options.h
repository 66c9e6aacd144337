#ifndef LITAGS_ENGINE_PIPELINE_TRAIN_OPTIONS_H_
#define LITAGS_ENGINE_PIPELINE_TRAIN_OPTIONS_H_

#include "engine/pipeline/engine.h"
#include "engine/train/options.h"

namespace litags {

// What a job's options mean for the trainer.
TrainOptions TrainOptionsOf(const ReconstructOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_TRAIN_OPTIONS_H_
