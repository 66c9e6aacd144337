#include "engine/sample/sensor.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace litags::sample {
namespace {

// Counters of one pixel and channel: photons, then read noise.
constexpr uint64_t kDraws = 2;

// Choice: above a mean of 30 the normal law with the same mean and variance stands for Poisson's;
// the skewness it leaves out is below 0.2.
double Poisson(double mean, const CounterRng& rng, uint64_t counter) {
  if (mean >= 30) return std::max(0.0, std::round(mean + std::sqrt(mean) * rng.Normal(counter)));
  double u = rng.Uniform(2 * counter), p = std::exp(-mean);
  int n = 0;
  while (u > p && n < 200) {  // inversion by sequential search
    u -= p;
    p *= mean / ++n;
  }
  return n;
}

}  // namespace

double SrgbFromLinear(double v) {
  return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
}

double LinearFromSrgb(double v) {
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

Planes Develop(const Planes& light, const std::array<double, 3>& gain) {
  Planes out(3, light.height, light.width);
  for (int c = 0; c < 3; ++c) {
    const float* in = light.plane(c);
    float* codes = out.plane(c);
    for (size_t i = 0; i < light.plane_size(); ++i) {
      codes[i] = static_cast<float>(SrgbFromLinear(std::clamp(gain[c] * in[i], 0.0, 1.0)));
    }
  }
  return out;
}

ImageU8 Expose(const Planes& light, const std::array<double, 3>& gain, const SensorOptions& options,
               const CounterRng& rng) {
  const double top = std::exp2(options.adc_bits) - 1, span = top - options.adc_black;
  std::vector<uint8_t> code_of(static_cast<size_t>(top) + 1);
  for (size_t dn = 0; dn < code_of.size(); ++dn) {
    const double linear = std::clamp((dn - options.adc_black) / span, 0.0, 1.0);
    code_of[dn] = static_cast<uint8_t>(SrgbFromLinear(linear) * 255 + 0.5);
  }
  ImageU8 out(light.width, light.height);
  for (size_t i = 0; i < light.plane_size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const uint64_t counter = kDraws * (3 * i + c);
      const double mean = std::max(0.0, gain[c] * light.plane(c)[i]) * options.full_well;
      const double electrons = std::min(Poisson(mean, rng, counter), options.full_well) +
                               options.read_noise * rng.Normal(counter + 1);
      const double dn = std::round(electrons / options.full_well * span + options.adc_black);
      out.data[3 * i + c] = code_of[static_cast<size_t>(std::clamp(dn, 0.0, top))];
    }
  }
  return out;
}

}  // namespace litags::sample
