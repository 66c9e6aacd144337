// The camera model: scene light to the bytes a camera would store.
//
// For each view and colour channel c, with x in linear light (1 = white of the normal picture):
//   signal   e = gain * jitter * wb[c] * x * full_well            electrons
//   sensor   n = min(Poisson(e), full_well) + Normal(0, read_noise)
//   ADC      q = clip(round(n / full_well * (top - black) + black), 0, top), top = 2^bits - 1
//   output   sRGB-encode(clip((q - black) / (top - black), 0, 1)), 8 bits
#ifndef LITAGS_ENGINE_SAMPLE_SENSOR_H_
#define LITAGS_ENGINE_SAMPLE_SENSOR_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/rng.h"

namespace litags::sample {

struct SensorOptions {
  double full_well = 15000;  // electrons at white
  double read_noise = 4;     // electrons, standard deviation
  int adc_bits = 12;
  double adc_black = 64;  // DN; keeps read noise from being clipped at zero
};

// Light times `gain` per channel, clipped at white, sRGB-encoded, without noise or quantisation.
Planes Develop(const Planes& light_linear, const std::array<double, 3>& gain);

// What the converter puts out, [H, W, 3]. `gain` holds exposure, jitter and white balance. Noise is
// independent per pixel and channel and depends on `rng` and the pixel's index only.
std::vector<uint16_t> Measure(const Planes& light_linear, const std::array<double, 3>& gain,
                              const SensorOptions& options, const CounterRng& rng);

// What the camera stores of that, in 8 bits.
ImageU8 Expose(const Planes& light_linear, const std::array<double, 3>& gain,
               const SensorOptions& options, const CounterRng& rng);

// The same numbers with all that they hold: as DNG, under a mosaic that keeps one channel of each
// pixel (sides are even), and sRGB-encoded in 16 bits, [H, W, 3].
std::string DngOf(const std::vector<uint16_t>& numbers, int width, int height,
                  const SensorOptions& options);
std::vector<uint16_t> DeepCodes(const std::vector<uint16_t>& numbers, const SensorOptions& options);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_SENSOR_H_
