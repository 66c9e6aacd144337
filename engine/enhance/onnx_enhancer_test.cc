#include "engine/enhance/onnx_enhancer.h"

#include <gtest/gtest.h>

#include "engine/io/file_util.h"
#include "engine/io/test_util.h"
#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

// y = weights * x + bias per channel, any size.
std::string Brightener(int channels, float weight, float bias) {
  OnnxWriter model;
  model.AddInput("x", {1, 3, 12, 16});
  std::vector<float> weights(size_t(channels) * 3, 0.0f);
  for (int c = 0; c < channels; ++c) weights[c * 3 + c % 3] = weight;
  model.AddConstant("w", {channels, 3, 1, 1}, weights);
  model.AddConstant("b", {channels}, std::vector<float>(channels, bias));
  model.AddNode("Conv", {"x", "w", "b"}, "y", {{"kernel_shape", {1, 1}}});
  model.AddOutput("y", {1, channels, 12, 16});
  return model.Bytes();
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

TEST(ParseOnnxEnhancer, SettingsAreReadAndNonsenseIsNamed) {
  const auto options = ParseOnnxEnhancer("sci=a/b.onnx,size=600x400,multiple=4,output=enh");
  ASSERT_TRUE(options.ok()) << options.status();
  EXPECT_EQ(options->name, "sci");
  EXPECT_EQ(options->path, "a/b.onnx");
  EXPECT_EQ(options->input.width, 600);
  EXPECT_EQ(options->input.height, 400);
  EXPECT_EQ(options->input.multiple, 4);
  EXPECT_EQ(options->output, "enh");
  for (const char* bad :
       {"b.onnx", "=b.onnx", "a=", "../a=b.onnx", "a+b=c.onnx", "a=b,size=6", "a=b,mean=1:2",
        "a=b,std=1:0:1", "a=b,white=0", "a=b,multiple=x", "a=b,shape=3", "a=b,size=-1x4"}) {
    EXPECT_FALSE(ParseOnnxEnhancer(bad).ok()) << bad;
  }
}

}  // namespace
}  // namespace litags
