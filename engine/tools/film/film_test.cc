#include "engine/tools/film/film.h"

#include <gtest/gtest.h>

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/video/testing_video.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

std::string Picture(const ImageU8& image) {
  Photo photo(image.width, image.height);
  for (size_t i = 0; i < image.data.size(); ++i) {
    photo.data[i] = PhotoSample(static_cast<float>(image.data[i]) * (1.0f / 255));
  }
  const std::string png = EncodePng16(photo).value();
  return absl::StrCat(png.size(), "\n", png);
}

std::string Pictures(int count) {
  std::string all;
  for (const ImageU8& image : WalkFrames(48, 32, count, 1)) all += Picture(image);
  return all;
}

absl::Status Film(const std::string& input, const std::string& path, std::string* said = nullptr) {
  std::FILE* file = std::tmpfile();
  std::fwrite(input.data(), 1, input.size(), file);
  std::rewind(file);
  std::FILE* out = std::tmpfile();
  const absl::Status status = WriteFilm(file, out, std::fopen(path.c_str(), "wb"), path, 30);
  char line[16] = "";
  std::rewind(out);
  if (std::fgets(line, sizeof(line), out) != nullptr && said != nullptr) *said = line;
  std::fclose(out);
  std::fclose(file);
  return status;
}

TEST(Film, EachPictureIsAFrame) {
  const TempDir dir;
  ASSERT_TRUE(Film(Pictures(5) + "0\n", dir / "v.webm").ok());
  const std::string bytes = ReadFile(dir / "v.webm", "video", 1 << 20).value();
  const auto video = VideoFile::Open(bytes, "video");
  ASSERT_TRUE(video.ok()) << video.status();
  int frames = 0;
  while ((*video)->Next().value_or(false)) ++frames;
  EXPECT_EQ(frames, 5);
  EXPECT_EQ((*video)->info().width, 48);
}

TEST(Film, ItIsReadyUnlessTheVideoCannotBe) {
  const TempDir dir;
  std::string said;
  EXPECT_EQ(Reason(Film("", dir / "v.webm", &said)), "VIDEO_CUT_SHORT");
  EXPECT_EQ(said, "ready\n");
  said.clear();
  EXPECT_EQ(Reason(Film("", dir / "v.avi", &said)), "VIDEO_FORMAT_UNKNOWN");
  EXPECT_EQ(said, "");
}

TEST(Film, OneThatEndsEarlyIsNone) {
  const TempDir dir;
  const std::string whole = Pictures(3);
  for (const size_t length : {whole.size(), whole.size() - 7, size_t{0}}) {
    EXPECT_EQ(Reason(Film(whole.substr(0, length), dir / "v.mp4")), "VIDEO_CUT_SHORT") << length;
  }
}

TEST(Film, WhatIsNoPictureIsRefused) {
  const TempDir dir;
  EXPECT_EQ(Reason(Film("x\n", dir / "v.webm")), "VIDEO_INPUT_INVALID");
  EXPECT_EQ(Reason(Film("99999999999\n", dir / "v.webm")), "VIDEO_INPUT_INVALID");
  EXPECT_EQ(Reason(Film("5\nhello0\n", dir / "v.webm")), "IMAGE_NOT_RECOGNIZED");
  EXPECT_EQ(Reason(Film("0\n", dir / "v.webm")), "VIDEO_WITHOUT_PICTURES");
  EXPECT_EQ(Reason(Film("0\n", dir / "none/v.webm")), "VIDEO_INPUT_INVALID");
}

}  // namespace
}  // namespace litags
