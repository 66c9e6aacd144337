// litags-bench depth: the depth maps of stereo against the truth, or against those of other light.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/train_set.h"
#include "engine/stereo/stereo.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "engine/tools/evaluation/process_usage.h"
#include "engine/tools/evaluation/true_depth.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct DepthArguments {
  BenchmarkScene scene;
  StereoOptions stereo;
  std::string against, out, json;
};

using Maps = std::vector<std::optional<DepthMap>>;

// Pixels of all views, by how far the map is from the reference. Where the reference knows nothing
// (0) a pixel counts for nothing.
struct Errors {
  double pixels = 0, known = 0, within_1 = 0, within_2 = 0, within_5 = 0;
  double weight = 0, weight_within_2 = 0;  // by confidence

  void Add(const DepthMap& map, const Planes& reference) {
    for (size_t i = 0; i < reference.data.size(); ++i) {
      if (!(reference.data[i] > 0)) continue;
      ++pixels;
      const float confidence = map.confidence.data[i];
      if (!(confidence > 0)) continue;
      const double error = std::abs(map.depth.data[i] / reference.data[i] - 1);
      ++known;
      within_1 += error < 0.01;
      within_2 += error < 0.02;
      within_5 += error < 0.05;
      weight += confidence;
      weight_within_2 += error < 0.02 ? confidence : 0;
    }
  }
};

// Of the photos' size.
absl::StatusOr<Maps> Compute(const std::vector<TrainView>& views, const std::vector<Photo>& photos,
                             const std::vector<SparsePoint>& points, const StereoOptions& options,
                             double* cpu_seconds) {
  std::vector<PosedPhoto> posed;
  for (size_t i = 0; i < views.size(); ++i) posed.push_back({&views[i].view, &photos[i], nullptr});
  const double start = CpuSeconds();
  LITAGS_ASSIGN_OR_RETURN(Maps maps,
                          StereoDepth(posed, points, options, CancelToken(), [](int, int) {}));
  *cpu_seconds = CpuSeconds() - start;
  for (size_t i = 0; i < maps.size(); ++i) {
    if (!maps[i].has_value()) continue;
    const DepthMap small = *std::move(maps[i]);
    ResizeDepth(small, photos[i].width, photos[i].height, options.threads, &*maps[i]);
  }
  return maps;
}

absl::StatusOr<std::vector<Photo>> ReadPhotos(const std::string& dir,
                                              const std::vector<TrainView>& views) {
  std::vector<Photo> photos;
  for (const TrainView& v : views) {
    LITAGS_ASSIGN_OR_RETURN(Photo photo, ReadPhoto(dir + "/" + v.view.name, v.view.name));
    if (photo.width != v.photo.width || photo.height != v.photo.height) {
      return InvalidInput("SIZE_MISMATCH", v.view.name,
                          absl::StrCat(v.view.name, " has another size in ", dir));
    }
    photos.push_back(std::move(photo));
  }
  return photos;
}

absl::Status MeasureDepth(DepthArguments args) {
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(args.out, ignored);
  ReconstructOptions options;
  options.depth_source = DepthOrigin::kNone;
  options.recipe = WithoutPrior(Litags());
  LITAGS_ASSIGN_OR_RETURN(const ReconstructInput input, args.scene.Input(args.out, &options));
  ReconstructReport report;
  const CancelToken never;
  const Context context(
      input, options, never, [](Stage, const std::string&) {}, &report);
  LITAGS_ASSIGN_OR_RETURN(const TrainSet capture, MakeTrainSet(context, "colmap"));
  const std::vector<TrainView>& views = capture.train;
  const std::vector<SparsePoint> points =
      PointsOfFew(capture.points, capture.point_views, /*most=*/0);
  std::vector<Photo> photos;
  for (const TrainView& v : views) photos.push_back(v.photo);
  double cpu = 0;
  LITAGS_ASSIGN_OR_RETURN(const Maps maps, Compute(views, photos, points, args.stereo, &cpu));

  Maps others;
  if (!args.against.empty()) {
    double unused;
    LITAGS_ASSIGN_OR_RETURN(photos, ReadPhotos(args.scene.dir + "/" + args.against, views));
    LITAGS_ASSIGN_OR_RETURN(others, Compute(views, photos, points, args.stereo, &unused));
  }
  Errors errors;
  int made = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const Camera& camera = views[i].view.camera;
    const std::string stem = Stem(views[i].view.name);
    Planes reference;
    if (args.against.empty()) {
      LITAGS_ASSIGN_OR_RETURN(reference,
                              NeedTrueDepth(args.scene.dir + "/depth", views[i].view, "--against",
                                            "make the scene with litags-sample --truth, or compare "
                                            "with other light by --against high"));
    } else {
      reference = others[i].has_value() ? others[i]->depth : Planes(1, camera.height, camera.width);
    }
    const Planes nothing(1, camera.height, camera.width);
    errors.Add(maps[i].has_value() ? *maps[i] : DepthMap{nothing, nothing}, reference);
    if (!maps[i].has_value()) continue;
    ++made;
    LITAGS_RETURN_IF_ERROR(WritePfm(args.out + "/" + stem + ".pfm", maps[i]->depth));
    LITAGS_RETURN_IF_ERROR(
        WritePng16(args.out + "/" + stem + "_confidence.png", maps[i]->confidence));
  }
  const nlohmann::json json = {
      {"views", views.size()},
      {"maps", made},
      {"points", points.size()},
      {"cpu_seconds_per_view", cpu / views.size()},
      {"completeness", errors.known / errors.pixels},
      {"within_1_percent", errors.within_1 / errors.known},
      {"within_2_percent", errors.within_2 / errors.known},
      {"within_5_percent", errors.within_5 / errors.known},
      {"within_2_percent_by_confidence", errors.weight_within_2 / errors.weight},
  };
  std::printf("%s\n", JsonText(json, 2).c_str());
  return WriteJson(args.json, JsonText(json, 2));
}

}  // namespace

void AddDepthCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<DepthArguments>();
  CLI::App* command = app->add_subcommand(
      "depth", "Measures the depth maps of stereo against SCENE/depth or against other light");
  AddSceneOptions(command, "SCENE with low/, transforms_train.json", &args->scene);
  command->add_option("--against", args->against,
                      "compare with stereo on SCENE/LIGHT, e.g. high; default: SCENE/depth");
  command->add_option("--cameras", args->scene.cameras,
                      "transforms.json or COLMAP model instead of transforms_train.json");
  command->add_option("-o,--output,--out", args->out, "folder for cameras and maps (PFM)")
      ->required();
  command->add_option("--max-side", args->stereo.max_side, "size at which photos are matched, px")
      ->capture_default_str();
  AddThreadsOption(command, &args->stereo.threads);
  AddJsonOption(command, &args->json);
  WhenGiven(command, exit_status, [args] { return MeasureDepth(*args); });
}

}  // namespace litags
