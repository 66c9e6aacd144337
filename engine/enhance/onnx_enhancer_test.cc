#include "engine/enhance/onnx_enhancer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

std::string Brightener(int channels, float weight, float bias) {
  return ScalingModel(12, 16, channels, weight, bias);
}

class OnnxEnhancerTest : public testing::Test {
 protected:
  absl::StatusOr<ImageU8> Run(const std::string& model, const std::string& settings,
                              const ImageU8& photo) {
    EXPECT_TRUE(WriteFileAtomically(dir_ / "net.onnx", model).ok());
    auto options = ParseOnnxEnhancer("mine=" + (dir_ / "net.onnx") + settings);
    if (!options.ok()) return options.status();
    auto enhancer = MakeOnnxEnhancer(*options);
    if (!enhancer.ok()) return enhancer.status();
    EXPECT_EQ(enhancer->name, "mine");
    return enhancer->run(photo);
  }
  TempDir dir_;
};

TEST_F(OnnxEnhancerTest, ThePhotoGoesThroughTheNetwork) {
  const ImageU8 photo = TestImage(16, 12);
  const auto out = Run(Brightener(3, 0.5f, 0.25f), "", photo);
  ASSERT_TRUE(out.ok()) << out.status();
  for (size_t i = 0; i < photo.data.size(); ++i) {
    EXPECT_NEAR(out->data[i], 0.5 * photo.data[i] + 0.25 * 255, 0.51) << i;
  }
}

TEST_F(OnnxEnhancerTest, MeanStdAndWhiteAreHonoured) {
  const ImageU8 photo = TestImage(16, 12);
  // (v - 0.5) / 0.5, times 127.5, plus 127.5, of 255: the photo again.
  const auto out =
      Run(Brightener(3, 127.5f, 127.5f), ",mean=0.5:0.5:0.5,std=0.5:0.5:0.5,white=255", photo);
  ASSERT_TRUE(out.ok()) << out.status();
  for (size_t i = 0; i < photo.data.size(); ++i) EXPECT_NEAR(out->data[i], photo.data[i], 1) << i;
}

TEST_F(OnnxEnhancerTest, AnotherInputSizeIsResizedBack) {
  ImageU8 photo(33, 21);
  photo.data.assign(photo.data.size(), 100);
  const auto out = Run(Brightener(3, 1, 0), ",size=16x12", photo);
  ASSERT_TRUE(out.ok()) << out.status();
  EXPECT_EQ(out->width, 33);
  EXPECT_EQ(out->height, 21);
  EXPECT_EQ(out->data, photo.data);
}

TEST_F(OnnxEnhancerTest, ANetworkOfOneChannelIsRefused) {
  EXPECT_EQ(Reason(Run(Brightener(1, 1, 0), "", TestImage(16, 12)).status()), "BAD_ENHANCER");
}

// The part of a picture with its corner at (x0, y0).
ImageU8 Crop(const ImageU8& image, int x0, int y0, int width, int height) {
  ImageU8 out(width, height);
  for (int y = 0; y < height; ++y) {
    std::copy_n(image.pixel(x0, y0 + y), size_t(width) * 3, out.pixel(0, y));
  }
  return out;
}

double MeanCode(const ImageU8& image) {
  double sum = 0;
  for (const uint8_t code : image.data) sum += code;
  return sum / static_cast<double>(image.data.size());
}

// They were exported at 480x270; the photos of realx3d have other sizes, odd ones too.
TEST(PublishedEnhancers, BrightenARealDarkPhotoOfAnySize) {
  const std::string scenes = SharedScenes();
  if (scenes.empty()) GTEST_SKIP() << "no shared/scenes beside the source tree";
  const std::string files = scenes + "/../enhancers/";
  const std::string photo_path = scenes + "/realx3d/BlueHawaii/low/0001.JPG";
  for (const char* name : {"sci-medium", "zero-dce"}) {
    SCOPED_TRACE(name);
    const std::string file = files + name + ".onnx";
    if (!std::filesystem::exists(file) || !std::filesystem::exists(photo_path)) {
      GTEST_SKIP() << "no " << file << " or no " << photo_path;
    }
    const auto photo = ReadImage(photo_path, "photo");
    const auto options = ParseOnnxEnhancer(std::string(name) + "=" + file);
    ASSERT_TRUE(photo.ok() && options.ok());
    const auto enhancer = MakeOnnxEnhancer(*options);
    ASSERT_TRUE(enhancer.ok()) << enhancer.status();
    const ImageU8 small = ResizeArea(*photo, 441, 293);
    const auto whole = enhancer->run(small);
    ASSERT_TRUE(whole.ok()) << whole.status();
    EXPECT_EQ(whole->width, 441);
    EXPECT_EQ(whole->height, 293);
    EXPECT_GT(MeanCode(*whole), 1.5 * MeanCode(small));
    // A part of the photo, of another size, gives that part of the picture, but for the border
    // that the convolutions see: 7 layers of 3x3 in Zero-DCE, 5 in SCI.
    const auto part = enhancer->run(Crop(small, 101, 50, 200, 150));
    ASSERT_TRUE(part.ok()) << part.status();
    const ImageU8 inside = Crop(*part, 10, 10, 180, 130);
    const ImageU8 same = Crop(*whole, 111, 60, 180, 130);
    int largest = 0;
    for (size_t i = 0; i < same.data.size(); ++i) {
      largest = std::max(largest, std::abs(int{same.data[i]} - int{inside.data[i]}));
    }
    EXPECT_LE(largest, 1);  // rounding
  }
}

TEST(ParseOnnxEnhancer, SettingsAreReadAndNonsenseIsNamed) {
  const auto options = ParseOnnxEnhancer("sci=a/b.onnx,size=600x400,multiple=4,output=enh");
  ASSERT_TRUE(options.ok()) << options.status();
  EXPECT_EQ(options->name, "sci");
  EXPECT_EQ(options->path, "a/b.onnx");
  EXPECT_EQ(options->input.width, 600);
  EXPECT_EQ(options->input.height, 400);
  EXPECT_EQ(options->input.multiple, 4);
  EXPECT_EQ(options->output, "enh");
  for (const char* bad : {"b.onnx", "=b.onnx", "a=", "../a=b.onnx", "a+b=c.onnx", "a=b,size=6",
                          "a=b,mean=1:2", "a=b,mean=1:nan:2", "a=b,std=1:0:1", "a=b,white=0",
                          "a=b,multiple=x", "a=b,shape=3", "a=b,size=-1x4"}) {
    EXPECT_FALSE(ParseOnnxEnhancer(bad).ok()) << bad;
  }
}

}  // namespace
}  // namespace litags
