#include "engine/sample/sensor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/color.h"
#include "engine/io/dng.h"

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

double Top(const SensorOptions& options) { return std::exp2(options.adc_bits) - 1; }

// The sRGB code, 0..1, of each of the converter's numbers.
std::vector<double> CodesOf(const SensorOptions& options) {
  const double top = Top(options), span = top - options.adc_black;
  std::vector<double> codes(static_cast<size_t>(top) + 1);
  for (size_t dn = 0; dn < codes.size(); ++dn) {
    codes[dn] = SrgbFromLinear(std::clamp((dn - options.adc_black) / span, 0.0, 1.0));
  }
  return codes;
}

}  // namespace

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

std::vector<uint16_t> Measure(const Planes& light, const std::array<double, 3>& gain,
                              const SensorOptions& options, const CounterRng& rng) {
  const double top = Top(options), span = top - options.adc_black;
  std::vector<uint16_t> numbers(3 * light.plane_size());
  for (size_t i = 0; i < light.plane_size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const uint64_t counter = kDraws * (3 * i + c);
      const double mean = std::max(0.0, gain[c] * light.plane(c)[i]) * options.full_well;
      const double electrons = std::min(Poisson(mean, rng, counter), options.full_well) +
                               options.read_noise * rng.Normal(counter + 1);
      const double dn = std::round(electrons / options.full_well * span + options.adc_black);
      numbers[3 * i + c] = static_cast<uint16_t>(std::clamp(dn, 0.0, top));
    }
  }
  return numbers;
}

ImageU8 Expose(const Planes& light, const std::array<double, 3>& gain, const SensorOptions& options,
               const CounterRng& rng) {
  const std::vector<double> codes = CodesOf(options);
  std::vector<uint8_t> code_of(codes.size());
  for (size_t dn = 0; dn < codes.size(); ++dn) {
    code_of[dn] = static_cast<uint8_t>(codes[dn] * 255 + 0.5);
  }
  const std::vector<uint16_t> numbers = Measure(light, gain, options, rng);
  ImageU8 out(light.width, light.height);
  std::transform(numbers.begin(), numbers.end(), out.data.begin(),
                 [&](uint16_t dn) { return code_of[dn]; });
  return out;
}

std::string DngOf(const std::vector<uint16_t>& numbers, int width, int height,
                  const SensorOptions& options) {
  SensorFrame frame;
  frame.width = width;
  frame.height = height;
  frame.black = static_cast<int>(options.adc_black);
  frame.white = static_cast<int>(Top(options));
  frame.numbers.reserve(size_t(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int channel = (y & 1) + (x & 1);  // red, green; green, blue
      frame.numbers.push_back(numbers[3 * (size_t(y) * width + x) + channel]);
    }
  }
  return EncodeDng(frame);
}

std::vector<uint16_t> DeepCodes(const std::vector<uint16_t>& numbers,
                                const SensorOptions& options) {
  const std::vector<double> codes = CodesOf(options);
  std::vector<uint16_t> out(numbers.size());
  std::transform(numbers.begin(), numbers.end(), out.begin(),
                 [&](uint16_t dn) { return static_cast<uint16_t>(codes[dn] * 65535 + 0.5); });
  return out;
}

}  // namespace litags::sample
