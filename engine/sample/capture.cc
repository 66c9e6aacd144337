#include "engine/sample/capture.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/png_codes.h"
#include "engine/io/transforms_io.h"
#include "engine/io/work_folder.h"
#include "engine/sample/exposure.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"

namespace litags::sample {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;
constexpr double kFieldOfViewDeg = 62;  // horizontal, as a phone's main camera

// Streams of random numbers; exposure.cc has its own from 100 on.
enum Stream : uint64_t { kHand = 1, kTrace = 2 };

absl::Status CheckRange(const char* field, double value, double low, double high) {
  if (value >= low && value <= high) return absl::OkStatus();
  return InvalidInput("OUT_OF_RANGE", field,
                      absl::StrCat(field, ": ", value, " is outside [", low, ", ", high,
                                   "]; choose a value inside"));
}

std::string WithExtension(const std::string& name, const char* extension) {
  return Stem(name) + extension;
}

// In 16 bits, because at the levels of low/ eight would quantise more coarsely than the noise.
std::vector<uint16_t> DeepCodesOf(const Planes& srgb) {
  std::vector<uint16_t> codes;
  codes.reserve(srgb.data.size());
  for (size_t i = 0; i < srgb.plane_size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      codes.push_back(cv::saturate_cast<uint16_t>(srgb.plane(c)[i] * 65535.0f));
    }
  }
  return codes;
}

absl::Status WriteRgb16(const std::string& path, const std::vector<uint16_t>& codes, int width,
                        int height) {
  LITAGS_ASSIGN_OR_RETURN(const std::string png, EncodePngCodes(codes.data(), width, height, 3));
  return WriteFileAtomically(path, png);
}

bool IsTest(const CaptureOptions& options, size_t view) {
  return view % options.test_every == static_cast<size_t>(options.test_every / 2);
}

absl::Status WriteCameras(const CaptureOptions& options, const std::vector<View>& views,
                          const fs::path& out) {
  SparseModel train, test;
  for (size_t i = 0; i < views.size(); ++i) {
    SparseModel& part = IsTest(options, i) ? test : train;
    part.views.push_back(views[i]);
    part.distortions.emplace_back();
  }
  LITAGS_RETURN_IF_ERROR(WriteTransforms(out / "transforms_train.json", train, "low"));
  LITAGS_RETURN_IF_ERROR(WriteTransforms(out / "transforms_val.json", test, "low"));
  return WriteTransforms(out / "transforms_test.json", test, "low");
}

// raw/ and deep/ become captures like that beside them.
absl::Status WriteRawCameras(const CaptureOptions& options, const std::vector<View>& views,
                             const fs::path& out) {
  for (const auto& [folder, extension] : {std::pair{"raw", ".DNG"}, {"deep", ".PNG"}}) {
    std::vector<View> renamed = views;
    for (View& view : renamed) view.name = WithExtension(view.name, extension);
    LITAGS_RETURN_IF_ERROR(WriteCameras(options, renamed, out / folder));
    std::error_code ignored;  // a link that cannot be made is missed at the evaluation
    fs::create_directory_symlink("../high", out / folder / "high", ignored);
  }
  return absl::OkStatus();
}

absl::Status WriteCaptureJson(const CaptureOptions& options, const std::vector<View>& views,
                              const Exposures& exposures, const fs::path& out) {
  nlohmann::ordered_json json = {{"seed", options.seed},
                                 {"noise_seed", options.noise_seed},
                                 {"lamp", options.lamp},
                                 {"gain_is_relative_to", "high, linear light, per channel RGB"},
                                 {"full_well_electrons", options.sensor.full_well},
                                 {"read_noise_electrons", options.sensor.read_noise},
                                 {"adc_bits", options.sensor.adc_bits},
                                 {"adc_black", options.sensor.adc_black},
                                 {"jpeg_quality", kJpegQuality},
                                 {"low_gain", exposures.low},
                                 {"over_exp_gain", exposures.over}};
  for (size_t i = 0; i < views.size(); ++i) {
    json["views"].push_back({{"name", views[i].name},
                             {"low_gain", exposures.low_gain[i]},
                             {"over_exp_gain", exposures.over_gain[i]}});
  }
  return WriteFileAtomically(out / "capture.json", JsonText(json, 1) + "\n");
}

// Levels of the photos, to be averaged over the views.
struct Levels {
  double high = 0, low = 0, over = 0, low_psnr = 0, over_psnr = 0;
};

// `room`: light as in the normal picture; `light`: as in the others.
absl::StatusOr<Levels> WritePhotos(const CaptureOptions& options, const Exposures& exposures,
                                   const Planes& room, const Planes& light, size_t view,
                                   const std::string& name, const fs::path& out) {
  const ImageU8 high = NormalPhoto(room);
  const ImageU8 low = LowPhoto(options, exposures, light, view);
  const ImageU8 over = OverPhoto(options, exposures, light, view);
  LITAGS_RETURN_IF_ERROR(WriteJpeg(out / "high" / name, high, kJpegQuality));
  LITAGS_RETURN_IF_ERROR(WriteJpeg(out / "low" / name, low, kJpegQuality));
  LITAGS_RETURN_IF_ERROR(WriteJpeg(out / "over_exp" / name, over, kJpegQuality));
  if (options.truth) {
    LITAGS_RETURN_IF_ERROR(WriteRgb16(out / "clean" / WithExtension(name, ".png"),
                                      DeepCodesOf(Develop(light, exposures.low_gain[view])),
                                      light.width, light.height));
  }
  if (options.raw) {
    const std::vector<uint16_t> numbers = LowNumbers(options, exposures, light, view);
    LITAGS_RETURN_IF_ERROR(
        WriteFileAtomically(out / "raw/low" / WithExtension(name, ".DNG"),
                            DngOf(numbers, light.width, light.height, options.sensor)));
    LITAGS_RETURN_IF_ERROR(WriteRgb16(out / "deep/low" / WithExtension(name, ".PNG"),
                                      DeepCodes(numbers, options.sensor), light.width,
                                      light.height));
  }
  return Levels{MeanLevel(high), MeanLevel(low), MeanLevel(over), PhotoPsnr(low, high),
                PhotoPsnr(over, high)};
}

// A capture of other options must not be mixed with this one. What else lies there stays.
absl::Status RemoveLastCapture(const fs::path& out) {
  for (const char* name :
       {"high", "low", "over_exp", "depth", "clean", "raw", "deep", "transforms_train.json",
        "transforms_val.json", "transforms_test.json", "capture.json"}) {
    std::error_code error;
    fs::remove_all(out / name, error);
    if (error) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_WRITABLE", "out",
                       absl::StrCat((out / name).string(), ": cannot remove what an earlier run ",
                                    "wrote (", error.message(), "); choose another place"));
    }
  }
  return absl::OkStatus();
}

absl::Status MakeFolders(const CaptureOptions& options, const fs::path& out) {
  LITAGS_RETURN_IF_ERROR(MakeOwnFolder(out));
  LITAGS_RETURN_IF_ERROR(RemoveLastCapture(out));
  std::vector<const char*> folders = {"high", "low", "over_exp"};
  if (options.truth) folders.insert(folders.end(), {"depth", "clean"});
  if (options.raw) folders.insert(folders.end(), {"raw/low", "deep/low"});
  for (const char* folder : folders) LITAGS_RETURN_IF_ERROR(MakeFolder(out / folder));
  return absl::OkStatus();
}

}  // namespace

absl::Status CaptureOptions::Validate() const {
  LITAGS_RETURN_IF_ERROR(CheckRange("width", width, 32, 8192));
  LITAGS_RETURN_IF_ERROR(CheckRange("height", height, 32, 8192));
  if (raw && (width % 2 == 1 || height % 2 == 1)) {
    return InvalidInput("OUT_OF_RANGE", "width",
                        absl::StrCat("width, height: ", width, "x", height,
                                     " px; a sensor's mosaic needs even sides"));
  }
  LITAGS_RETURN_IF_ERROR(CheckRange("test_every", test_every, 2, 9999));
  LITAGS_RETURN_IF_ERROR(CheckRange("views", views, test_every / 2 + 1, 9999));
  LITAGS_RETURN_IF_ERROR(CheckRange("antialias", antialias, 1, 16));
  LITAGS_RETURN_IF_ERROR(CheckRange("low_mean", low_mean, 0.005, kHighMean));
  LITAGS_RETURN_IF_ERROR(CheckRange("jitter", jitter, 0, 0.9));
  LITAGS_RETURN_IF_ERROR(CheckRange("sensor.full_well", sensor.full_well, 10, 1e7));
  LITAGS_RETURN_IF_ERROR(CheckRange("sensor.read_noise", sensor.read_noise, 0, 1e5));
  LITAGS_RETURN_IF_ERROR(CheckRange("sensor.adc_bits", sensor.adc_bits, 8, 16));
  return CheckRange("sensor.adc_black", sensor.adc_black, 0, std::exp2(sensor.adc_bits - 1));
}

std::vector<View> CaptureViews(const CaptureOptions& options) {
  const CounterRng rng(options.seed, kHand);
  std::vector<View> views;
  for (int i = 0; i < options.views; ++i) {
    const auto shake = [&, k = uint64_t(i) * 16](int j, double size) {
      return size * (2 * rng.Uniform(k + j) - 1);
    };
    const double s = static_cast<double>(i) / (options.views - 1), turn = 2 * std::numbers::pi * s;
    const double angle = (144 * s - 72) * std::numbers::pi / 180;
    const double radius = 1.95 + 0.18 * std::sin(1.5 * turn + 1) + shake(0, 0.02);
    const Vec3 eye{radius * std::sin(angle), -radius * std::cos(angle),
                   1.32 + 0.27 * std::sin(2.5 * turn) + shake(1, 0.02)};
    const Vec3 target{shake(2, 0.04), 0.12 + shake(3, 0.04), 0.92 + shake(4, 0.04)};
    const Vec3 up{shake(5, 0.025), shake(6, 0.025), 1};

    View view;
    view.name = absl::StrFormat("%04d.JPG", i + 1);
    Camera& c = view.camera;
    c.width = options.width;
    c.height = options.height;
    c.fx = c.fy = 0.5 * c.width / std::tan(0.5 * kFieldOfViewDeg * std::numbers::pi / 180);
    c.cx = 0.5 * c.width;
    c.cy = 0.5 * c.height;
    // Cannot fail: the eye is never above its target.
    c.LookAt(ToArray(eye), ToArray(target), ToArray(up)).IgnoreError();
    views.push_back(std::move(view));
  }
  return views;
}

absl::StatusOr<CaptureReport> WriteCapture(const CaptureOptions& options,
                                           const std::string& out_dir) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  const fs::path out(out_dir);
  LITAGS_RETURN_IF_ERROR(MakeFolders(options, out));

  const World world = MakeRoom(options.seed);
  const std::vector<View> views = CaptureViews(options);
  const CounterRng rng(options.seed, kTrace);
  std::vector<Planes> light, lamps;
  for (const View& view : views) {
    const TraceOptions trace{options.antialias, rng.Bits(light.size()), options.threads};
    light.push_back(TraceRadiance(world, view.camera, trace));
    Planes depth;
    if (options.truth || options.lamp) depth = TraceDepth(world, view.camera, options.threads);
    if (options.lamp) lamps.push_back(LampLight(view.camera, depth));
    if (options.truth) {
      LITAGS_RETURN_IF_ERROR(WritePfm(out / "depth" / WithExtension(view.name, ".pfm"), depth));
    }
    if (options.on_view) options.on_view(static_cast<int>(light.size()));
  }
  const Exposures exposures = SolveExposures(options, lamps, &light);

  const size_t n = views.size();
  std::vector<absl::StatusOr<Levels>> levels(n);
  ParallelFor(options.threads, n, [&](size_t i, int) {
    const Planes lit = options.lamp ? Lit(light[i], lamps[i]) : light[i];
    levels[i] = WritePhotos(options, exposures, light[i], lit, i, views[i].name, out);
  });
  CaptureReport report;
  report.low_gain = exposures.low;
  report.over_gain = exposures.over;
  for (size_t i = 0; i < n; ++i) {
    LITAGS_RETURN_IF_ERROR(levels[i].status());
    report.high_mean += levels[i]->high / n;
    report.low_mean += levels[i]->low / n;
    report.over_mean += levels[i]->over / n;
    report.low_psnr += levels[i]->low_psnr / n;
    report.over_psnr += levels[i]->over_psnr / n;
    (IsTest(options, i) ? report.test : report.train).push_back(views[i].name);
  }
  LITAGS_RETURN_IF_ERROR(WriteCameras(options, views, out));
  if (options.raw) LITAGS_RETURN_IF_ERROR(WriteRawCameras(options, views, out));
  LITAGS_RETURN_IF_ERROR(WriteCaptureJson(options, views, exposures, out));
  return report;
}

}  // namespace litags::sample
