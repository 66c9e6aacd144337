// litags-sample: a made-up room photographed in good, too little and too much light.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>

#include "engine/core/error.h"
#include "engine/sample/capture.h"
#include "proto/arguments/arguments.h"

namespace {

using Clock = std::chrono::steady_clock;

// "360x270" to two numbers; false if it is anything else.
bool ParseSize(const std::string& text, int* width, int* height) {
  int used = 0;
  return std::sscanf(text.c_str(), "%5dx%5d%n", width, height, &used) == 2 &&
         used == static_cast<int>(text.size());
}

int Run(int argc, char** argv) {
  CLI::App app("Renders a sample capture with exact cameras in the LOM benchmark's layout.",
               "litags-sample");
  litags::sample::CaptureOptions options;
  std::string out, size = "360x270";
  app.add_option("OUT", out, "Folder to write to")->required();
  app.add_option("--size", size, "Size of the photos, px: WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--views", options.views, "Number of photos")->capture_default_str();
  app.add_option("--seed", options.seed, "Texture detail, hand shake and noise")
      ->check(litags::AtLeastZero(options.seed))
      ->capture_default_str();
  app.add_option("--noise-seed", options.noise_seed,
                 "Another one: the same photos with other noise")
      ->check(litags::AtLeastZero(options.noise_seed))
      ->capture_default_str();
  app.add_option("--low-mean", options.low_mean, "Mean sRGB level of low/, 0.005..0.47")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "Threads; 0: all cores")->capture_default_str();
  app.add_flag("--truth", options.truth, "Also write depth/NAME.pfm and noise-free clean/NAME.png");
  app.add_flag("--lamp", options.lamp,
               "Light low/ and over_exp/ by a lamp that the camera carries");
  app.add_flag("--raw", options.raw,
               "Also write captures raw/ and deep/: what the sensor gave, as DNG and 16-bit PNG");
  if (const auto exit = litags::ParseArguments(app, argc, argv)) return *exit;
  if (!ParseSize(size, &options.width, &options.height)) {
    std::cerr << "litags-sample: --size: \"" << size << "\" is not WIDTHxHEIGHT, as in 360x270\n";
    return 2;
  }

  options.on_view = [&options, last = Clock::now()](int done) mutable {
    if (Clock::now() - last < std::chrono::seconds(10)) return;
    last = Clock::now();
    std::fprintf(stderr, "%d of %d views rendered\n", done, options.views);
  };
  const auto report = litags::sample::WriteCapture(options, out);
  if (!report.ok()) {
    std::cerr << "litags-sample: " << report.status().message() << "\n";
    const auto detail = litags::GetErrorDetail(report.status());
    const bool not_ours = detail.has_value() && detail->reason == "FOLDER_NOT_OURS";
    return absl::IsInvalidArgument(report.status()) || not_ours ? 2 : 1;
  }
  std::printf("%s: %zu train and %zu test views of %dx%d\n", out.c_str(), report->train.size(),
              report->test.size(), options.width, options.height);
  std::printf("mean sRGB level: high %.3f, low %.3f, over_exp %.3f\n", report->high_mean,
              report->low_mean, report->over_mean);
  std::printf("gain against high: low %.5f, over_exp %.2f\n", report->low_gain, report->over_gain);
  std::printf("PSNR against high: low %.2f dB, over_exp %.2f dB\n", report->low_psnr,
              report->over_psnr);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return litags::RunProgram("litags-sample", [&] { return Run(argc, argv); });
}
