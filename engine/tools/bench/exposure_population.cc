#include "engine/tools/bench/exposure_population.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/io/image_io.h"
#include "engine/sample/sensor.h"
#include "engine/target/capture_light.h"

namespace litags {
namespace {

constexpr int kShrink = 4;       // px
constexpr double kClips = -0.2;  // stops; means of 4x4 pixels above are taken for clipped

Planes LinearLight(const Photo& photo) {
  Planes light = ToPlanes(photo);
  for (float& value : light.data) value = static_cast<float>(LinearFromSrgb(value));
  return light;
}

// Means of kShrink x kShrink pixels of light times `gain`, clipped at 1.
Planes Shrunk(const Planes& light, double gain) {
  Planes out(3, light.height / kShrink, light.width / kShrink);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < out.height * kShrink; ++y) {
      for (int x = 0; x < out.width * kShrink; ++x) {
        const double value = gain * light.plane(c)[size_t(y) * light.width + x];
        out.at(c, y / kShrink, x / kShrink) +=
            static_cast<float>(std::min(1.0, value) / (kShrink * kShrink));
      }
    }
  }
  return out;
}

LightHistogram HistogramOf(const Planes& light) {
  LightHistogram histogram;
  for (size_t i = 0; i < light.plane_size(); ++i) {
    histogram.AddPixel(light.plane(0)[i], light.plane(1)[i], light.plane(2)[i], 1, 1);
  }
  return histogram;
}

LightHistogram LumaOf(const Planes& light) {
  LightHistogram histogram;
  for (size_t i = 0; i < light.plane_size(); ++i) {
    histogram.Add(Luma(light.plane(0)[i], light.plane(1)[i], light.plane(2)[i]), 1);
  }
  return histogram;
}

// What nine crops of 3/5 of the width and height show together.
LightHistogram CropsOf(const Planes& light) {
  LightHistogram histogram;
  const int width = light.width * 3 / 5, height = light.height * 3 / 5;
  for (int crop = 0; crop < 9; ++crop) {
    const int left = (light.width - width) * (crop % 3) / 2;
    const int top = (light.height - height) * (crop / 3) / 2;
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x) {
        histogram.Add(LightOfPixel(light.at(0, y, x), light.at(1, y, x), light.at(2, y, x)), 1);
      }
    }
  }
  return histogram;
}

// Changes of histograms; light of 1 is white.

void AddScaled(const LightHistogram& from, double scale, LightHistogram* to) {
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    if (from.weight(bin) > 0) {
      to->Add(std::exp2(LightHistogram::Stops(bin)), scale * from.weight(bin));
    }
  }
}

// Adds `weight` spread over [low, high] stops as `density` says.
void AddSpread(double weight, double low, double high,
               const std::function<double(double stops)>& density, LightHistogram* light) {
  constexpr double kStep = 1.0 / LightHistogram::kBinsPerStop;
  double sum = 0;
  for (double x = low; x <= high; x += kStep) sum += density(x);
  for (double x = low; x <= high; x += kStep) light->Add(std::exp2(x), weight * density(x) / sum);
}

void AddBump(double weight, double middle, double deviation, LightHistogram* light) {
  const auto normal = [&](double x) {
    return std::exp(-0.5 * (x - middle) * (x - middle) / (deviation * deviation));
  };
  AddSpread(weight, middle - 4 * deviation, middle + 4 * deviation, normal, light);
}

// Clipped areas spread upward, to `top` stops above white.
LightHistogram Lifted(const LightHistogram& from, double top) {
  if (top < 0.05) return from;
  LightHistogram light;
  double clipped = 0;
  for (int bin = 0; bin < LightHistogram::kBins; ++bin) {
    const double stops = LightHistogram::Stops(bin), weight = from.weight(bin);
    if (stops >= kClips) {
      clipped += weight;
    } else if (weight > 0) {
      light.Add(std::exp2(stops), weight);
    }
  }
  if (clipped > 0) {
    AddSpread(
        clipped, kClips, top, [&](double x) { return std::exp(-2 * x / top); }, &light);
  }
  return light;
}

// Draws for one case.
class Draws {
 public:
  Draws(size_t photo, uint64_t stream) : rng_(photo, stream) {}
  double operator()(double low, double high) {
    return low + (high - low) * rng_.Uniform(counter_++);
  }

 private:
  CounterRng rng_;
  uint64_t counter_ = 0;
};

// Bulbs with a glow around them.
LightHistogram WithLamps(const LightHistogram& from, Draws* draw) {
  const double share = std::exp((*draw)(std::log(2e-4), std::log(0.12)));
  const double level = (*draw)(1, 7), deviation = (*draw)(0.2, 1.2), glow = (*draw)(0, 0.5);
  LightHistogram light;
  AddScaled(from, (1 - share) / from.total(), &light);
  AddBump(share * (1 - glow), level, deviation, &light);
  AddSpread(
      share * glow, -3, level, [](double) { return 1.0; }, &light);
  return light;
}

LightHistogram WithWindows(const LightHistogram& from, Draws* draw) {
  const double share = (*draw)(0, 0.15), level = (*draw)(0.3, 4), deviation = (*draw)(0.3, 1);
  LightHistogram light;
  AddScaled(from, (1 - share) / from.total(), &light);
  AddBump(share, level, deviation, &light);
  return light;
}

void AddFitCases(size_t photo, const LightHistogram& plain, std::vector<ExposureCase>* cases) {
  uint64_t stream = 0;
  const auto add = [&](const char* kind, int copies, const auto& change) {
    for (int i = 0; i < copies; ++i) {
      Draws draw(photo, stream++);
      cases->push_back({photo, kind, true, change(Lifted(plain, draw(-0.5, 2)), &draw), 0});
    }
  };
  using L = LightHistogram;
  cases->push_back({photo, "plain", true, plain, 0});
  add("own", 2, [](const L& light, Draws*) { return light; });
  add("lamps", 2, [](const L& light, Draws* draw) { return WithLamps(light, draw); });
  add("windows", 2, [](const L& light, Draws* draw) { return WithWindows(light, draw); });
  add("sky", 1, [](const L& light, Draws* draw) { return Lifted(light, (*draw)(0.2, 2.5)); });
  add("lamps and windows", 1,
      [](const L& light, Draws* draw) { return WithWindows(WithLamps(light, draw), draw); });
}

LightHistogram LightOf(const Photo& photo) {
  const double exposure = 1;
  return CaptureLight({&photo, 1}, {&exposure, 1}, /*threads=*/1);
}

absl::Status AddDarkCases(size_t photo, const Planes& light, std::vector<ExposureCase>* cases) {
  for (const double stops : {6.0, 7.5, 9.0}) {
    const double gain = std::exp2(-stops);
    const ImageU8 dark =
        sample::Expose(light, {gain, gain, gain}, sample::SensorOptions(), CounterRng(photo, 99));
    cases->push_back(
        {photo, absl::StrCat("png, dark by ", stops), false, LightOf(PhotoFromU8(dark)), stops});
    LITAGS_ASSIGN_OR_RETURN(const std::string jpeg, EncodeJpeg(dark));
    LITAGS_ASSIGN_OR_RETURN(const Photo stored, DecodePhoto(jpeg, "photo"));
    cases->push_back({photo, absl::StrCat("dark by ", stops), false, LightOf(stored), stops});
  }
  return absl::OkStatus();
}

// A torch lights the middle of the photo; noise is in codes, before black cuts it.
void AddTorchCases(size_t photo, const Planes& light, std::vector<ExposureCase>* cases) {
  constexpr double kSide = 0.3, kStops = 5;
  const double gain = std::exp2(-kStops), code = LinearFromSrgb(1 / 255.0);
  for (const double noise : {0.0, 0.5, 0.7, 1.0, 2.0}) {
    const CounterRng rng(photo, 98);
    ImageU8 torch(light.width, light.height);
    for (int y = 0; y < light.height; ++y) {
      for (int x = 0; x < light.width; ++x) {
        const bool lit = std::abs(x + 0.5 - light.width / 2.0) < kSide * light.width / 2 &&
                         std::abs(y + 0.5 - light.height / 2.0) < kSide * light.height / 2;
        for (int c = 0; c < 3; ++c) {
          const uint64_t draw = 3 * (uint64_t(y) * light.width + x) + c;
          const double seen =
              (lit ? gain * light.at(c, y, x) : 0) + noise * code * rng.Normal(draw);
          torch.pixel(x, y)[c] =
              static_cast<uint8_t>(255 * SrgbFromLinear(std::clamp(seen, 0.0, 1.0)) + 0.5);
        }
      }
    }
    const std::string kind = absl::StrCat("torch, noise ", noise);
    cases->push_back({photo, kind, false, LightOf(PhotoFromU8(torch)), kStops});
  }
}

absl::Status AddTestCases(size_t photo, const Planes& light, std::vector<ExposureCase>* cases) {
  cases->push_back({photo, "crops", false, CropsOf(Shrunk(light, 1)), 0});
  LITAGS_RETURN_IF_ERROR(AddDarkCases(photo, light, cases));
  AddTorchCases(photo, light, cases);
  for (const double stops : {1.0, 2.0, 2.3, 3.0}) {
    cases->push_back({photo, absl::StrCat("over by ", stops), false,
                      HistogramOf(Shrunk(light, std::exp2(stops))), -stops});
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ExposurePopulation> MakeExposurePopulation(const std::string& folder) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(folder, "photos"));
  ExposurePopulation population;
  population.photos = names.size();
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string path = absl::StrCat(folder, "/", names[i]);
    LITAGS_ASSIGN_OR_RETURN(const Photo photo, ReadPhoto(path, path));
    const Planes light = LinearLight(photo), small = Shrunk(light, 1);
    population.luma.push_back(LumaOf(small));
    LightHistogram plain;
    for (size_t k = 0; k < small.plane_size(); ++k) {
      plain.Add(LightOfPixel(small.plane(0)[k], small.plane(1)[k], small.plane(2)[k]), 1);
    }
    AddFitCases(i, plain, &population.cases);
    LITAGS_RETURN_IF_ERROR(AddTestCases(i, light, &population.cases));
  }
  return population;
}

}  // namespace litags
