// litags-bench exposure: how well the exposure of well exposed photos, and of scenes, is found.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/exposure_fit.h"
#include "engine/tools/bench/exposure_population.h"
#include "engine/tools/bench/exposure_scene.h"

namespace litags {
namespace {

// The level that `share` of the light lies below, stops.
double Quantile(const LightHistogram& light, double share) {
  double sum = 0;
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    const double weight = light.weight(bin) / light.total();
    if (weight > 0 && sum + weight >= share) {
      return LightHistogram::Stops(bin) +
             ((share - sum) / weight - 0.5) / LightHistogram::kBinsPerStop;
    }
    sum += weight;
  }
  return LightHistogram::kHighest;
}

// Errors of the rule that brings a quantile to where the photos have it on average.
std::vector<double> ErrorsOfQuantile(const ExposurePopulation& population, double share) {
  double level = 0;
  for (const ExposureCase& one : population.cases) {
    if (one.kind == "plain") level += Quantile(one.light, share) / population.photos;
  }
  std::vector<double> errors;
  for (const ExposureCase& one : population.cases) {
    errors.push_back(level - Quantile(one.light, share) - one.stops);
  }
  return errors;
}

void PrintErrors(const std::vector<double>& errors) {
  double mean = 0, square = 0, absolute = 0;
  std::vector<double> sizes;
  const auto n = static_cast<double>(errors.size());
  for (const double e : errors) {
    mean += e / n;
    square += e * e / n;
    absolute += std::abs(e) / n;
    sizes.push_back(std::abs(e));
  }
  std::sort(sizes.begin(), sizes.end());
  std::printf("  | %+.2f  %.2f  %.2f  %.2f", mean, std::sqrt(std::max(0.0, square - mean * mean)),
              absolute, sizes[size_t(0.9 * (n - 1))]);
}

void PrintTable(const ExposurePopulation& population,
                const std::vector<std::vector<double>>& errors_of_rules) {
  std::vector<std::string> kinds;
  for (const ExposureCase& one : population.cases) {
    if (std::find(kinds.begin(), kinds.end(), one.kind) == kinds.end()) kinds.push_back(one.kind);
  }
  for (const std::string& kind : kinds) {
    std::printf("%-18s", kind.c_str());
    for (const std::vector<double>& errors : errors_of_rules) {
      std::vector<double> of_kind;
      for (size_t i = 0; i < errors.size(); ++i) {
        if (population.cases[i].kind == kind) of_kind.push_back(errors[i]);
      }
      PrintErrors(of_kind);
    }
    std::printf("\n");
  }
}

// The mean code of luma of the photos when each is brightened by its `stops`.
double MeanCode(const ExposurePopulation& population, const std::vector<double>& stops) {
  double sum = 0;
  for (size_t i = 0; i < population.photos; ++i) {
    const LightHistogram& luma = population.luma[i];
    for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
      const double light = std::exp2(LightHistogram::Stops(bin) + stops[i]);
      sum += luma.weight(bin) / luma.total() * SrgbFromLinear(std::min(1.0, light));
    }
  }
  return sum / population.photos;
}

// Data sets of everyday photos publish theirs: ImageNet 0.459, COCO 0.449, Places365 0.442, Pascal
// VOC 2012 0.440.
void PrintMeanCodes(const ExposurePopulation& population, const std::vector<double>& errors) {
  std::vector<double> plain(population.photos);
  for (size_t i = 0; i < errors.size(); ++i) {
    const ExposureCase& one = population.cases[i];
    if (one.kind == "plain") plain[one.photo] = errors[i];
  }
  std::printf("mean code of luma: the photos %.3f, exposed by the rule %.3f\n",
              MeanCode(population, std::vector<double>(population.photos)),
              MeanCode(population, plain));
}

struct ExposureArguments {
  std::string photos, light = "low";
  std::vector<std::string> scenes;
  bool fit = false;
};

absl::Status MeasureScenes(const ExposureArguments& args) {
  for (const std::string& scene : args.scenes) {
    LITAGS_ASSIGN_OR_RETURN(const double error, ExposureErrorOfScene(scene, args.light));
    std::printf("%s %s: %+.2f stops\n", scene.c_str(), args.light.c_str(), error);
  }
  return absl::OkStatus();
}

absl::Status MeasurePopulation(const std::string& folder, bool fit) {
  LITAGS_ASSIGN_OR_RETURN(const ExposurePopulation population, MakeExposurePopulation(folder));
  const std::vector<double> errors = CrossValidate(population);
  std::printf("%zu photos; errors in stops: mean, deviation, mean of sizes, 90 %% quantile\n",
              population.photos);
  std::printf("%-18s  | %-22s  | %-22s  | %-22s\n", "", "median", "98 % quantile",
              "the rule, 5 folds");
  PrintTable(population,
             {ErrorsOfQuantile(population, 0.5), ErrorsOfQuantile(population, 0.98), errors});
  PrintMeanCodes(population, errors);
  if (!fit) return absl::OkStatus();
  const ExposureRule rule = FitExposureRule(population, [](const ExposureCase&) { return true; });
  std::printf("weights");
  for (const double weight : rule.weights) std::printf(" %.3f,", weight);
  std::printf("\nlightness %.2f\n", rule.lightness);
  return absl::OkStatus();
}

}  // namespace

void AddExposureCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<ExposureArguments>();
  CLI::App* command = app->add_subcommand(
      "exposure", "Errors of the exposure rule on captures made from well exposed photos");
  CLI::Option* photos =
      command->add_option("photos", args->photos, "folder of well exposed photos, 25 or more")
          ->check(CLI::ExistingDirectory);
  command->add_flag("--fit", args->fit, "also fit the rule's constants to all of them")
      ->needs(photos);
  command->add_option("--scene", args->scenes, "SCENE: error against SCENE/high; several")
      ->check(CLI::ExistingDirectory);
  command->add_option("--light", args->light, "folder of the scenes' photos")
      ->capture_default_str();
  WhenGiven(command, exit_status, [args] {
    if (args->photos.empty() && args->scenes.empty()) {
      throw CLI::RequiredError("photos or --scene");
    }
    absl::Status s = MeasureScenes(*args);
    if (s.ok() && !args->photos.empty()) s = MeasurePopulation(args->photos, args->fit);
    return s;
  });
}

}  // namespace litags
