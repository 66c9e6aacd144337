// A small scene with every attribute, how much files of it differ, and what a .glb holds.
#ifndef LITAGS_ENGINE_EXPORT_EXPORT_TEST_UTIL_H_
#define LITAGS_ENGINE_EXPORT_EXPORT_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/image.h"
#include "engine/eval/metrics.h"
#include "engine/export/near_order.h"
#include "engine/export/readers.h"
#include "engine/export/viewer_scene.h"
#include "engine/io/colmap_io.h"
#include "engine/io/sparse_model.h"
#include "engine/render/renderer.h"
#include "engine/train/train_test_util.h"

namespace litags {

// In NearOrder, so that the order of files is the same.
inline ViewerScene SmallScene(size_t count, int sh_degree = kMaxShDegree) {
  ViewerScene scene;
  const Splats cloud = ColoredCloud(count, 7);
  const std::vector<uint32_t> order = NearOrder(cloud);
  scene.splats.Resize(count);
  for (size_t i = 0; i < count; ++i) scene.splats.Copy(cloud, order[i], i);
  scene.sh_degree = sh_degree;
  const CounterRng rng(11, 2);
  for (size_t i = 0; i < count; ++i) {
    for (int row = kShRest; row < SplatRowsForDegree(sh_degree); ++row) {
      scene.splats.at(i, row) = static_cast<float>(0.3 * (rng.Uniform(i * kSplatRows + row) - 0.5));
    }
  }
  for (int v = 0; v < 6; ++v) {
    scene.views.push_back({"photo" + std::to_string(v) + ".png", RingCamera(v, 6, 120, 90)});
  }
  return scene;
}

inline Planes Picture(const Splats& splats, const Camera& camera,
                      PixelFilter filter = PixelFilter::kDilate) {
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  settings.pixel_filter = filter;
  Planes image, alpha;
  Renderer().Forward(splats, camera, settings, &image, &alpha);
  return image;
}

// Least PSNR of pictures from the views of `a`, dB.
inline double LeastPsnr(const ViewerScene& a, const Splats& b) {
  double least = 200;
  for (const View& view : a.views) {
    const auto psnr = Psnr(Picture(a.splats, view.camera), Picture(b, view.camera));
    EXPECT_TRUE(psnr.ok()) << psnr.status();
    least = std::min(least, psnr.value_or(0));
  }
  return least;
}

// The largest difference of each attribute.
struct Errors {
  double position = 0, log_scale = 0, angle = 0, opacity = 0, color = 0, harmonics = 0;
};

inline Errors ErrorsOf(const Splats& a, const Splats& b) {
  Errors out;
  EXPECT_EQ(a.size(), b.size());
  if (a.size() != b.size()) return out;
  const auto grow = [](double* most, double value) { *most = std::max(*most, std::abs(value)); };
  for (size_t i = 0; i < a.size(); ++i) {
    const auto differ = [&](int row) { return double{a.at(i, row)} - b.at(i, row); };
    for (int k = 0; k < 3; ++k) {
      grow(&out.position, differ(kMean + k));
      grow(&out.log_scale, differ(kLogScale + k));
      grow(&out.color, kSh0 * differ(kShDc + k));
    }
    for (int row = kShRest; row < kSplatRows; ++row) grow(&out.harmonics, differ(row));
    grow(&out.opacity, Opacity(a, i) - Opacity(b, i));
    const std::array<float, 4> p = UnitQuat(a, i), q = UnitQuat(b, i);
    // |p - q| or |p + q|: q and -q turn alike, and acos is coarse near 0.
    double minus = 0, plus = 0;
    for (int k = 0; k < 4; ++k) {
      minus += std::pow(double{p[k]} - q[k], 2);
      plus += std::pow(double{p[k]} + q[k], 2);
    }
    grow(&out.angle, 2 * std::sqrt(std::min(minus, plus)));
  }
  return out;
}

// Root of the mean square. Rounding may take a pixel's share of a Gaussian below the least alpha
// that is drawn, so that the largest difference says little.
inline double Difference(const Planes& a, const Planes& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) sum += std::pow(double{a.data[i]} - b.data[i], 2);
  return std::sqrt(sum / a.data.size());
}

// Of EncodeColmap's bytes.
inline absl::StatusOr<SparseModel> ReadExportedColmap(const std::string& bytes) {
  return ParseColmapModel(StoredFile(bytes, "sparse/0/cameras.bin"),
                          StoredFile(bytes, "sparse/0/images.bin"),
                          StoredFile(bytes, "sparse/0/points3D.bin"), "file");
}

template <typename T>
T NumberAt(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

// The JSON of a .glb, and its binary part.
inline std::pair<nlohmann::json, std::string> PartsOf(const std::string& glb) {
  EXPECT_EQ(glb.substr(0, 4), "glTF");
  EXPECT_EQ(NumberAt<uint32_t>(glb, 8), glb.size());
  const auto size = NumberAt<uint32_t>(glb, 12);
  return {nlohmann::json::parse(glb.substr(20, size)), glb.substr(20 + size + 8)};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_EXPORT_TEST_UTIL_H_
