// litags-bench score: pictures of any origin against photos of the same names.
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/eval/lpips.h"
#include "engine/io/image_io.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/evaluation/evaluation.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct ScoreArguments {
  std::string pictures, truth, lpips, json;
};

// The names of the photos in a folder, by stem; other files do not count.
absl::StatusOr<std::map<std::string, std::string>> PhotosByStem(const std::string& dir,
                                                                const char* field) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(dir, field));
  std::map<std::string, std::string> by_stem;
  for (const std::string& name : names) {
    const auto [other, added] = by_stem.emplace(fs::path(name).stem().string(), name);
    if (added) continue;
    return InvalidInput("PICTURE_TWICE", field,
                        absl::StrCat(field, ": ", dir, " holds ", other->second, " and ", name,
                                     ", and pictures are paired by what is before the ending; "
                                     "remove one"));
  }
  return by_stem;
}

absl::Status Score(const ScoreArguments& args) {
  LITAGS_ASSIGN_OR_RETURN(const auto truth_by_stem, PhotosByStem(args.truth, "truth"));
  LITAGS_ASSIGN_OR_RETURN(const auto pictures_by_stem, PhotosByStem(args.pictures, "pictures"));
  std::optional<Lpips> lpips;
  if (!args.lpips.empty()) {
    LITAGS_ASSIGN_OR_RETURN(lpips, Lpips::Load(args.lpips));
  }
  Scorer scorer(args.truth, lpips.has_value() ? &*lpips : nullptr);
  std::map<std::string, std::string> pictures;  // sorted
  for (const auto& [stem, name] : pictures_by_stem) {
    const auto truth = truth_by_stem.find(stem);
    if (truth != truth_by_stem.end()) pictures[truth->second] = fs::path(args.pictures) / name;
  }
  for (const auto& [name, path] : pictures) {
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, ReadImage(path, path));
    LITAGS_RETURN_IF_ERROR(scorer.Add({.view = {name, Camera()}, .distortion = {}}, picture));
  }
  LITAGS_ASSIGN_OR_RETURN(const Scores scores, scorer.Finish());
  for (const ViewScore& v : scores.views) {
    std::printf("%s  PSNR %.2f dB  SSIM %.4f\n", v.name.c_str(), v.psnr, v.ssim);
  }
  std::printf("mean of %d: PSNR %.2f dB  SSIM %.4f  (after one colour fit %.2f dB)\n",
              static_cast<int>(scores.views.size()), scores.psnr, scores.ssim, scores.psnr_affine);
  if (scores.lpips.has_value()) std::printf("LPIPS %.4f\n", *scores.lpips);
  return WriteJson(args.json, scores.ToJson());
}

}  // namespace

void AddScoreCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<ScoreArguments>();
  CLI::App* command = app->add_subcommand("score", "Compares pictures with photos of equal names");
  command->add_option("pictures", args->pictures, "folder of renders")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("truth", args->truth, "folder of photos; extensions may differ")
      ->required()
      ->check(CLI::ExistingDirectory);
  AddLpipsOption(command, &args->lpips);
  AddJsonOption(command, &args->json);
  WhenGiven(command, exit_status, [args] { return Score(*args); });
}

}  // namespace litags
