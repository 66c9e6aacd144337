#include "engine/tools/bench/command_options.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/fields.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/options.h"
#include "engine/tools/failure/failure.h"
#include "proto/arguments/arguments.h"

namespace litags {

namespace fs = std::filesystem;

void WhenGiven(CLI::App* command, int* exit_status, std::function<absl::Status()> body) {
  command->callback([body = std::move(body), exit_status] {
    if (const absl::Status s = body(); !s.ok()) {
      PrintError("litags-bench", s);
      *exit_status = ExitCodeOf(s);
    }
  });
}

CLI::Option* AddSceneOptions(CLI::App* command, const std::string& help, BenchmarkScene* scene) {
  scene->light = "low";
  command->add_option("--light", scene->light, "photos are in SCENE/LIGHT")->capture_default_str();
  return command->add_option("scene", scene->dir, help)->required();
}

void AddOutputOption(CLI::App* command, const std::string& help, std::string* path) {
  // Of an empty one, what is removed and written would lie in the root folder.
  command->add_option("-o,--output,--out", *path, help)
      ->required()
      ->check([](const std::string& given) {
        return given.empty() ? std::string("takes the name of a folder") : std::string();
      });
}

void AddGaussiansOption(CLI::App* command, int* gaussians) {
  command->add_option("--gaussians", *gaussians, "of the made-up scene")
      ->capture_default_str()
      ->check(Between(1, 20000000));
}

void AddThreadsOption(CLI::App* command, int* threads) {
  command->add_option("--threads", *threads, "0: all cores")
      ->capture_default_str()
      ->check(Between(0, 1024));
}

void AddLpipsOption(CLI::App* command, std::string* path) {
  command->add_option("--lpips", *path, "ONNX network of LPIPS, inputs in0 and in1");
}

void RefuseGivenDepth(CLI::App* command) {
  const auto needs_no_option = [](const std::string& word) -> std::string {
    DepthOrigin source;
    const bool known = ParseField("--depth-source", word, &source).ok();
    if (!known || (source != DepthOrigin::kMaps && source != DepthOrigin::kNetwork)) return "";
    return absl::StrCat("takes auto, stereo or none here, not \"", word,
                        "\": only litags-train has --depth and --depth-model");
  };
  command->get_option("--depth-source")
      ->description("depth maps: stereo of all photos, none, or auto: the method's")
      ->check(needs_no_option);
}

void AddJsonOption(CLI::App* command, std::string* path) {
  const auto can_be_made = [](std::string& text) -> std::string {
    std::error_code ignored;
    const fs::path file = fs::absolute(text, ignored);
    if (fs::is_directory(file.parent_path(), ignored) && !fs::is_directory(file, ignored)) {
      return "";
    }
    return absl::StrCat("takes a file in a folder that is there, not \"", text, "\"");
  };
  command->add_option("--json", *path, "also write the figures here")
      ->check(CLI::Validator(can_be_made, "file"));
}

absl::Status WriteJson(const std::string& path, const std::string& json) {
  return path.empty() ? absl::OkStatus() : WriteFileAtomically(path, json + "\n");
}

}  // namespace litags
