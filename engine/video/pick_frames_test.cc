#include "engine/video/pick_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/io/image_io.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

using testing::HasSubstr;

TEST(PickFrames, GivesTheAskedNumberUprightAndInOrder) {
  TestVideo options;
  options.quarters = 1;
  const std::string video = EncodeVideo(WalkFrames(320, 180, 90, 5), options);
  std::vector<Photo> photos;
  const auto picked = PickFrames(video, "videos[v]", 10, nullptr, [&](const std::string& png) {
    EXPECT_EQ(ReadImageInfo(png, "png")->bit_depth, 16);
    photos.push_back(*DecodePhoto(png, "png"));
    return absl::OkStatus();
  });
  ASSERT_TRUE(picked.ok()) << picked.status();
  EXPECT_EQ(picked->frames, 90);
  EXPECT_EQ(picked->chosen, 10);
  EXPECT_NEAR(picked->seconds, 89 / 30.0, 0.01);
  ASSERT_EQ(photos.size(), 10u);
  for (const Photo& photo : photos) {
    EXPECT_EQ(photo.width, 180);
    EXPECT_EQ(photo.height, 320);
  }
}

TEST(PickFrames, BlurredFramesAreAvoided) {
  std::vector<int> blurred;
  for (int i = 0; i < 60; ++i) {
    if (i % 5 != 2) blurred.push_back(i);
  }
  const auto frames = WalkFrames(640, 360, 60, 6, blurred);
  std::vector<int> chosen;
  const auto picked =
      PickFrames(EncodeVideo(frames, {}), "videos[v]", 12, nullptr, [&](const std::string& png) {
        const ImageU8 image = *DecodeImage(png, "png");
        int best = 0;
        double least = 1e300;
        for (int i = 0; i < 60; ++i) {
          double sum = 0;
          for (size_t k = 0; k < image.data.size(); k += 997) {
            sum += std::pow(double(image.data[k]) - frames[i].data[k], 2);
          }
          if (sum < least) least = sum, best = i;
        }
        chosen.push_back(best);
        return absl::OkStatus();
      });
  ASSERT_TRUE(picked.ok()) << picked.status();
  int sharp = 0;
  for (const int i : chosen) sharp += i % 5 == 2;
  // Of any frames a fifth would be sharp. Blur moves what is measured a little, from part to part.
  EXPECT_EQ(chosen.size(), 12u);
  EXPECT_GE(sharp, 11) << testing::PrintToString(chosen);
}

TEST(PickFrames, OneFrameIsNoScene) {
  const auto picked = PickFrames(EncodeVideo(WalkFrames(96, 64, 1, 0), {}), "videos[v]", 0, nullptr,
                                 [](const std::string&) { return absl::OkStatus(); });
  EXPECT_EQ(Reason(picked.status()), "TOO_FEW_FRAMES");
  EXPECT_THAT(std::string(picked.status().message()), HasSubstr("1 of its 1 frames"));
}

TEST(PickFrames, TheSinksErrorEndsIt) {
  int calls = 0;
  const auto picked = PickFrames(EncodeVideo(WalkFrames(96, 64, 30, 3), {}), "v", 0, nullptr,
                                 [&](const std::string&) {
                                   ++calls;
                                   return absl::CancelledError("enough");
                                 });
  EXPECT_TRUE(absl::IsCancelled(picked.status()));
  EXPECT_EQ(calls, 1);
}

TEST(PickFrames, ACancelEndsItAtTheNextFrame) {
  CancelToken cancel;
  int calls = 0;
  const auto picked = PickFrames(
      EncodeVideo(WalkFrames(96, 64, 30, 3), {}), "v", 0, nullptr,
      [&](const std::string&) {
        ++calls;
        cancel.Cancel();
        return absl::OkStatus();
      },
      cancel);
  EXPECT_TRUE(absl::IsCancelled(picked.status())) << picked.status();
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace litags
