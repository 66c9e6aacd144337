// litags export: the scene as a file.
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/cli.h"
#include "client/model_format.h"
#include "client/picture_file.h"
#include "client/report/text.h"
#include "client/view_args.h"

namespace litags::client {
namespace {

struct ExportArgs {
  std::string job, output, format, up;
  std::vector<std::string> crop;
  bool antialiased = false;
  double light = 0, exposure = 0;
  std::optional<double> scale;
  int64_t max_splats = 0;
};

absl::StatusOr<v1::ExportModelRequest> RequestOf(const ExportArgs& args) {
  v1::ExportModelRequest request;
  request.set_name(args.job);
  const auto format =
      args.format.empty() ? ModelFormatOf(args.output) : ParseModelFormat(args.format);
  if (!format.ok()) return format.status();
  if (absl::Status wrong = CheckEnding(args.output, *format); !wrong.ok()) return wrong;
  request.set_format(*format);
  request.set_light(args.light);
  request.set_exposure_stops(args.exposure);
  if (!args.up.empty()) {
    const auto axis = ParseUpAxis(args.up);
    if (!axis.ok()) return axis.status();
    request.set_up(*axis);
  }
  if (args.scale.has_value()) request.set_scale(*args.scale);
  if (!args.crop.empty()) {
    const auto min = ParseVector(args.crop[0], "--crop"), max = ParseVector(args.crop[1], "--crop");
    if (!min.ok()) return min.status();
    if (!max.ok()) return max.status();
    *request.mutable_crop()->mutable_min() = *min;
    *request.mutable_crop()->mutable_max() = *max;
  }
  request.set_max_splats(args.max_splats);
  request.set_antialiased(args.antialiased);
  return request;
}

int Export(Session& session, const ExportArgs& args) {
  const auto request = RequestOf(args);
  if (!request.ok()) return ReportError(session, request.status(), args.job);
  OutputFile file("-o");
  v1::ExportHeader header;
  // Before the server makes the export, which takes a while.
  absl::Status status = file.Open(args.output);
  if (!status.ok()) return ReportError(session, status, args.job);
  status = session.client().ExportModel(
      *request,
      [&](const v1::ExportHeader& announced) {
        header = announced;
        return file.Open(args.output);
      },
      [&](std::string_view bytes) { return file.Write(bytes); });
  if (status.ok()) status = file.Commit();
  if (!status.ok()) return ReportError(session, status, args.job);
  Note(absl::StrCat(args.output, ": ", report::CountText(header.elements()), " ",
                    ContentOf(request->format()), ", iteration ", header.iteration(), ", ",
                    report::BytesText(header.size_bytes())));
  return kExitOk;
}

}  // namespace

void AddExportCommand(CLI::App& app, Session& session) {
  auto args = std::make_shared<ExportArgs>();
  CLI::App* command = app.add_subcommand("export", "The scene as a file for other programs");
  AddJobArgument(*command, args->job);
  command
      ->add_option(
          "-o,--output", args->output,
          "File to write; its ending says the format: .ply, .compressed.ply, .spz, .sog, "
          ".splat, .glb, .usda, .html (a page that shows it), .zip (COLMAP's model), "
          ".points.ply and .las (points of surfaces), .mesh.ply and .mesh.glb (surfaces as "
          "triangles), .litags (for the C++ library)")
      ->required();
  command->add_option("--format", args->format,
                      absl::StrCat("One of ", absl::StrJoin(ModelFormatNames(), ", ")));
  command->add_option("--light", args->light,
                      "In this light: 0 normal, 1 as photographed, and between and beyond, -4..4");
  command->add_option("--exposure", args->exposure, "Brighter or darker by so many stops, -10..10");
  command->add_option("--up", args->up,
                      "Turn the scene so that this axis of the file is up: x, y, z, --up=-y and so "
                      "on, or keep; default: y for .spz, .glb, .mesh.glb, .usda, else keep");
  command->add_option("--scale", args->scale, "Multiply all lengths");
  command
      ->add_option("--crop", args->crop,
                   "Only what is in this box, in the coordinates of the cameras: x,y,z x,y,z")
      ->expected(2);
  command->add_option(
      "--max-splats", args->max_splats,
      "At most so many Gaussians or points: those that pictures need most; not for meshes");
  command->add_flag(
      "--antialiased", args->antialiased,
      "Small Gaussians as trained, and tell viewers so: .compressed.ply, .spz and .sog");
  command->callback([&session, args] { session.exit_code = Export(session, *args); });
}

}  // namespace litags::client
