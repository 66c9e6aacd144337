// litags-bench export: a scene in every file format: bytes, and what its pictures lose.
#include <unistd.h>

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
#include "engine/core/subprocess.h"
#include "engine/eval/metrics.h"
#include "engine/export/formats.h"
#include "engine/export/readers.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/model_scene.h"
#include "engine/pipeline/scene_file.h"
#include "engine/render/renderer.h"
#include "engine/tools/bench/bench_scene.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/timing.h"
#include "engine/viewer/viewer.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kLongerSide = 640;  // px of the pictures
constexpr int64_t kMaxBytes = int64_t{8} << 30;

struct ExportArguments {
  std::string scene, converter, out, json;
  int gaussians = 2000, views = 8;
};

// Pictures of Gaussians as viewers of 3DGS draw them.
std::vector<Planes> Pictures(const Splats& splats, const std::vector<Camera>& cameras) {
  Renderer renderer;
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  std::vector<Planes> pictures;
  Planes alpha;
  for (const Camera& camera : cameras) {
    renderer.Forward(splats, camera, settings, &pictures.emplace_back(), &alpha);
    for (float& v : pictures.back().data) v = std::clamp(v, 0.0f, 1.0f);
  }
  return pictures;
}

absl::StatusOr<double> MeanPsnr(const std::vector<Planes>& a, const std::vector<Planes>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    LITAGS_ASSIGN_OR_RETURN(const double psnr, Psnr(a[i], b[i]));
    sum += std::min(psnr, 150.0);  // equal ones have infinity
  }
  return sum / a.size();
}

std::vector<Camera> CamerasOf(const Scene& scene, int count) {
  std::vector<Camera> cameras;
  const std::vector<View>& views = scene.views();
  const size_t used = std::min(views.size(), static_cast<size_t>(count));
  for (size_t v = 0; v < used; ++v) {
    const Camera& camera = views[v * views.size() / used].camera;
    const double shrink =
        std::min(1.0, double{kLongerSide} / std::max(camera.width, camera.height));
    cameras.push_back(camera.Scaled(static_cast<int>(std::lround(shrink * camera.width)),
                                    static_cast<int>(std::lround(shrink * camera.height))));
  }
  return cameras;
}

std::shared_ptr<const Scene> MadeUpScene(int gaussians) {
  Model model;
  model.lita = model.use_pdm = false;
  std::vector<View> views;
  for (int v = 0; v < 4; ++v) {
    View& view = views.emplace_back(View{absl::StrCat("view", v, ".png"), BenchCamera(320, 240)});
    view.camera.t[0] = 0.1 * v;
  }
  model.splats = BenchSplats(gaussians, views[0].camera);
  return MakeScene(std::move(model), std::move(views));
}

class Exporter {
 public:
  Exporter(const ExportArguments& args, std::shared_ptr<const Scene> scene)
      : args_(args), scene_(std::move(scene)), cameras_(CamerasOf(*scene_, args.views)) {}

  absl::StatusOr<nlohmann::json> Run() {
    ExportRequest plain;
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, Write(plain, nullptr));
    LITAGS_ASSIGN_OR_RETURN(const ViewerScene ply, ReadExported(SceneFormat::kPly, bytes));
    wanted_ = Pictures(ply.splats, cameras_);
    std::vector<Planes> rendered;
    for (const Camera& camera : cameras_) {
      RenderRequest request;
      request.camera = camera;
      LITAGS_ASSIGN_OR_RETURN(Planes picture, scene_->Render(request));
      rendered.push_back(std::move(picture));
    }
    LITAGS_ASSIGN_OR_RETURN(const double drawn, MeanPsnr(wanted_, rendered));
    std::printf(
        "%lld Gaussians, %zu pictures; the .ply as viewers draw it is %.2f dB from "
        "litags render\n\n",
        static_cast<long long>(scene_->num_gaussians()), cameras_.size(), drawn);
    std::printf(
        "| Format | Bytes | a Gaussian | of .ply | Written in, s | PSNR, dB | read by others |\n"
        "|---|---|---|---|---|---|---|\n");
    nlohmann::json rows = nlohmann::json::array();
    for (const FormatInfo& info : Formats()) {
      if (info.format == SceneFormat::kHtml && ViewerModule().empty()) continue;
      LITAGS_ASSIGN_OR_RETURN(nlohmann::json row, Row(info, bytes.size()));
      rows.push_back(std::move(row));
    }
    return nlohmann::json{{"gaussians", scene_->num_gaussians()}, {"formats", std::move(rows)}};
  }

 private:
  std::string PathOf(const FormatInfo& info) const {
    return absl::StrCat(args_.out, "/", info.name, info.ending);
  }

  // The scene's own axes in every format, so that its cameras are those of the file.
  absl::StatusOr<std::string> Write(ExportRequest request, double* seconds) {
    const std::string path = PathOf(InfoOf(request.format));
    request.up = UpAxis::kKeep;
    const double start = NowMs();
    LITAGS_RETURN_IF_ERROR(scene_->Export(path, request).status());
    if (seconds != nullptr) *seconds = (NowMs() - start) / 1e3;
    return ReadFile(path, "", kMaxBytes);
  }

  absl::StatusOr<nlohmann::json> Row(const FormatInfo& info, size_t ply_bytes) {
    ExportRequest request;
    request.format = info.format;
    double seconds = 0;
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, Write(request, &seconds));
    nlohmann::json row = {{"format", info.name}, {"bytes", bytes.size()}, {"seconds", seconds}};
    std::string psnr = "-", others = "-";
    if (info.format != SceneFormat::kColmap) {
      LITAGS_ASSIGN_OR_RETURN(const ViewerScene read, ReadExported(info.format, bytes));
      LITAGS_ASSIGN_OR_RETURN(row["psnr_db"], MeanPsnr(wanted_, Pictures(read.splats, cameras_)));
      psnr = absl::StrCat(std::round(100 * row["psnr_db"].get<double>()) / 100);
    }
    if (!args_.converter.empty()) {
      LITAGS_ASSIGN_OR_RETURN(const std::optional<double> found, ReadByOthers(info));
      if (found.has_value()) {
        row["psnr_of_others_db"] = *found;
        others = absl::StrCat(std::round(100 * *found) / 100);
      }
    }
    std::printf("| %s | %zu | %.1f | %.1f %% | %.2f | %s | %s |\n", info.name, bytes.size(),
                double(bytes.size()) / std::max<int64_t>(1, scene_->num_gaussians()),
                100.0 * bytes.size() / ply_bytes, seconds, psnr.c_str(), others.c_str());
    std::fflush(stdout);
    return row;
  }

  // PSNR of what the converter made a .ply of; none if it does not read this format (exit code 3).
  absl::StatusOr<std::optional<double>> ReadByOthers(const FormatInfo& info) {
    const std::string path = absl::StrCat(args_.out, "/", info.name, ".by-others.ply");
    SubprocessOptions options;
    options.args = {args_.converter, PathOf(info), path};
    options.timeout_seconds = 600;
    LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, RunSubprocess(options, CancelToken()));
    if (result.exit_code == 3) return std::nullopt;
    if (result.exit_code != 0) {
      return absl::FailedPreconditionError(
          absl::StrCat(args_.converter, " cannot read ", info.name, ": ", result.tail));
    }
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, "", kMaxBytes));
    LITAGS_ASSIGN_OR_RETURN(const ViewerScene read, ReadExported(SceneFormat::kPly, bytes));
    if (static_cast<int64_t>(read.splats.size()) != scene_->num_gaussians()) {
      return absl::DataLossError(absl::StrCat(args_.converter, " found ", read.splats.size(),
                                              " Gaussians in ", info.name));
    }
    LITAGS_ASSIGN_OR_RETURN(const double psnr, MeanPsnr(wanted_, Pictures(read.splats, cameras_)));
    return psnr;
  }

  const ExportArguments args_;
  const std::shared_ptr<const Scene> scene_;
  const std::vector<Camera> cameras_;
  std::vector<Planes> wanted_;
};

absl::Status Run(ExportArguments args) {
  std::shared_ptr<const Scene> scene;
  if (args.scene.empty()) {
    scene = MadeUpScene(args.gaussians);
  } else {
    LITAGS_ASSIGN_OR_RETURN(scene, LoadSceneFile(args.scene));
  }
  const bool keep = !args.out.empty();
  std::error_code ignored;
  if (!keep) {
    const std::string folder = fs::temp_directory_path(ignored).string();
    args.out = absl::StrCat(folder.empty() ? "/tmp" : folder, "/litags-export-", getpid());
  }
  fs::create_directories(args.out, ignored);  // writing says what is wrong
  const auto report = Exporter(args, scene).Run();
  if (!keep) fs::remove_all(args.out, ignored);
  return report.ok() ? WriteJson(args.json, report->dump(2)) : report.status();
}

}  // namespace

void AddExportCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<ExportArguments>();
  CLI::App* command = app->add_subcommand(
      "export", "Writes a scene in every file format, reads it back and compares pictures");
  command->add_option("SCENE", args->scene, "scene.litags; without, a made-up one");
  AddGaussiansOption(command, &args->gaussians);
  command->add_option("--views", args->views, "pictures to compare")
      ->capture_default_str()
      ->check(Between(1, 1000));
  command->add_option("--converter", args->converter,
                      "a program that is called as PROGRAM FILE OUT.ply, to compare what it reads; "
                      "exit code 3: it does not know the format");
  command->add_option("--output,--out", args->out, "keep the files in this folder");
  AddJsonOption(command, &args->json);
  WhenGiven(command, exit_status, [args] { return Run(*args); });
}

}  // namespace litags
