#include "engine/sample/exposure.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/sample/sensor.h"

namespace litags::sample {
namespace {

using Gain = std::array<double, 3>;

constexpr Gain kLowWhiteBalance = {0.96, 1.0, 1.06};

// Streams of random numbers, one a view for the noise; views number at most 9999.
enum Stream : uint64_t { kJitter = 100, kLowNoise = 10000, kOverNoise = 20000 };

// Gain in [low, high] where the increasing function crosses zero, by bisection on a log scale.
double Solve(double low, double high, const std::function<double(double)>& f) {
  constexpr int kSteps = 14;  // 1e5 to the power 2^-14: 0.07 %
  for (int i = 0; i < kSteps; ++i) {
    const double middle = std::sqrt(low * high);
    (f(middle) < 0 ? low : high) = middle;
  }
  return std::sqrt(low * high);
}

// Every view reduced to an even choice of its pixels: enough to solve for the exposure.
std::vector<Planes> Thin(const std::vector<Planes>& views) {
  constexpr size_t kPixels = 40000;  // in all: the mean level is then known to about 1 %
  std::vector<Planes> out;
  if (views.empty()) return out;
  const size_t wanted = std::max<size_t>(256, kPixels / views.size());
  for (const Planes& view : views) {
    const size_t n = std::min(wanted, view.plane_size());
    Planes thin(view.channels, 1, static_cast<int>(n));
    for (int c = 0; c < view.channels; ++c) {
      for (size_t i = 0; i < n; ++i) thin.plane(c)[i] = view.plane(c)[i * view.plane_size() / n];
    }
    out.push_back(std::move(thin));
  }
  return out;
}

void Scale(std::vector<Planes>* views, double factor) {
  for (Planes& planes : *views) {
    for (float& v : planes.data) v = static_cast<float>(v * factor);
  }
}

// Mean over the views, summed in their order whatever the number of threads.
double MeanOverViews(int threads, size_t n, const std::function<double(size_t)>& f) {
  std::vector<double> values(n);
  ParallelFor(threads, n, [&](size_t i, int) { values[i] = f(i); });
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / n;
}

// The gains of all views for one gain of the capture. `lighting` is 0 for low, 1 for over.
std::vector<Gain> ViewGains(const CaptureOptions& options, double gain, int lighting,
                            const Gain& balance, size_t views) {
  const CounterRng rng(options.seed, kJitter);
  std::vector<Gain> out;
  for (size_t i = 0; i < views; ++i) {
    const double g = gain * (1 + options.jitter * (2 * rng.Uniform(2 * i + lighting) - 1));
    out.push_back({g * balance[0], g * balance[1], g * balance[2]});
  }
  return out;
}

// Random numbers of a photo's noise.
CounterRng NoiseRng(const CaptureOptions& options, uint64_t stream) {
  return CounterRng(options.seed, stream + (uint64_t{options.noise_seed} << 32));
}

}  // namespace

Exposures SolveExposures(const CaptureOptions& options, const std::vector<Planes>& lamps,
                         std::vector<Planes>* light) {
  const size_t n = light->size();
  std::vector<Planes> thin = Thin(*light);
  const double white = Solve(1e-3, 1e3, [&](double gain) {
    return MeanOverViews(options.threads, n,
                         [&](size_t i) {
                           return MeanLevel(ToImageU8(Develop(thin[i], {gain, gain, gain})));
                         }) -
           kHighMean;
  });
  Scale(light, white);
  Scale(&thin, white);
  std::vector<Planes> lit = thin;
  const std::vector<Planes> thin_lamps = Thin(lamps);
  for (size_t i = 0; i < thin_lamps.size(); ++i) lit[i] = Lit(thin[i], thin_lamps[i]);

  Exposures out;
  const auto set_low = [&](double gain) {
    out.low = gain;
    out.low_gain = ViewGains(options, gain, 0, kLowWhiteBalance, n);
  };
  const auto set_over = [&](double gain) {
    out.over = gain;
    out.over_gain = ViewGains(options, gain, 1, {1, 1, 1}, n);
  };
  set_low(Solve(1e-5, 1, [&](double gain) {
    set_low(gain);
    return MeanOverViews(options.threads, n,
                         [&](size_t i) { return MeanLevel(LowPhoto(options, out, lit[i], i)); }) -
           options.low_mean;
  }));
  set_over(Solve(1, 64, [&](double gain) {
    set_over(gain);
    return kOverPsnr - MeanOverViews(options.threads, n, [&](size_t i) {
             return PhotoPsnr(OverPhoto(options, out, lit[i], i), NormalPhoto(thin[i]));
           });
  }));
  return out;
}

Planes LampLight(const Camera& camera, const Planes& depth) {
  constexpr double kDistance = 2;                             // metres, of light 1
  const double half = std::cos(20 * std::numbers::pi / 180);  // of the angle where it is 1/2
  const double power = std::log(0.5) / std::log(half);
  Planes lamp(1, depth.height, depth.width);
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 0; x < depth.width; ++x) {
      const double u = (x + 0.5 - camera.cx) / camera.fx, v = (y + 0.5 - camera.cy) / camera.fy;
      const double stretch = std::sqrt(1 + u * u + v * v), z = depth.at(0, y, x);
      if (z <= 0) continue;  // nothing to light
      const double ratio = kDistance / (z * stretch);
      lamp.at(0, y, x) = static_cast<float>(ratio * ratio * std::pow(1 / stretch, power));
    }
  }
  return lamp;
}

Planes Lit(const Planes& light, const Planes& lamp) {
  Planes lit = light;
  for (size_t i = 0; i < lit.data.size(); ++i) lit.data[i] *= lamp.data[i % lit.plane_size()];
  return lit;
}

ImageU8 NormalPhoto(const Planes& light, double white) {
  return ToImageU8(Develop(light, {1 / white, 1 / white, 1 / white}));
}

ImageU8 LowPhoto(const CaptureOptions& options, const Exposures& exposures, const Planes& light,
                 size_t view) {
  return Expose(light, exposures.low_gain[view], options.sensor,
                NoiseRng(options, kLowNoise + view));
}

std::vector<uint16_t> LowNumbers(const CaptureOptions& options, const Exposures& exposures,
                                 const Planes& light, size_t view) {
  return Measure(light, exposures.low_gain[view], options.sensor,
                 NoiseRng(options, kLowNoise + view));
}

ImageU8 OverPhoto(const CaptureOptions& options, const Exposures& exposures, const Planes& light,
                  size_t view) {
  return Expose(light, exposures.over_gain[view], options.sensor,
                NoiseRng(options, kOverNoise + view));
}

double MeanLevel(const ImageU8& image) {
  uint64_t sum = 0;
  for (const uint8_t v : image.data) sum += v;
  return static_cast<double>(sum) / (255.0 * image.data.size());
}

double PhotoPsnr(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) {
    const double d = (int{a.data[i]} - int{b.data[i]}) / 255.0;
    sum += d * d;
  }
  return -10 * std::log10(std::max(sum / a.data.size(), 1e-12));
}

}  // namespace litags::sample
