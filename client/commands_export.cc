// litags export: the scene as a file.
#include <memory>

#include "absl/strings/str_cat.h"
#include "client/cli.h"
#include "client/picture_file.h"
#include "client/status.h"
#include "client/text.h"

namespace litags::client {
namespace {

struct ExportArgs {
  std::string job, ply;
  bool original_light = false, full = false;
  double light = 0;
};

int Export(Session& session, const ExportArgs& args) {
  v1::ExportModelRequest request;
  request.set_name(args.job);
  request.set_format(args.full             ? v1::MODEL_FORMAT_PLY_FULL
                     : args.original_light ? v1::MODEL_FORMAT_PLY_ORIGINAL_LIGHT
                                           : v1::MODEL_FORMAT_PLY);
  request.set_light(args.light);
  OutputFile file("--ply");
  v1::ExportHeader header;
  absl::Status status = session.client().ExportModel(
      request,
      [&](const v1::ExportHeader& announced) {
        header = announced;
        return file.Open(args.ply);
      },
      [&](std::string_view bytes) { return file.Write(bytes); });
  if (status.ok()) status = file.Commit();
  if (!status.ok()) return ReportError(session, status, args.job);
  Note(absl::StrCat(args.ply, ": ", CountText(header.gaussians()), " Gaussians, iteration ",
                    header.iteration(), ", ", BytesText(header.size_bytes())));
  return kExitOk;
}

}  // namespace

void AddExportCommand(CLI::App& app, Session& session) {
  auto args = std::make_shared<ExportArgs>();
  CLI::App* command = app.add_subcommand("export", "The scene as a file for splat viewers");
  AddJobArgument(*command, args->job);
  command->add_option("--ply", args->ply, "File to write")->required();
  CLI::Option* original =
      command->add_flag("--original-light", args->original_light, "In the light of the photos");
  command
      ->add_option("--light", args->light,
                   "In this light: 0 normal, 1 as photographed, and between and beyond, -4..4")
      ->excludes(original);
  command->add_flag("--full", args->full, "With every attribute of LITA-GS")->excludes(original);
  command->callback([&session, args] { session.exit_code = Export(session, *args); });
}

}  // namespace litags::client
