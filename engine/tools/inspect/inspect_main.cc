// litags-inspect: what of a folder or a video would be used. `litags inspect` starts it.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/tools/inspect/dataset_folder.h"
#include "engine/tools/inspect/inspect.h"
#include "engine/video/frame_process.h"
#include "engine/video/video_file.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

CancelToken* g_cancel = nullptr;
// A second one ends the program.
void OnSignal(int number) {
  g_cancel->Cancel();
  std::signal(number, SIG_DFL);
}

struct Arguments {
  std::string dir, cameras, masks, sheet;
  int frames = 0;
  ReconstructOptions options;  // that a run would have
};

absl::Status Run(Arguments args, const CancelToken& cancel) {
  std::error_code ignored;
  if (IsVideoName(args.dir) && !fs::exists(args.dir, ignored)) {
    return InvalidInput("NO_SUCH_FILE", "DIR",
                        absl::StrCat(args.dir, ": there is no such file; give one that is there"));
  }
  std::string depth;  // is not looked at
  LITAGS_RETURN_IF_ERROR(
      UseDatasetFolder(/*with_cameras=*/true, &args.dir, &args.cameras, &args.masks, &depth));
  const ScratchFolder scratch;
  ReconstructInput input;
  input.work_dir = scratch.path();
  input.images_dir = args.dir;
  input.cameras_path = args.cameras;
  input.masks_dir = args.masks;
  input.frame_program = OwnPickFramesProgram();
  if (const fs::path beside = fs::path(args.dir) / "masks";
      args.masks.empty() && fs::is_directory(beside, ignored)) {
    input.masks_dir = beside;
  }
  if (fs::is_regular_file(args.dir, ignored) && IsVideoName(args.dir)) input.video_path = args.dir;
  LITAGS_ASSIGN_OR_RETURN(input, PickFramesNow(input, args.frames, cancel));
  std::string text;
  const absl::Status status = InspectFolder(input, args.options, args.sheet, cancel, &text);
  std::fputs(text.c_str(), stdout);
  return status;
}

int Main(int argc, char** argv) {
  Arguments args;
  CLI::App app("Says what of a folder of photos, or of a video, would be used, and why not.",
               "litags inspect");
  app.set_version_flag("--version", LITAGS_VERSION);
  app.add_option("DIR", args.dir, "Folder of photos, or of a dataset, or a video")->required();
  app.add_option("--cameras", args.cameras,
                 "Known cameras: a transforms.json, the folder of a COLMAP model, or a file of "
                 "OpenMVG, Meshroom, Metashape or Bundler");
  app.add_option("--masks", args.masks,
                 "Folder with masks of photos; default: DIR/masks, if there is one");
  app.add_option("--frames", args.frames, "At most so many frames of a video; 0: by its motion")
      ->check(Between(0, 2000));
  app.add_option("--contact-sheet", args.sheet, "Picture of all photos, brightened, .jpg or .png");
  app.add_option("--threads", args.options.threads, "Threads; 0: all cores")
      ->check(Between(0, 1024));
  if (const auto exit = ParseArguments(app, argc, argv)) return *exit;
  CancelToken cancel;
  g_cancel = &cancel;
  std::signal(SIGINT, OnSignal);
  std::signal(SIGTERM, OnSignal);
  const absl::Status status = Run(args, cancel);
  if (status.ok()) return 0;
  if (absl::IsCancelled(status)) {
    std::fprintf(stderr, "litags inspect: %s\n", std::string(status.message()).c_str());
    return 130;
  }
  const ErrorDetail detail = GetErrorDetail(status).value_or(ErrorDetail{});
  std::fprintf(stderr, "litags inspect: %s\n  reason %s, field %s\n",
               std::string(status.message()).c_str(), detail.reason.c_str(), detail.field.c_str());
  return 2;  // as litags: what it was given is wrong
}

}  // namespace
}  // namespace litags

int main(int argc, char** argv) {
  if (const auto exit = litags::MaybePickFrames(argc, argv)) return *exit;
  return litags::Main(argc, argv);
}
