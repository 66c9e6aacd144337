#include "engine/tools/film/video_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/photo.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/eval/metrics.h"
#include "engine/io/file_util.h"
#include "engine/video/testing_video.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 96, kHeight = 64;

absl::Status Write(const std::string& path, const std::vector<ImageU8>& pictures, int rate = 25) {
  LITAGS_ASSIGN_OR_RETURN(const auto writer, VideoWriter::Create(std::fopen(path.c_str(), "wb"),
                                                                 path, rate, "--video"));
  for (const ImageU8& picture : pictures) LITAGS_RETURN_IF_ERROR(writer->Add(picture));
  return writer->Finish();
}

struct Read {
  int width = 0, height = 0;
  std::vector<double> seconds;
  std::vector<ImageU8> pictures;
};

ImageU8 ToU8(const Photo& photo) {
  ImageU8 image(photo.width, photo.height);
  for (size_t i = 0; i < image.data.size(); ++i) {
    const float code = 255 * EncodedOf(photo.data[i]);
    image.data[i] = static_cast<uint8_t>(std::lround(std::clamp(code, 0.0f, 255.0f)));
  }
  return image;
}

Read ReadBack(const std::string& path) {
  Read read;
  const std::string bytes = ReadFile(path, "video", 1 << 20).value_or("");
  const auto file = VideoFile::Open(bytes, "video");
  EXPECT_TRUE(file.ok()) << file.status();
  if (!file.ok()) return read;
  read.width = (*file)->info().width;
  read.height = (*file)->info().height;
  while ((*file)->Next().value_or(false)) {
    read.seconds.push_back((*file)->Seconds());
    read.pictures.push_back(ToU8((*file)->Picture()));
  }
  return read;
}

class VideoWriterKinds : public ::testing::TestWithParam<const char*> {
 protected:
  std::string Path() const { return (fs::path(dir_.path()) / ("v" + ending())).string(); }
  std::string ending() const { return GetParam(); }

  TempDir dir_;
};

TEST_P(VideoWriterKinds, WhatIsReadBackIsWhatWasWritten) {
  const std::vector<ImageU8> pictures = WalkFrames(kWidth, kHeight, 12, 1.5);
  ASSERT_TRUE(Write(Path(), pictures, 25).ok());
  const Read read = ReadBack(Path());
  EXPECT_EQ(read.width, kWidth);
  EXPECT_EQ(read.height, kHeight);
  ASSERT_EQ(read.pictures.size(), pictures.size());
  for (size_t i = 0; i < pictures.size(); ++i) {
    EXPECT_NEAR(read.seconds[i], static_cast<double>(i) / 25, 2e-3);  // WebM counts milliseconds
    // The least was 38.9 dB; to the frame beside it, it is 28.0 dB at most.
    EXPECT_GT(*Psnr(read.pictures[i], pictures[i]), 36) << i;
  }
}

TEST_P(VideoWriterKinds, ColoursAreKept) {
  ImageU8 picture(kWidth, kHeight);
  const uint8_t colours[][3] = {{200, 40, 40}, {40, 180, 60}, {30, 60, 210}, {250, 250, 250}};
  for (int x = 0; x < kWidth; ++x) {
    for (int y = 0; y < kHeight; ++y)
      std::copy_n(colours[x / (kWidth / 4)], 3, picture.pixel(x, y));
  }
  ASSERT_TRUE(Write(Path(), {picture, picture}).ok());
  const ImageU8 read = ReadBack(Path()).pictures.at(1);
  for (int i = 0; i < 4; ++i) {
    for (int c = 0; c < 3; ++c) {
      // With the matrix of BT.601 instead of BT.709 red would be 14 codes off, its green 17.
      EXPECT_NEAR(read.pixel(kWidth / 4 * i + kWidth / 8, kHeight / 2)[c], colours[i][c], 4);
    }
  }
}

TEST_P(VideoWriterKinds, AnotherRateLastsAnotherTime) {
  ASSERT_TRUE(Write(Path(), WalkFrames(kWidth, kHeight, 11, 1), 10).ok());
  EXPECT_NEAR(ReadBack(Path()).seconds.back(), 1.0, 2e-3);
}

TEST_P(VideoWriterKinds, OfOddSidesTheLastRowAndColumnAreLeftOut) {
  ASSERT_TRUE(Write(Path(), WalkFrames(97, 65, 3, 1)).ok());
  const Read read = ReadBack(Path());
  EXPECT_EQ(read.width, 96);
  EXPECT_EQ(read.height, 64);
}

TEST_P(VideoWriterKinds, FramesOfAnotherSizeAreRefused) {
  std::vector<ImageU8> pictures = WalkFrames(kWidth, kHeight, 1, 1);
  pictures.push_back(WalkFrames(64, 64, 1, 1)[0]);
  EXPECT_EQ(Reason(Write(Path(), pictures)), "VIDEO_SIZE_CHANGED");
  EXPECT_EQ(Reason(Write(Path(), {ImageU8(1, 8)})), "VIDEO_SIZE_INVALID");
  EXPECT_EQ(Reason(Write(Path(), {})), "VIDEO_WITHOUT_PICTURES");
}

TEST_P(VideoWriterKinds, AFullDiskIsSaid) {
  fs::create_symlink("/dev/full", Path());  // a device that takes nothing
  const absl::Status status = Write(Path(), WalkFrames(kWidth, kHeight, 12, 1.5));
  EXPECT_EQ(Reason(status), "OUTPUT_DISK_FULL") << status;
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

INSTANTIATE_TEST_SUITE_P(Kinds, VideoWriterKinds, ::testing::Values(".webm", ".mp4", ".WEBM"),
                         [](const auto& kind) { return std::string(kind.param).substr(1); });

TEST(VideoWriter, OtherNamesAreRefused) {
  const TempDir dir;
  for (const char* name : {"v.avi", "v", "webm", "v.mp4.txt"}) {
    EXPECT_EQ(Reason(Write(dir.path() + "/" + name, {})), "VIDEO_FORMAT_UNKNOWN") << name;
  }
}

}  // namespace
}  // namespace litags
