#include "engine/onnx/onnx_net.h"

#include <gtest/gtest.h>

#include <limits>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

class OnnxNetTest : public testing::Test {
 protected:
  absl::StatusOr<OnnxNet> Load(const OnnxWriter& model) {
    EXPECT_TRUE(WriteFileAtomically(dir_ / "net.onnx", model.Bytes()).ok());
    return OnnxNet::Load(dir_ / "net.onnx", "net");
  }
  TempDir dir_;
};

Planes Counting(int channels, int height, int width) {
  Planes planes(channels, height, width);
  for (size_t i = 0; i < planes.data.size(); ++i) planes.data[i] = 0.25f * (i % 11) - 1;
  return planes;
}

TEST_F(OnnxNetTest, AConvolutionGivesTheSumsOfItsWeights) {
  OnnxWriter model;
  model.AddInput("x", {1, 3, 4, 5});
  model.AddConstant("w", {2, 3, 1, 1}, {1, 2, 3, -1, 0, 0.5});
  model.AddConstant("b", {2}, {0.5, -0.25});
  model.AddNode("Conv", {"x", "w", "b"}, "y", {{"kernel_shape", {1, 1}}});
  model.AddOutput("y", {1, 2, 4, 5});
  auto net = Load(model);
  ASSERT_TRUE(net.ok()) << net.status();
  const Planes x = Counting(3, 4, 5);
  const auto y = net->Run({{"", x}});
  ASSERT_TRUE(y.ok()) << y.status();
  ASSERT_EQ(y->channels, 2);
  ASSERT_EQ(y->height, 4);
  ASSERT_EQ(y->width, 5);
  for (int i = 0; i < 20; ++i) {
    const float r = x.plane(0)[i], g = x.plane(1)[i], b = x.plane(2)[i];
    EXPECT_NEAR(y->plane(0)[i], r + 2 * g + 3 * b + 0.5f, 1e-5) << i;
    EXPECT_NEAR(y->plane(1)[i], -r + 0.5f * b - 0.25f, 1e-5) << i;
  }
}

TEST_F(OnnxNetTest, InputsAreFoundByName) {
  OnnxWriter model;
  model.AddInput("a", {1, 1, 2, 3});
  model.AddInput("b", {1, 1, 2, 3});
  model.AddNode("Sub", {"a", "b"}, "y");
  model.AddOutput("y", {1, 1, 2, 3});
  auto net = Load(model);
  ASSERT_TRUE(net.ok()) << net.status();
  Planes a(1, 2, 3), b(1, 2, 3);
  a.data.assign(6, 5.0f);
  b.data.assign(6, 2.0f);
  EXPECT_EQ(net->Run({{"b", b}, {"a", a}})->data, std::vector<float>(6, 3.0f));
  EXPECT_EQ(Reason(net->Run({{"a", a}, {"no such input", b}}).status()), "ONNX_RUN");
}

TEST_F(OnnxNetTest, AConstantMayDivideMoreThanOnce) {
  OnnxWriter model;
  model.AddInput("x", {1, 2, 1, 2});
  model.AddConstant("c", {1, 2, 1, 1}, {2, 4});
  model.AddNode("Div", {"x", "c"}, "once");
  model.AddNode("Div", {"once", "c"}, "twice");
  model.AddOutput("twice", {1, 2, 1, 2});
  auto net = Load(model);
  ASSERT_TRUE(net.ok()) << net.status();
  Planes x(2, 1, 2);
  x.data = {4, 8, 16, 32};
  EXPECT_EQ(net->Run({{"", x}})->data, (std::vector<float>{1, 2, 1, 2}));
}

TEST_F(OnnxNetTest, ValuesThatAreNotFiniteAreRefused) {
  OnnxWriter model;
  model.AddInput("x", {1, 1, 2, 2});
  model.AddNode("Relu", {"x"}, "y");
  model.AddOutput("y", {1, 1, 2, 2});
  auto net = Load(model);
  ASSERT_TRUE(net.ok()) << net.status();
  Planes x(1, 2, 2);
  x.data[3] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(Reason(net->Run({{"", x}}).status()), "ONNX_OUTPUT");
}

TEST_F(OnnxNetTest, WhatIsNoNetworkIsRefusedByName) {
  ASSERT_TRUE(WriteFileAtomically(dir_ / "text.onnx", "not a network").ok());
  const absl::Status status = OnnxNet::Load(dir_ / "text.onnx", "net").status();
  EXPECT_EQ(Reason(status), "ONNX_UNREADABLE");
  EXPECT_NE(std::string(status.message()).find("text.onnx"), std::string::npos);
  EXPECT_TRUE(absl::IsNotFound(OnnxNet::Load(dir_ / "none.onnx", "net").status()));
}

TEST(OnnxPhoto, SidesAreRoundedUpAndColoursNormalised) {
  ImageU8 photo(7, 5);
  for (size_t i = 0; i < photo.data.size(); i += 3) photo.data[i] = 255;  // red
  OnnxPhotoOptions options;
  options.multiple = 4;
  options.mean = {0.5, 0.5, 0};
  options.std = {0.25, 0.5, 1};
  ASSERT_TRUE(options.Validate("net").ok());
  const Planes planes = OnnxPhoto(photo, options);
  EXPECT_EQ(planes.width, 8);
  EXPECT_EQ(planes.height, 8);
  EXPECT_FLOAT_EQ(planes.at(0, 3, 3), 2);
  EXPECT_FLOAT_EQ(planes.at(1, 3, 3), -1);
  EXPECT_FLOAT_EQ(planes.at(2, 3, 3), 0);
  options.std = {1, 0, 1};
  EXPECT_EQ(Reason(options.Validate("net")), "OUT_OF_RANGE");
}

}  // namespace
}  // namespace litags
