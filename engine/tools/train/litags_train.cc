// litags-train: a folder of badly lit photos in, a scene and pictures out, without a server.
//
// DIR is a folder of photos, or a scene in the layout of the LOM benchmark (DIR/low, DIR/high,
// transforms_train.json, transforms_test.json): then its cameras are used and the renders at the
// test cameras are compared with DIR/high.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/machine_memory.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/work_folders.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "engine/tools/evaluation/evaluation.h"
#include "engine/tools/evaluation/method_options.h"
#include "engine/tools/evaluation/progress_lines.h"
#include "engine/tools/failure/failure.h"
#include "engine/tools/inspect/dataset_folder.h"
#include "engine/tools/inspect/folder_contents.h"
#include "engine/tools/inspect/inspect.h"
#include "engine/tools/interrupt/interrupt.h"
#include "engine/video/frame_process.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  BenchmarkScene scene;
  std::string out, depth, masks, depth_model, colmap = "colmap";
  bool inspect = false, strict = false;
  ReconstructOptions options;
  std::vector<std::string> set;  // constants of the recipe
};

void PrintNote(const std::string& note) {
  std::fprintf(stderr, "note: %s\n", WithoutControls(note).c_str());
}

void PrintMean(const char* what, const Scores& scores) {
  std::printf(
      "%s, mean of %d test views: PSNR %.2f dB  SSIM %.4f  (after one colour fit %.2f dB)\n", what,
      static_cast<int>(scores.views.size()), scores.psnr, scores.ssim, scores.psnr_affine);
}

// Folders of OUT for pictures.
constexpr char kViews[] = "views", kTest[] = "test";
// The pictures that a run writes into them, one a line. They are noted before they are written, so
// that the next run finds those of one that was killed.
constexpr char kPictures[] = "/pictures.txt";

absl::Status BeginPictures(const std::string& out, const std::string& folder,
                           const std::vector<std::string>& stems) {
  LITAGS_RETURN_IF_ERROR(MakeOwnFolder(fs::path(out) / folder));
  std::ofstream list(out + kPictures, std::ios::app);
  for (const std::string& stem : stems) list << folder << "/" << stem << ".png\n";
  return absl::OkStatus();
}

// Pictures and scores of an earlier run, which are of its scene. Other files stay.
void RemoveOldPictures(const std::string& out) {
  std::error_code ignored;  // writing reports what matters
  std::ifstream list(out + kPictures);
  for (std::string line; std::getline(list, line);) {
    const fs::path path = line, folder = path.parent_path();
    if (folder == kViews || folder == kTest) fs::remove(fs::path(out) / path, ignored);
  }
  fs::remove(out + kPictures, ignored);
  fs::remove(out + "/evaluation.json", ignored);
}

// Renders every test view into OUT/test and compares with the truth photos that there are.
absl::Status Evaluate(const Arguments& args, const Scene& scene) {
  UnscoredViews unscored;
  LITAGS_ASSIGN_OR_RETURN(
      std::vector<TestView> views,
      args.scene.TestViews(scene, args.out, args.options.holdout_every, &unscored));
  for (const std::string& note : unscored.Notes(views.size())) PrintNote(note);
  if (views.empty()) return absl::OkStatus();
  views = AtMost(args.options.max_image_side, std::move(views));
  const std::string truth = args.scene.TruthDir(), pictures = absl::StrCat(args.out, "/", kTest);
  LITAGS_RETURN_IF_ERROR(BeginPictures(args.out, kTest, PictureStems(NamesOf(views))));
  const absl::StatusOr<Scores> renders =
      ScoreScene(scene, views, truth, pictures, args.options.threads);
  if (absl::IsNotFound(renders.status())) {
    std::printf("%d test views rendered into %s; there is no truth photo to score them against\n",
                static_cast<int>(views.size()), pictures.c_str());
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(renders.status());
  for (const ViewScore& v : renders->views) {
    std::printf("%s  PSNR %.2f dB  SSIM %.4f\n", v.name.c_str(), v.psnr, v.ssim);
  }
  PrintMean("renders", *renders);
  LITAGS_RETURN_IF_ERROR(
      WriteFileAtomically(args.out + "/evaluation.json", renders->ToJson() + "\n"));
  std::vector<std::string> black;
  const absl::StatusOr<Scores> photos =
      ScorePhotos(args.scene.PhotosDir(), views, truth, args.options, &black);
  for (const std::string& name : black) {
    std::fprintf(stderr, "note: %s is all black: not among the brightened photos\n", name.c_str());
  }
  if (photos.ok()) PrintMean("brightened photos", *photos);
  return absl::IsNotFound(photos.status()) ? absl::OkStatus() : photos.status();
}

bool IsBenchmark(const std::string& dir) {
  std::error_code ignored;
  return fs::exists(dir + "/transforms_train.json", ignored) ||
         fs::exists(dir + "/transforms_test.json", ignored);
}

// A scene in LOM's layout is no folder of photos itself: what is meant is one of those inside.
absl::Status CheckPhotos(const BenchmarkScene& scene) {
  const bool benchmark = IsBenchmark(scene.dir);
  const std::vector<std::string> lights = FoldersOfPhotos(scene.dir);
  if (!benchmark || !scene.light.empty() || lights.empty() || ListPhotos(scene.dir, "dir").ok()) {
    return CheckHoldsPhotos(scene.PhotosDir());
  }
  return InvalidInput("NO_PHOTOS", "--light",
                      absl::StrCat(scene.dir, " holds no photos itself, but folders of them: ",
                                   absl::StrJoin(lights, ", "),
                                   "; name one with --light, as --light ", lights.back()));
}

absl::Status Unused(const char* option, const std::string& why) {
  return InvalidInput("OPTION_UNUSED", option, absl::StrCat(option, " ", why));
}

absl::Status CheckMethodUses(const ReconstructOptions& options) {
  const Recipe recipe = options.ResolveRecipe();
  const DepthOrigin source = options.depth_source;
  if (!(recipe.lita && recipe.use_depth) && source != DepthOrigin::kAuto &&
      source != DepthOrigin::kNone) {
    return Unused("--depth-source",
                  "would not be used: the method has no depth loss; leave it out, or take another "
                  "method than 3dgs");
  }
  if (recipe.tone.rule != Tone::kCapture &&
      options.white_balance != ReconstructOptions().white_balance) {
    return Unused("--white-balance",
                  "would not be used: only the tone capture balances colours; leave it out, or "
                  "give --tone capture");
  }
  return absl::OkStatus();
}

// Options that would have no effect are mistakes.
absl::Status CheckOptionsAreUsed(const Arguments& args, bool video) {
  LITAGS_RETURN_IF_ERROR(CheckFramesAreOfVideo(args.options.frames, video));
  if (video && !args.scene.light.empty()) {
    return Unused("--light", "is for folders of scenes, and this is a video; leave it out");
  }
  LITAGS_RETURN_IF_ERROR(CheckMethodUses(args.options));
  const Recipe recipe = args.options.ResolveRecipe();
  const DepthOrigin source =
      recipe.lita && recipe.use_depth ? args.options.depth_source : DepthOrigin::kNone;
  if (!args.depth_model.empty() && source != DepthOrigin::kNetwork) {
    return Unused(
        "--depth-model",
        "would not be used: give --depth-source network, and another method than 3dgs, or "
        "leave it out");
  }
  if (!args.depth.empty() && source != DepthOrigin::kMaps && source != DepthOrigin::kAuto) {
    return Unused(
        "--depth",
        "would not be used: give --depth-source maps, and another method than 3dgs, or leave "
        "it out");
  }
  if (!args.scene.truth.empty() && !args.scene.HasTestViews()) {
    return Unused(
        "--truth",
        "is for test views, and there are none: name some with --render-poses, or a scene "
        "that has transforms_test.json and --light, or leave it out");
  }
  return absl::OkStatus();
}

// How many of the photos that were not placed are test views, which nothing is trained on.
absl::StatusOr<int> CountTestPhotos(const Arguments& args, const ReconstructReport& report) {
  if (args.scene.sfm) return 0;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, args.scene.TestViews());
  const NameIndex test(NamesOf(views));
  return static_cast<int>(
      std::count_if(report.dropped.begin(), report.dropped.end(),
                    [&](const std::string& photo) { return test.Find(photo).has_value(); }));
}

void PrintReport(const ReconstructReport& report, int test_photos) {
  const std::string iterations =
      report.first_iteration == 0
          ? absl::StrCat(report.iterations, " iterations")
          : absl::StrCat("iterations ", report.first_iteration, " to ", report.iterations);
  std::printf("%d of %d photos placed (%s)%s, %d Gaussians, %s in %.1f s: %s\n", report.registered,
              report.photos - test_photos, report.sfm_preparation.c_str(),
              test_photos > 0 ? absl::StrCat(", test views: ", test_photos).c_str() : "",
              static_cast<int>(report.gaussians), iterations.c_str(), report.seconds,
              report.scene_path.c_str());
}

// That a folder that was named has a photo of a test view at least.
absl::Status CheckTruth(const BenchmarkScene& scene) {
  if (scene.truth.empty()) return absl::OkStatus();
  LITAGS_RETURN_IF_ERROR(ListPhotos(scene.truth, "--truth").status());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, scene.TestViews());
  for (const std::string& name : NamesOf(views)) {
    if (FindPhoto(scene.truth, name).ok()) return absl::OkStatus();
  }
  return InvalidInput("NO_TRUTH", "--truth",
                      absl::StrCat("--truth: no test view has a photo of its name in ", scene.truth,
                                   "; name the folder that has, or leave it out"));
}

// What the arguments say that is trained on; some of it completes `args`.
absl::StatusOr<ReconstructInput> FindInput(Arguments* args) {
  LITAGS_RETURN_IF_ERROR(CheckVideoIsThere(args->scene.dir));
  const bool video = IsVideoFile(args->scene.dir);
  LITAGS_RETURN_IF_ERROR(CheckOptionsAreUsed(*args, video));
  if (!video && args->scene.light.empty() && !IsBenchmark(args->scene.dir)) {
    LITAGS_RETURN_IF_ERROR(UseDatasetFolder(!args->scene.sfm, &args->scene.dir,
                                            &args->scene.cameras, &args->masks, &args->depth));
  }
  if (!video) LITAGS_RETURN_IF_ERROR(CheckPhotos(args->scene));
  const int holdout_every = args->options.holdout_every;
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput input, args->scene.Input(args->out, &args->options));
  if (args->options.holdout_every != holdout_every && holdout_every != 0 &&
      holdout_every != ReconstructOptions().holdout_every) {
    return Unused("--holdout-every",
                  "would not be used: the scene has test views, and nothing else is held out; "
                  "leave it out");
  }
  LITAGS_RETURN_IF_ERROR(CheckTruth(args->scene));
  input.memory_bytes = MachineMemory();
  if (video) input.video_path = args->scene.dir;
  input.frame_program = OwnPickFramesProgram();
  input.depth_dir = args->depth;
  input.masks_dir = args->masks;
  UseMasksBeside(input.images_dir, &input.masks_dir);
  LITAGS_ASSIGN_OR_RETURN(input.depth_network,
                          DepthNetwork::Parse(args->depth_model, "--depth-model"));
  LITAGS_RETURN_IF_ERROR(
      CheckOutside(args->out, {kViews, kTest},
                   {input.images_dir, input.video_path, input.cameras_path, input.depth_dir,
                    input.masks_dir, args->scene.TruthDir(), args->scene.poses}));
  LITAGS_RETURN_IF_ERROR(CheckOwnFolders(args->out, {kViews, kTest}));
  return input;
}

absl::Status MakeOutputFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return InvalidInput("BAD_OUTPUT", "-o",
                      absl::StrCat("cannot make ", path, ": ", error.message(),
                                   "; choose a folder that can be written"));
}

absl::Status Inspect(const ReconstructInput& input, const ReconstructOptions& options,
                     const CancelToken& cancel) {
  std::string text;
  const absl::Status status = InspectFolder(input, options, "", cancel, &text);
  std::fputs(WithoutControls(std::move(text)).c_str(), stdout);
  return status;
}

// Pictures, scores and notes of a finished run.
absl::Status WriteResults(const Arguments& args, const ReconstructReport& report,
                          const Scene& scene) {
  LITAGS_RETURN_IF_ERROR(scene.ExportPly(args.out + "/scene.ply", /*light=*/0));
  LITAGS_RETURN_IF_ERROR(BeginPictures(args.out, kViews, PictureStems(NamesOf(scene.views()))));
  LITAGS_RETURN_IF_ERROR(
      WriteViews(scene, absl::StrCat(args.out, "/", kViews), args.options.threads));
  LITAGS_ASSIGN_OR_RETURN(const int test_photos, CountTestPhotos(args, report));
  if (test_photos > 0) {
    std::fprintf(stderr,
                 "note: test views, compared with and not trained on: %d of the photos; they are "
                 "among those without a camera\n",
                 test_photos);
  }
  for (const std::string& note : report.notes) PrintNote(note);
  LITAGS_RETURN_IF_ERROR(Evaluate(args, scene));
  PrintReport(report, test_photos);
  return absl::OkStatus();
}

absl::Status Run(Arguments args, const CancelToken& cancel) {
  LITAGS_RETURN_IF_ERROR(SetConstants(args.set, &args.options));
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput input, FindInput(&args));
  LITAGS_RETURN_IF_ERROR(MakeOutputFolder(args.out));
  if (args.inspect || args.strict) {
    LITAGS_ASSIGN_OR_RETURN(const FolderLock lock, LockWorkDir(args.out));
    LITAGS_ASSIGN_OR_RETURN(input, PickFramesNow(input, args.options.frames, cancel));
  }
  if (args.inspect) return Inspect(input, args.options, cancel);
  if (args.strict) {
    LITAGS_RETURN_IF_ERROR(CheckAllReadable(input, args.options.threads, cancel));
  }
  for (const std::string& note : DescribeUnused(input)) {
    PrintNote(note);
  }
  std::error_code ignored;
  const bool used = fs::exists(args.out + "/scene.litags", ignored);
  if (used) {
    std::fprintf(stderr,
                 "note: %s holds the scene of an earlier run; with other photos or options it is "
                 "replaced\n",
                 args.out.c_str());
  }
  const std::unique_ptr<Engine> engine = MakeEngine(args.colmap);
  ProgressLines observer;
  LITAGS_ASSIGN_OR_RETURN(const ReconstructReport report,
                          engine->Reconstruct(input, args.options, cancel, &observer));
  LITAGS_ASSIGN_OR_RETURN(const FolderLock lock, LockWorkDir(args.out));
  LITAGS_ASSIGN_OR_RETURN(const std::shared_ptr<const Scene> scene,
                          engine->LoadScene(report.scene_path));
  if (used) RemoveOldPictures(args.out);
  return WriteResults(args, report, *scene);
}

int Main(int argc, char** argv) {
  Arguments args;
  CLI::App app("Trains a normally lit 3D scene from badly lit photos.", "litags-train");
  app.set_version_flag("--version", LITAGS_VERSION);
  app.add_option("DIR", args.scene.dir,
                 "folder of photos or of a dataset, a video, or a benchmark scene with --light")
      ->required();
  app.footer(
      "Exit codes: 0 ok; 1 no scene could be made; 2 bad usage or input; 130 interrupted: the same "
      "command goes on.");
  app.add_option("-o,--output,--out", args.out,
                 "folder for scene.litags, scene.ply, report.json and views/PHOTO.png, the photos' "
                 "views in normal light; with test views also test/PHOTO.png and evaluation.json; "
                 "work is kept there in cameras/, frames/, found_masks/, photos/, sfm/, "
                 "solved_fisheyes/ and wide_views/; a folder of such a name that is not of litags "
                 "is refused; only --inspect needs none");
  app.add_option("--light", args.scene.light,
                 "benchmark layout: photos are in DIR/LIGHT (low, over_exp, high)");
  CLI::Option* cameras = app.add_option(
      "--cameras", args.scene.cameras,
      "transforms.json, folder of a COLMAP model, or a file of OpenMVG, Meshroom, Metashape "
      "or Bundler; else COLMAP finds them");
  app.add_flag("--sfm", args.scene.sfm,
               "find the cameras with COLMAP even if DIR has transforms_train.json")
      ->excludes(cameras);
  app.add_flag("--inspect", args.inspect,
               "print what would be used of the folder and what left out, and why; train nothing");
  app.add_flag("--strict", args.strict,
               "refuse if a photo cannot be read; else it is left out while three remain");
  app.add_option("--depth", args.depth, "folder of depth maps <photo>.{png,pfm,npy}");
  app.add_option("--masks", args.masks,
                 "folder of masks <photo>.png, 0 where a pixel is not of the scene (default: the "
                 "subfolder masks of the photos, if there is one)");
  app.add_option("--depth-model", args.depth_model,
                 "ONNX depth network, for --depth-source network: FILE[,size=518x518]"
                 "[,mean=R:G:B][,std=R:G:B][,output=inverse|depth]");
  app.add_option("--render-poses", args.scene.poses,
                 "cameras of views to render into test/, of any kind that --cameras takes, in the "
                 "world of the photos' cameras (default, with --light: DIR/transforms_test.json)");
  app.add_option("--truth", args.scene.truth,
                 "folder of normally lit photos to compare with (default DIR/high)");
  app.add_option("--colmap", args.colmap, "COLMAP program")->capture_default_str();
  AddMethodOptions(&app, &args.options, &args.set);
  app.callback([&args] {
    if (args.out.empty() && !args.inspect) throw CLI::RequiredError("--output");
  });
  if (const auto exit = ParseArguments(app, argc, argv)) return *exit;

  const CancelToken& cancel = CancelOnInterrupt();
  const bool keeps = !args.out.empty();
  std::optional<ScratchFolder> scratch;
  if (!keeps) args.out = scratch.emplace().path();
  const absl::Status status = Run(args, cancel);
  if (!status.ok()) {
    const bool resumable = absl::IsCancelled(status) && keeps && !args.inspect;
    PrintError("litags-train", status, resumable ? "; run the same command to go on" : "");
  }
  return FlushOutput(ExitCodeOf(status));
}

}  // namespace
}  // namespace litags

int main(int argc, char** argv) {
  if (const auto exit = litags::MaybePickFrames(argc, argv)) return *exit;
  return litags::RunProgram("litags-train", [&] { return litags::Main(argc, argv); });
}
