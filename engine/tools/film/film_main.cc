// litags-film: pictures from standard input as a video. `litags path --video` starts it.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "engine/core/error.h"
#include "engine/tools/film/film.h"
#include "proto/arguments/arguments.h"

namespace {

int Run(int argc, char** argv) {
  std::string path;
  int frames_per_second = 0, descriptor = -1;
  CLI::App app(
      "Writes pictures from standard input as a video: before each a line with its length in "
      "bytes, at the end a line \"0\". Says \"ready\" first. `litags path --video FILE` starts it.",
      "litags-film");
  app.set_version_flag("--version", LITAGS_VERSION);
  app.add_option("FILE", path, "The video's name, .webm or .mp4")->required();
  app.add_option("--descriptor", descriptor, "Number of the open file that it is written to")
      ->required();
  app.add_option("--fps", frames_per_second, "Pictures a second")
      ->default_val(30)
      ->check(litags::Between(1, 120));
  if (const auto exit = litags::ParseArguments(app, argc, argv)) return *exit;
  const absl::Status status =
      litags::WriteFilm(stdin, stdout, fdopen(descriptor, "wb"), path, frames_per_second);
  if (status.ok()) return 0;
  if (absl::IsCancelled(status)) return 2;  // whoever stopped sending says why
  const auto detail = litags::GetErrorDetail(status).value_or(litags::ErrorDetail{});
  std::fprintf(stderr, "error: %s\n  field:  %s\n  code:   %s %s\n",
               std::string(status.message()).c_str(), detail.field.c_str(),
               absl::StatusCodeToString(status.code()).c_str(), detail.reason.c_str());
  return 2;  // as litags: what it was given is wrong
}

}  // namespace

int main(int argc, char** argv) {
  return litags::RunProgram("litags-film", [&] { return Run(argc, argv); });
}
