// Inside litags-bench: fits the constants of ExposureRule to a population.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_FIT_H_
#define LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_FIT_H_

#include <functional>
#include <vector>

#include "engine/target/exposure_rule.h"
#include "engine/tools/bench/exposure_population.h"

namespace litags {

// Fits to the cases for which `use` holds and that are there to fit to: the weights with which
// exp(score) is largest near the photo's own exposure (logistic regression over gains from -5 to
// 5 stops in steps of 1/4, the truth blurred by 0.3 stops, a ridge of 0.003).
ExposureRule FitExposureRule(const ExposurePopulation& population,
                             const std::function<bool(const ExposureCase&)>& use);

// What the rule answers too much, in stops, for each case in order, with constants fitted to the
// photos of the other four of five groups.
std::vector<double> CrossValidate(const ExposurePopulation& population);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_FIT_H_
