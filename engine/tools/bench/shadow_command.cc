// litags-bench shadows: what the steps before the target bring to darkened photos.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"
#include "engine/core/rng.h"
#include "engine/io/image_io.h"
#include "engine/sample/sensor.h"
#include "engine/target/chroma.h"
#include "engine/target/shadow_color.h"
#include "engine/target/tone_options.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

constexpr double kStops[] = {6, 7.5, 9};  // darker than the photo
constexpr double kPictureStops = 7.5;
constexpr const char* kSteps[] = {"8 bits", "floating point", "+ chroma smoothing",
                                  "+ shadow colours", "+ both"};

struct ShadowArguments {
  std::string photos;
  std::string pictures;  // folder for those of the first photo at kPictureStops
  sample::SensorOptions sensor;
  double shrink = 1;  // pixels of the camera to one of training
};

// Sums over photos.
struct Errors {
  double psnr = 0;
  double chroma = 0;  // root mean square of Cb and Cr in the darker half, codes of 255
};

Errors Compare(const Photo& photo, const Photo& truth) {
  std::vector<double> lumas;
  for (size_t i = 0; i < truth.pixels(); ++i) lumas.push_back(Luma(&truth.data[3 * i]));
  const double median = Median(lumas);
  double squares = 0, chroma = 0, dark = 0;
  for (size_t i = 0; i < truth.pixels(); ++i) {
    std::array<int16_t, 3> clipped;
    for (int c = 0; c < 3; ++c) {
      clipped[c] = std::clamp<int16_t>(photo.data[3 * i + c], 0, kPhotoWhite);
      squares += std::pow((clipped[c] - truth.data[3 * i + c]) / double(kPhotoWhite), 2);
    }
    if (lumas[i] > median) continue;
    const int16_t* want = &truth.data[3 * i];
    const double luma = Luma(clipped.data());
    const double cb = ((clipped[2] - luma) - (want[2] - lumas[i])) / 1.772;
    const double cr = ((clipped[0] - luma) - (want[0] - lumas[i])) / 1.402;
    chroma += (cb * cb + cr * cr) / 2;
    ++dark;
  }
  return {-10 * std::log10(squares / truth.data.size()), std::sqrt(chroma / dark) / kPhotoCode};
}

Photo Shrunk(const Photo& photo, double shrink) {
  return ResizeArea(photo, static_cast<int>(std::lround(photo.width / shrink)),
                    static_cast<int>(std::lround(photo.height / shrink)));
}

// What each of kSteps makes of one photo that is `stops` too dark.
absl::StatusOr<std::vector<Photo>> MakeSteps(const Photo& truth, double stops,
                                             const ShadowArguments& args, uint64_t number) {
  Planes light = ToPlanes(truth);
  for (float& value : light.data) value = static_cast<float>(LinearFromSrgb(value));
  const double gain = std::exp2(stops);
  const ImageU8 dark =
      sample::Expose(light, {1 / gain, 1 / gain, 1 / gain}, args.sensor, CounterRng(number, 99));
  LITAGS_ASSIGN_OR_RETURN(const std::string jpeg, EncodeJpeg(dark));
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageInfo(jpeg, "photo"));
  LITAGS_ASSIGN_OR_RETURN(const Photo camera, DecodePhoto(jpeg, "photo"));
  const Photo decoded = Shrunk(camera, args.shrink);
  const Photo bytes = Shrunk(PhotoFromU8(PhotoToU8(camera)), args.shrink);
  const FileSteps steps = {.chroma = static_cast<double>(info.chroma_step)};
  const Photo inferred =
      ShadowColors(MeasureColorPrior(camera, steps)).Infer(decoded, {}, args.shrink);
  const auto brightened = [&](const Photo& photo, double smoothing) {
    return SmoothChroma(photo, gain, smoothing, [gain](double linear) {
      return SrgbFromLinear(std::clamp(gain * linear, 0.0, 1.0));
    });
  };
  const double smoothing = ToneOptions().chroma_smoothing;
  return std::vector<Photo>{brightened(bytes, 0), brightened(decoded, 0),
                            brightened(decoded, smoothing), brightened(inferred, 0),
                            brightened(inferred, smoothing)};
}

// FOLDER/truth.png and, by the number of their step, FOLDER/0.png ... FOLDER/4.png.
absl::Status WritePictures(const std::string& folder, const Photo& truth,
                           const std::vector<Photo>& steps) {
  LITAGS_RETURN_IF_ERROR(WritePng(folder + "/truth.png", PhotoToU8(truth)));
  for (size_t i = 0; i < steps.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(WritePng(absl::StrCat(folder, "/", i, ".png"), PhotoToU8(steps[i])));
  }
  return absl::OkStatus();
}

absl::Status MeasureShadows(const ShadowArguments& args) {
  const std::string& folder = args.photos;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(folder, "photos"));
  std::vector<std::vector<Errors>> sums(std::size(kStops), std::vector<Errors>(std::size(kSteps)));
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string path = absl::StrCat(folder, "/", names[i]);
    LITAGS_ASSIGN_OR_RETURN(const Photo photo, ReadPhoto(path, path));
    const Photo truth = Shrunk(photo, args.shrink);
    for (size_t k = 0; k < std::size(kStops); ++k) {
      LITAGS_ASSIGN_OR_RETURN(const std::vector<Photo> steps, MakeSteps(photo, kStops[k], args, i));
      for (size_t step = 0; step < steps.size(); ++step) {
        const Errors errors = Compare(steps[step], truth);
        sums[k][step].psnr += errors.psnr;
        sums[k][step].chroma += errors.chroma;
      }
      if (i == 0 && kStops[k] == kPictureStops && !args.pictures.empty()) {
        LITAGS_RETURN_IF_ERROR(WritePictures(args.pictures, truth, steps));
      }
    }
  }
  std::printf("%zu photos; PSNR, dB / error of chroma in the darker half, codes\n%-20s",
              names.size(), "");
  for (const double stops : kStops) std::printf("  dark by %-6g", stops);
  std::printf("\n");
  for (size_t i = 0; i < std::size(kSteps); ++i) {
    std::printf("%-20s", kSteps[i]);
    for (const std::vector<Errors>& of_stops : sums) {
      std::printf("  %5.2f / %-6.2f", of_stops[i].psnr / names.size(),
                  of_stops[i].chroma / names.size());
    }
    std::printf("\n");
  }
  return absl::OkStatus();
}

}  // namespace

void AddShadowsCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<ShadowArguments>();
  CLI::App* command = app->add_subcommand(
      "shadows", "What each step before the target brings to photos darkened by a sensor model");
  command->add_option("photos", args->photos, "folder of well exposed photos")
      ->required()
      ->check(CLI::ExistingDirectory);
  command
      ->add_option("--pictures", args->pictures,
                   "folder for what each step makes of the first photo")
      ->check(CLI::ExistingDirectory);
  sample::SensorOptions& sensor = args->sensor;
  command->add_option("--full-well", sensor.full_well, "electrons at white")->capture_default_str();
  command->add_option("--read-noise", sensor.read_noise, "electrons")->capture_default_str();
  command->add_option("--adc-bits", sensor.adc_bits)->capture_default_str();
  command
      ->add_option("--shrink", args->shrink,
                   "photos are shrunk as many times as for training before colours are inferred")
      ->check(Between(1.0, 8.0))
      ->capture_default_str();
  WhenGiven(command, exit_status, [args] { return MeasureShadows(*args); });
}

}  // namespace litags
