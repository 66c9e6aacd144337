// What the sensor's numbers bring over the 8-bit JPEG of the same exposure, by how dark it is.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"
#include "engine/sample/capture.h"
#include "engine/sample/sensor.h"
#include "engine/sample/tracer.h"
#include "engine/sample/world.h"
#include "gtest/gtest.h"

namespace litags::sample {
namespace {

constexpr int kShots = 16;  // that a scene averages over, as training does over views

// As a lens does, so that the mosaic sees no edges sharper than itself.
void Blur(Planes* planes) {
  const Planes in = *planes;
  const auto at = [](int i, int n) { return std::clamp(i, 0, n - 1); };
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < in.height; ++y) {
      for (int x = 0; x < in.width; ++x) {
        float sum = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const float weight = (2.0f - std::abs(dx)) * (2.0f - std::abs(dy)) / 16;
            sum += weight * in.at(c, at(y + dy, in.height), at(x + dx, in.width));
          }
        }
        planes->at(c, y, x) = sum;
      }
    }
  }
}

// A view of the room, of which 3 % are white and more.
Planes RoomLight() {
  CaptureOptions options;
  options.width = 160;
  options.height = 120;
  options.views = 5;
  Planes light = TraceRadiance(MakeRoom(0), CaptureViews(options)[2].camera, {2, 1, 1});
  for (int i = 0; i < 3; ++i) Blur(&light);
  std::vector<float> sorted = light.data;
  const size_t at = sorted.size() * 97 / 100;
  std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
  const float white = sorted[at];
  for (float& value : light.data) value /= white;
  return light;
}

// Light of a photo whose exposure was `gain`, as [H, W, 3].
std::vector<double> LightOf(const std::string& bytes, double gain) {
  const auto photo = DecodePhoto(bytes, "photo");
  EXPECT_TRUE(photo.ok()) << photo.status();
  std::vector<double> light;
  for (const int16_t sample : photo->data) light.push_back(LinearTable::Get()(sample) / gain);
  return light;
}

double Psnr(const std::vector<double>& light, const Planes& truth) {
  double sum = 0;
  for (size_t i = 0; i < light.size(); ++i) {
    const double want = std::min(truth.plane(i % 3)[i / 3], 1.0f);
    const double error =
        SrgbFromLinear(std::clamp(light[i], 0.0, 1.0)) - SrgbFromLinear(std::max(want, 0.0));
    sum += error * error;
  }
  return -10 * std::log10(sum / static_cast<double>(light.size()));
}

// dB of one shot and of the mean of all shots.
struct Quality {
  double one = 0, mean = 0;
};

template <class Encode>
Quality QualityOf(const Planes& truth, double gain, const Encode& encode) {
  Quality quality;
  std::vector<double> mean(truth.data.size());
  for (int shot = 0; shot < kShots; ++shot) {
    const std::vector<double> light = LightOf(encode(CounterRng(5, shot)), gain);
    for (size_t i = 0; i < light.size(); ++i) mean[i] += light[i] / kShots;
    if (shot == 0) quality.one = Psnr(light, truth);
  }
  quality.mean = Psnr(mean, truth);
  return quality;
}

// The JPEG is the camera's: of what it made from the same mosaic.
TEST(Raw, HoldsMoreThanJpegInTheDark) {
  const Planes light = RoomLight();
  std::printf("stops under   JPEG one, mean   RAW one, mean   (dB)\n");
  for (const int stops : {1, 3, 5, 7}) {
    const double gain = std::exp2(-stops);
    const std::array<double, 3> gains = {gain, gain, gain};
    const SensorOptions options;
    const auto dng = [&](const CounterRng& rng) {
      return DngOf(Measure(light, gains, options, rng), light.width, light.height, options);
    };
    const Quality raw = QualityOf(light, gain, dng);
    const Quality jpeg = QualityOf(light, gain, [&](const CounterRng& rng) {
      return EncodeJpeg(DecodeImage(dng(rng), "photo").value(), 95).value();
    });
    std::printf("%11d   %8.2f %6.2f   %7.2f %6.2f\n", stops, jpeg.one, jpeg.mean, raw.one,
                raw.mean);
    EXPECT_GT(raw.mean, jpeg.mean + (stops >= 5 ? 1 : 0)) << stops;
  }
}

// All three channels of each pixel, which 16 bits hold and 8 bits round.
TEST(Raw, SixteenBitsHoldMoreThanJpegInTheDark) {
  const Planes light = RoomLight();
  std::printf("stops under   JPEG mean   16 bits mean   (dB)\n");
  for (const int stops : {1, 3, 5, 7}) {
    const double gain = std::exp2(-stops);
    const std::array<double, 3> gains = {gain, gain, gain};
    const SensorOptions options;
    const Quality deep = QualityOf(light, gain, [&](const CounterRng& rng) {
      const auto numbers = Measure(light, gains, options, rng);
      const std::vector<uint16_t> codes = DeepCodes(numbers, options);
      return EncodePngCodes(codes.data(), light.width, light.height, 3).value();
    });
    const Quality jpeg = QualityOf(light, gain, [&](const CounterRng& rng) {
      return EncodeJpeg(Expose(light, gains, options, rng), 95).value();
    });
    std::printf("%11d   %9.2f   %12.2f\n", stops, jpeg.mean, deep.mean);
    EXPECT_GT(deep.mean, jpeg.mean) << stops;
  }
}

}  // namespace
}  // namespace litags::sample
