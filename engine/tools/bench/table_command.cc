// litags-bench table: methods compared on scenes, as in the paper's tables.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/eval/lpips.h"
#include "engine/io/image_io.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/evaluation/method_options.h"
#include "engine/tools/table/methods.h"
#include "engine/tools/table/table.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

struct TableArguments {
  std::vector<std::string> scenes, lights = {"low", "over_exp"}, methods = {"all"}, enhancers;
  std::string sparse, cell;
  ReconstructOptions base;
  std::vector<std::string> set;  // constants of every method's recipe
  TableOptions options;
};

// This process's command line.
std::vector<std::string> OwnArguments() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::vector<std::string> arguments = absl::StrSplit(text, '\0');
  if (!arguments.empty()) arguments.pop_back();  // it ends in a zero
  return arguments;
}

// The method options that were given, "--seed=3 --tone=paper"; threads change no result.
std::string SettingsOf(const std::vector<const CLI::Option*>& options) {
  std::vector<std::string> given;
  for (const CLI::Option* option : options) {
    if (option->count() == 0 || option->get_name() == "--threads") continue;
    given.push_back(absl::StrCat(option->get_name(), "=", absl::StrJoin(option->results(), ",")));
  }
  return absl::StrJoin(given, " ");
}

absl::Status Bad(const char* field, const std::string& what) {
  return InvalidInput("BAD_OPTION", field, absl::StrCat(field, ": ", what));
}

bool Contains(const std::vector<std::string>& list, const std::string& text) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

absl::Status CompleteMethods(TableArguments* args) {
  TableOptions& options = args->options;
  std::vector<std::string> enhancers, names;
  for (const Enhancer& enhancer : BuiltinEnhancers()) enhancers.push_back(enhancer.name);
  for (const std::string& text : args->enhancers) {
    LITAGS_ASSIGN_OR_RETURN(OnnxEnhancerOptions enhancer, ParseOnnxEnhancer(text));
    if (Contains(enhancers, enhancer.name)) {
      return Bad("--enhancer", absl::StrCat("there are two called ", enhancer.name));
    }
    enhancers.push_back(enhancer.name);
    options.enhancers.push_back(std::move(enhancer));
  }
  for (const std::string& name : args->methods) {
    for (const std::string& each :
         name == "all" ? AllMethods(enhancers) : std::vector<std::string>{name}) {
      if (Contains(names, each)) continue;
      LITAGS_ASSIGN_OR_RETURN(TableMethod method,
                              ParseMethod(each, args->base, enhancers, args->set));
      names.push_back(each);
      options.methods.push_back(std::move(method));
    }
  }
  return absl::OkStatus();
}

// Before anything is trained: networks can be loaded.
absl::Status CheckNetworks(const TableOptions& options) {
  for (const OnnxEnhancerOptions& enhancer : options.enhancers) {
    LITAGS_RETURN_IF_ERROR(MakeOnnxEnhancer(enhancer).status());
  }
  return options.lpips.empty() ? absl::OkStatus() : Lpips::Load(options.lpips).status();
}

// Before anything is trained: every scene has photos in every light.
absl::Status CheckLights(const TableOptions& options) {
  for (const TableScene& scene : options.scenes) {
    for (const std::string& light : options.lights) {
      LITAGS_RETURN_IF_ERROR(ListPhotos(scene.PhotosDir(light), "--light").status());
    }
  }
  return absl::OkStatus();
}

absl::Status Complete(TableArguments* args) {
  TableOptions& options = args->options;
  LITAGS_RETURN_IF_ERROR(args->base.Validate());
  LITAGS_ASSIGN_OR_RETURN(options.scenes, FindScenes(args->scenes, args->sparse));
  for (const std::string& light : args->lights) {
    if (light.empty() || light == "." || light == ".." || absl::StrContains(light, "/")) {
      return Bad("--light", absl::StrCat("\"", light, "\" is no name of a folder in the scene"));
    }
    if (!Contains(options.lights, light)) options.lights.push_back(light);
  }
  LITAGS_RETURN_IF_ERROR(CheckLights(options));
  LITAGS_RETURN_IF_ERROR(CompleteMethods(args));
  options.program = OwnArguments();
  options.heading =
      absl::StrCat("# Methods compared\n\nMeans over test views; ", args->base.iterations,
                   " iterations each, same cameras. The best is in bold; 3dgs-normal is for "
                   "reference.\n\n"
                   "```\n",
                   absl::StrJoin(options.program, " "), "\n```");
  if (!options.program.empty()) options.program[0] = "/proc/self/exe";
  return absl::OkStatus();
}

absl::Status Table(TableArguments* args, int* exit_status) {
  LITAGS_RETURN_IF_ERROR(Complete(args));
  if (!args->cell.empty()) return RunCell(args->options, args->cell);
  LITAGS_RETURN_IF_ERROR(CheckNetworks(args->options));
  LITAGS_ASSIGN_OR_RETURN(const int failed, RunTable(args->options));
  std::printf("%s/table.md, table.csv, table.json%s\n", args->options.out.c_str(),
              failed > 0 ? absl::StrCat("; ", failed, " rows failed").c_str() : "");
  if (failed > 0) *exit_status = 1;
  return absl::OkStatus();
}

}  // namespace

void AddTableCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<TableArguments>();
  TableOptions& options = args->options;
  CLI::App* command = app->add_subcommand(
      "table", "Trains and scores every method on every scene and light; finished rows are kept");
  command->add_option("scenes", args->scenes, "scenes in the layout of LOM, or folders of them")
      ->required();
  command->add_option("--light", args->lights, "folders of photos, such as low,over_exp")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command
      ->add_option("--methods", args->methods,
                   absl::StrCat("all, or names: ", absl::StrJoin(LitaMethods(), ", "),
                                ", 3dgs, 3dgs-normal, E+3dgs, 3dgs+E with E of gain, light-gain, "
                                "gamma, histeq, clahe, lime or an --enhancer"))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command
      ->add_option("--enhancer", args->enhancers,
                   "NAME=FILE.onnx[,size=WxH][,multiple=N][,mean=R:G:B][,std=R:G:B]"
                   "[,output=NAME][,white=255]; may be repeated")
      ->allow_extra_args(false);
  AddLpipsOption(command, &options.lpips);
  command
      ->add_option("--flicker", options.flicker_frames,
                   "measure flicker on a path of so many frames through the scene's cameras")
      ->check(Between(2, 10000));
  command->add_option(
      "--sparse", args->sparse,
      "cameras inside each scene (transforms.json or COLMAP model, with its points) "
      "instead of transforms_train.json and triangulation");
  AddOutputOption(command, "folder for the table, pictures and runs", &options.out);
  command->add_flag("--fresh", options.fresh, "run finished rows again, too");
  command->add_option("--colmap", options.colmap, "COLMAP program")->capture_default_str();
  command->add_option("--cell", args->cell)->group("");  // hidden: one row, in a child process
  const size_t before = command->get_options().size();
  // --methods says the first two; the test views are those of transforms_test.json, and a row is
  // done or begun anew.
  AddMethodOptions(
      command, &args->base, &args->set,
      {"method", "tone", "holdout_every", "preview_every", "checkpoint_every", "frames"});
  RefuseGivenDepth(command);
  std::vector<const CLI::Option*> settings;
  for (size_t i = before; i < command->get_options().size(); ++i) {
    settings.push_back(command->get_options()[i]);
  }
  WhenGiven(command, exit_status, [args, settings, exit_status] {
    args->options.settings = SettingsOf(settings);
    return Table(args.get(), exit_status);
  });
}

}  // namespace litags
