#include "engine/depth/network_depth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

constexpr int kWidth = 12, kHeight = 8;

// Grey that grows to the right: from 20 to 240.
Photo Ramp() {
  ImageU8 photo(kWidth, kHeight);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<uint8_t>(20 + 20 * (i / 3 % kWidth));
  }
  return PhotoFromU8(photo);
}

class NetworkDepth : public testing::Test {
 protected:
  // Writes a network whose `planes` outputs are `factor` times the sum of the channels, for inputs
  // of 6x4.
  std::string Model(int planes, float factor) {
    const std::string model = PointwiseModel(4, 6, std::vector<float>(3 * planes, factor),
                                             std::vector<float>(planes, 0.0f));
    const std::string path = dir_ / "depth.onnx";
    EXPECT_TRUE(WriteFileAtomically(path, model).ok());
    return path;
  }

  absl::StatusOr<std::optional<DepthMap>> Depth(const Photo& photo, const Photo* target) {
    auto provider = MakeNetworkDepthProvider(network_, "depth_model");
    if (!provider.ok()) return provider.status();
    const View view{"a.jpg", {}};
    auto maps = (*provider)->Maps({{&view, &photo, target}}, CancelToken(), [](int, int) {});
    if (!maps.ok()) return maps.status();
    return (*maps)[0];
  }

  void SetUp() override {
    network_.path = Model(1, 1);
    network_.width = 6;
    network_.height = 4;
  }

  TempDir dir_;
  DepthNetwork network_;
};

TEST_F(NetworkDepth, InverseDepthBecomesDepthOfTheNetworksSize) {
  const auto map = Depth(Ramp(), nullptr);
  ASSERT_TRUE(map.ok()) << map.status();
  ASSERT_TRUE(map->has_value());
  const Planes& depth = (*map)->depth;
  ASSERT_EQ(depth.width, 6);
  ASSERT_EQ(depth.height, 4);
  EXPECT_TRUE((*map)->confidence.empty());
  // The brightest column has inverse depth 1, the darkest 0.
  EXPECT_NEAR(depth.at(0, 3, 5), 1 / 1.1, 1e-4);
  EXPECT_NEAR(depth.at(0, 3, 0), 1 / 0.1, 1e-3);
  for (int x = 1; x < 6; ++x) EXPECT_LE(depth.at(0, 3, x), depth.at(0, 3, x - 1)) << x;
}

TEST_F(NetworkDepth, AMapLargerThanThePhotoIsAveragedDown) {
  const Photo small(3, 2);
  const Photo target = PhotoFromU8(ResizeArea(PhotoToU8(Ramp()), 3, 2));
  const auto map = Depth(small, &target);
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ((*map)->depth.width, 3);
  EXPECT_EQ((*map)->depth.height, 2);
}

TEST_F(NetworkDepth, DepthIsTakenAsItIs) {
  network_.inverse = false;
  const auto map = Depth(Ramp(), nullptr);
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_NEAR((*map)->depth.at(0, 3, 0), 0, 1e-5);
  EXPECT_NEAR((*map)->depth.at(0, 3, 5), 1, 1e-5);
}

TEST_F(NetworkDepth, TheNetworkSeesTheBrightenedPhoto) {
  Photo negative = Ramp();
  for (int16_t& v : negative.data) v = static_cast<int16_t>(kPhotoWhite - v);
  const auto map = Depth(Ramp(), &negative);
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_GT((*map)->depth.at(0, 3, 5), (*map)->depth.at(0, 3, 0));
}

TEST_F(NetworkDepth, APhotoWhereAllIsAlikeHasNoMap) {
  Photo flat(kWidth, kHeight);
  const auto map = Depth(flat, nullptr);
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_FALSE(map->has_value());
}

TEST_F(NetworkDepth, NetworksThatDoNotFitAreRefusedByTheOptionsName) {
  network_.path = Model(2, 1);
  EXPECT_EQ(Reason(Depth(Ramp(), nullptr).status()), "DEPTH_NETWORK_OUTPUT");
  network_.path = dir_ / "none.onnx";
  EXPECT_EQ(Reason(Depth(Ramp(), nullptr).status()), "NO_SUCH_FILE");
  EXPECT_EQ(GetErrorDetail(Depth(Ramp(), nullptr).status())->field, "depth_model");
}

TEST(DepthNetwork, IsReadFromText) {
  const auto network = DepthNetwork::Parse(
      "/m/depth.onnx,size=518x392,mean=0.5:0.4:0.3,std=1:2:3,output=depth", "--depth-model");
  ASSERT_TRUE(network.ok()) << network.status();
  EXPECT_EQ(network->path, "/m/depth.onnx");
  EXPECT_EQ(network->width, 518);
  EXPECT_EQ(network->height, 392);
  EXPECT_EQ(network->mean, (std::array<double, 3>{0.5, 0.4, 0.3}));
  EXPECT_EQ(network->std, (std::array<double, 3>{1, 2, 3}));
  EXPECT_FALSE(network->inverse);
  EXPECT_TRUE(DepthNetwork::Parse("", "f")->path.empty());
  EXPECT_TRUE(DepthNetwork::Parse("a.onnx", "f")->inverse);
  for (const char* bad : {"a,size=518", "a,size=0x5", "a,mean=1:2", "a,std=1:x:2", "a,output=both",
                          "a,colour=red", "a,size", "a,mean=1:nan:2"}) {
    const absl::Status status = DepthNetwork::Parse(bad, "--depth-model").status();
    EXPECT_EQ(Reason(status), "DEPTH_MODEL_SETTING") << bad;
    EXPECT_EQ(GetErrorDetail(status)->field, "--depth-model");
  }
}

}  // namespace
}  // namespace litags
