#include "engine/eval/lpips.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/test_util.h"
#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

constexpr int kWidth = 20, kHeight = 14, kFeatures = 4;

// Weights of the little network below.
struct Weights {
  std::vector<float> features, lin;
  Weights() {
    const CounterRng rng(3, 0);
    for (int i = 0; i < kFeatures * 3; ++i) features.push_back(static_cast<float>(rng.Normal(i)));
    for (int i = 0; i < kFeatures; ++i) lin.push_back(0.25f * (i + 1));
  }
};

// The operators of the authors' package with one layer of 1x1 features: scaling, convolution,
// ReLU, division by the length over channels, squared difference, weights, mean over the picture.
OnnxWriter LittleLpips() {
  const Weights weights;
  OnnxWriter model;
  model.AddConstant("shift", {1, 3, 1, 1}, {-0.03f, -0.088f, -0.188f});
  model.AddConstant("scale", {1, 3, 1, 1}, {0.458f, 0.448f, 0.45f});
  model.AddConstant("w", {kFeatures, 3, 1, 1}, weights.features);
  model.AddConstant("lin", {1, kFeatures, 1, 1}, weights.lin);
  model.AddConstant("two", {}, {2.0f});
  model.AddConstant("eps", {}, {1e-10f});
  for (const std::string i : {"0", "1"}) {
    model.AddInput("in" + i, {1, 3, kHeight, kWidth});
    model.AddNode("Sub", {"in" + i, "shift"}, "shifted" + i);
    model.AddNode("Div", {"shifted" + i, "scale"}, "scaled" + i);
    model.AddNode("Conv", {"scaled" + i, "w"}, "conv" + i, {{"kernel_shape", {1, 1}}});
    model.AddNode("Relu", {"conv" + i}, "relu" + i);
    model.AddNode("Pow", {"relu" + i, "two"}, "square" + i);
    model.AddNode("ReduceSum", {"square" + i}, "sum" + i, {{"axes", {1}}}, {{"keepdims", 1}});
    model.AddNode("Sqrt", {"sum" + i}, "root" + i);
    model.AddNode("Add", {"root" + i, "eps"}, "length" + i);
    model.AddNode("Div", {"relu" + i, "length" + i}, "unit" + i);
  }
  model.AddNode("Sub", {"unit0", "unit1"}, "difference");
  model.AddNode("Pow", {"difference", "two"}, "squared");
  model.AddNode("Conv", {"squared", "lin"}, "weighted", {{"kernel_shape", {1, 1}}});
  model.AddNode("ReduceMean", {"weighted"}, "distance", {{"axes", {2, 3}}}, {{"keepdims", 1}});
  model.AddOutput("distance", {1, 1, 1, 1});
  return model;
}

std::array<double, kFeatures> UnitFeatures(const uint8_t* rgb) {
  const Weights weights;
  const double shift[] = {-0.03, -0.088, -0.188}, scale[] = {0.458, 0.448, 0.45};
  std::array<double, kFeatures> f = {};
  double length = 0;
  for (int k = 0; k < kFeatures; ++k) {
    for (int c = 0; c < 3; ++c) {
      f[k] += weights.features[k * 3 + c] * (rgb[c] / 127.5 - 1 - shift[c]) / scale[c];
    }
    f[k] = std::max(f[k], 0.0);
    length += f[k] * f[k];
  }
  for (double& v : f) v /= std::sqrt(length) + 1e-10;
  return f;
}

double Expected(const ImageU8& a, const ImageU8& b) {
  const Weights weights;
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); i += 3) {
    const auto fa = UnitFeatures(&a.data[i]), fb = UnitFeatures(&b.data[i]);
    for (int k = 0; k < kFeatures; ++k) sum += weights.lin[k] * std::pow(fa[k] - fb[k], 2);
  }
  return sum / (a.width * a.height);
}

class LpipsTest : public testing::Test {
 protected:
  absl::StatusOr<Lpips> Load(const OnnxWriter& model) {
    EXPECT_TRUE(WriteFileAtomically(dir_ / "lpips.onnx", model.Bytes()).ok());
    return Lpips::Load(dir_ / "lpips.onnx");
  }
  TempDir dir_;
};

TEST_F(LpipsTest, ItIsTheDistanceOfUnitFeatures) {
  auto lpips = Load(LittleLpips());
  ASSERT_TRUE(lpips.ok()) << lpips.status();
  const ImageU8 a = TestImage(kWidth, kHeight);
  ImageU8 b = a;
  for (size_t i = 0; i < b.data.size(); ++i) b.data[i] = static_cast<uint8_t>(255 - b.data[i] / 2);
  const auto distance = lpips->Distance(a, b);
  ASSERT_TRUE(distance.ok()) << distance.status();
  EXPECT_NEAR(*distance, Expected(a, b), 1e-4 * Expected(a, b));  // float against double
  EXPECT_EQ(lpips->Distance(a, a).value(), 0);
}

TEST_F(LpipsTest, SizesThatDifferAreRefused) {
  auto lpips = Load(LittleLpips());
  ASSERT_TRUE(lpips.ok()) << lpips.status();
  EXPECT_EQ(Reason(lpips->Distance(ImageU8(20, 14), ImageU8(14, 20)).status()), "SIZE_MISMATCH");
}

TEST_F(LpipsTest, AMapOfDistancesIsRefused) {
  OnnxWriter model;
  for (const char* name : {"in0", "in1"}) model.AddInput(name, {1, 3, kHeight, kWidth});
  model.AddNode("Sub", {"in0", "in1"}, "y");
  model.AddOutput("y", {1, 3, kHeight, kWidth});
  auto lpips = Load(model);
  ASSERT_TRUE(lpips.ok()) << lpips.status();
  const ImageU8 a(kWidth, kHeight);
  EXPECT_EQ(Reason(lpips->Distance(a, a).status()), "ONNX_OUTPUT");
}

}  // namespace
}  // namespace litags
