// litags-bench geometry: how far exported points and meshes are from exact surfaces.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/surface_mesh.h"
#include "engine/pipeline/surface_points.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/timing.h"
#include "engine/tools/evaluation/surface_errors.h"

namespace litags {
namespace {

// Every so many pixels of the truth are asked how far our surface is. Choice: a prime, so that
// they do not stand in columns; millions of pixels are more than the quantiles need.
constexpr size_t kTruthStep = 17;

struct GeometryArguments {
  std::string scene, truth, out, json;
  int threads = 0;
};

struct Made {
  TriangleMesh surface;  // without triangles: points
  double seconds = 0;
};

absl::StatusOr<Made> MakePoints(const Scene& scene, const ExportRequest& request) {
  Made made;
  const double start = NowMs();
  LITAGS_ASSIGN_OR_RETURN(made.surface.vertices, SurfacePoints(scene, request));
  made.seconds = (NowMs() - start) / 1e3;
  return made;
}

absl::StatusOr<Made> MakeMesh(const Scene& scene, const ExportRequest& request) {
  Made made;
  const double start = NowMs();
  LITAGS_ASSIGN_OR_RETURN(made.surface, SurfaceMesh(scene, request));
  made.seconds = (NowMs() - start) / 1e3;
  return made;
}

absl::Status WriteFiles(const std::string& dir, const TriangleMesh& points,
                        const TriangleMesh& mesh) {
  std::error_code ignored;  // writing says what is wrong
  std::filesystem::create_directories(dir, ignored);
  LITAGS_RETURN_IF_ERROR(
      WriteFileAtomically(dir + "/scene.points.ply", EncodePointsPly(points.vertices)));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(dir + "/scene.las", EncodeLas(points.vertices)));
  LITAGS_ASSIGN_OR_RETURN(const std::string ply, EncodeMeshPly(mesh));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(dir + "/scene.mesh.ply", ply));
  LITAGS_ASSIGN_OR_RETURN(const std::string glb, EncodeMeshGlb(mesh));
  return WriteFileAtomically(dir + "/scene.mesh.glb", glb);
}

nlohmann::json JsonOf(const DistanceQuantiles& q) {
  return {{"median", q.median},
          {"ninety", q.ninety},
          {"median_of_depth", q.median_of_depth},
          {"ninety_of_depth", q.ninety_of_depth}};
}

std::string CellsOf(const DistanceQuantiles& q) {
  char text[100];
  std::snprintf(text, sizeof(text), " %.4f / %.4f | %.2f / %.2f |", q.median, q.ninety,
                100 * q.median_of_depth, 100 * q.ninety_of_depth);
  return text;
}

// Prints the row of one surface.
nlohmann::json Measure(const char* name, const Made& made, const TrueSurface& truth) {
  const SurfaceErrors errors = MeasureSurface(made.surface, truth, kTruthStep);
  std::printf("| %s | %zu | %zu | %.1f |%s%s\n", name, made.surface.vertices.size(),
              made.surface.triangles.size(), made.seconds, CellsOf(errors.accuracy).c_str(),
              CellsOf(errors.completeness).c_str());
  std::fflush(stdout);
  return {{"vertices", made.surface.vertices.size()},
          {"triangles", made.surface.triangles.size()},
          {"seconds", made.seconds},
          {"accuracy", JsonOf(errors.accuracy)},
          {"completeness", JsonOf(errors.completeness)}};
}

absl::Status Run(const GeometryArguments& args) {
  LITAGS_ASSIGN_OR_RETURN(const std::shared_ptr<const Scene> scene, LoadSceneFile(args.scene));
  LITAGS_ASSIGN_OR_RETURN(const TrueSurface truth, ReadTrueSurface(scene->views(), args.truth));
  ExportRequest request;
  request.up = UpAxis::kKeep;  // the coordinates of the cameras
  request.threads = args.threads;
  LITAGS_ASSIGN_OR_RETURN(const Made points, MakePoints(*scene, request));
  LITAGS_ASSIGN_OR_RETURN(const Made mesh, MakeMesh(*scene, request));
  if (!args.out.empty()) {
    LITAGS_RETURN_IF_ERROR(WriteFiles(args.out, points.surface, mesh.surface));
  }
  std::printf(
      "Distances: median / 90 %% quantile, in scene units and in %% of the depth\n\n"
      "| | Vertices | Triangles | Made in, s | Accuracy | %% of depth | Completeness | %% of depth "
      "|\n"
      "|---|---|---|---|---|---|---|---|\n");
  const nlohmann::json json = {{"points", Measure("points", points, truth)},
                               {"mesh", Measure("mesh", mesh, truth)}};
  return WriteJson(args.json, JsonText(json, 2));
}

}  // namespace

void AddGeometryCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<GeometryArguments>();
  CLI::App* command = app->add_subcommand(
      "geometry", "Measures a scene's exported points and mesh against exact depth");
  command->add_option("scene", args->scene, "scene.litags, of known cameras")->required();
  command
      ->add_option("truth", args->truth, "folder of exact depth maps, as of litags-sample --truth")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--output,--out", args->out,
                      "also write scene.{points.ply,las,mesh.ply,mesh.glb} here");
  AddJsonOption(command, &args->json);
  AddThreadsOption(command, &args->threads);
  WhenGiven(command, exit_status, [args] { return Run(*args); });
}

}  // namespace litags
