// litags-inspect: what of a folder or a video would be used. `litags inspect` starts it.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>

#include "engine/core/error.h"
#include "engine/tools/failure/failure.h"
#include "engine/tools/inspect/dataset_folder.h"
#include "engine/tools/inspect/inspect.h"
#include "engine/tools/interrupt/interrupt.h"
#include "engine/video/frame_process.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string dir, cameras, masks, depth, sheet;
  int frames = 0;
  ReconstructOptions options;  // that a run would have
};

void AddOptions(CLI::App* app, Arguments* args) {
  app->set_version_flag("--version", LITAGS_VERSION);
  app->add_option("DIR", args->dir, "Folder of photos, or of a dataset, or a video")->required();
  app->add_option("--cameras", args->cameras,
                  "Known cameras: a transforms.json, the folder of a COLMAP model, or a file of "
                  "OpenMVG, Meshroom, Metashape or Bundler");
  app->add_option("--masks", args->masks,
                  "Folder with masks of photos; default: DIR/masks, if there is one");
  app->add_option("--depth", args->depth, "Folder with depth maps of photos");
  app->add_option("--frames", args->frames, "At most so many frames of a video; 0: by its motion")
      ->check(Between(0, 2000));
  app->add_option("--contact-sheet", args->sheet,
                  "Picture of all photos, brightened, .jpg or .png");
  app->add_option("--threads", args->options.threads, "Threads; 0: all cores")
      ->check(Between(0, 1024));
}

// What a run would read. `work_dir` takes what is found only for the inspection.
absl::StatusOr<ReconstructInput> FindInput(Arguments args, const std::string& work_dir) {
  LITAGS_RETURN_IF_ERROR(CheckVideoIsThere(args.dir));
  LITAGS_RETURN_IF_ERROR(
      UseDatasetFolder(/*with_cameras=*/true, &args.dir, &args.cameras, &args.masks, &args.depth));
  ReconstructInput input;
  input.work_dir = work_dir;
  input.images_dir = args.dir;
  input.cameras_path = args.cameras;
  input.masks_dir = args.masks;
  input.depth_dir = args.depth;
  UseMasksBeside(input.images_dir, &input.masks_dir);
  input.frame_program = OwnPickFramesProgram();
  if (IsVideoFile(args.dir)) input.video_path = args.dir;
  return input;
}

absl::Status Run(const Arguments& args, const CancelToken& cancel) {
  const ScratchFolder scratch;
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput input, FindInput(args, scratch.path()));
  LITAGS_RETURN_IF_ERROR(CheckFramesAreOfVideo(args.frames, !input.video_path.empty()));
  LITAGS_ASSIGN_OR_RETURN(input, PickFramesNow(input, args.frames, cancel));
  std::string text;
  const absl::Status status = InspectFolder(input, args.options, args.sheet, cancel, &text);
  std::fputs(WithoutControls(std::move(text)).c_str(), stdout);
  return status;
}

int Main(int argc, char** argv) {
  Arguments args;
  CLI::App app("Says what of a folder of photos, or of a video, would be used, and why not.",
               "litags inspect");
  AddOptions(&app, &args);
  if (const auto exit = ParseArguments(app, argc, argv)) return *exit;
  const absl::Status status = Run(args, CancelOnInterrupt());
  if (status.ok()) return FlushOutput(0);
  PrintError("litags inspect", status);
  return absl::IsCancelled(status) ? kInterruptedExit : 2;  // 2, as litags: bad input
}

}  // namespace
}  // namespace litags

int main(int argc, char** argv) {
  if (const auto exit = litags::MaybePickFrames(argc, argv)) return *exit;
  return litags::RunProgram("litags inspect", [&] { return litags::Main(argc, argv); });
}
