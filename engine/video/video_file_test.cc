#include "engine/video/video_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavutil/mem.h>
}

#include <cmath>

#include "engine/core/error_test_util.h"
#include "engine/io/test_util.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr int kWidth = 96, kHeight = 64;

// A picture of one colour.
ImageU8 Flat(int r, int g, int b) {
  ImageU8 image(kWidth, kHeight);
  for (size_t i = 0; i < image.pixels(); ++i) {
    image.data[3 * i] = static_cast<uint8_t>(r);
    image.data[3 * i + 1] = static_cast<uint8_t>(g);
    image.data[3 * i + 2] = static_cast<uint8_t>(b);
  }
  return image;
}

// Dark, with a white square in the top left corner: shows which way it stands.
ImageU8 Corner() {
  ImageU8 image = Flat(30, 30, 30);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) std::fill_n(image.pixel(x, y), 3, uint8_t{230});
  }
  return image;
}

std::string Video(const ImageU8& picture, const TestVideo& options = {}) {
  return EncodeVideo(std::vector<ImageU8>(5, picture), options);
}

absl::Status StatusOf(const std::string& bytes, const VideoLimits& limits = {}) {
  const auto file = VideoFile::Open(bytes, "videos[v]", limits);
  if (!file.ok()) return file.status();
  for (;;) {
    const auto more = (*file)->Next();
    if (!more.ok() || !*more) return more.status();
  }
}

struct FrameCounts {
  int whole = 0;
  int64_t damaged = 0;
};

FrameCounts CountFrames(const std::string& bytes) {
  const auto file = VideoFile::Open(bytes, "videos[v]");
  EXPECT_TRUE(file.ok()) << file.status();
  FrameCounts counts;
  if (!file.ok()) return counts;
  while ((*file)->Next().value_or(false)) ++counts.whole;
  counts.damaged = (*file)->DamagedFrames();
  return counts;
}

Photo FirstPicture(const std::string& bytes) {
  const auto file = VideoFile::Open(bytes, "videos[v]");
  EXPECT_TRUE(file.ok()) << file.status();
  if (!file.ok()) return {};
  EXPECT_TRUE((*file)->Next().value_or(false));
  const Photo photo = (*file)->Picture();
  EXPECT_EQ(photo.width, (*file)->info().width);
  EXPECT_EQ(photo.height, (*file)->info().height);
  return photo;
}

void ExpectCodes(const Photo& photo, int x, int y, const std::array<double, 3>& codes,
                 double tolerance) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(photo.pixel(x, y)[c] / double(kPhotoCode), codes[c], tolerance) << c;
  }
}

struct Kind {
  const char* name;
  TestVideo options;
};

class Kinds : public testing::TestWithParam<Kind> {};

TEST_P(Kinds, AreReadToTheirLastFrameWithTheirColours) {
  const std::string bytes = Video(Flat(90, 60, 40), GetParam().options);
  if (bytes.empty()) GTEST_SKIP() << "this FFmpeg does not write it";
  EXPECT_TRUE(IsVideo(bytes));
  const auto file = VideoFile::Open(bytes, "videos[v]");
  ASSERT_TRUE(file.ok()) << file.status();
  int frames = 0;
  while (*(*file)->Next()) {
    EXPECT_NEAR((*file)->Seconds(), frames / 30.0, 0.02);
    ++frames;
  }
  EXPECT_EQ(frames, 5);
  // The codecs lose a little; an exchanged matrix or range is 6 codes and more.
  ExpectCodes(FirstPicture(bytes), 40, 30, {90, 60, 40}, 2);
  EXPECT_EQ(CheckVideo(bytes, "videos[v]").status(), absl::OkStatus());
}

TestVideo Of(const char* container, const char* codec, const char* pixels = "yuv420p") {
  TestVideo options;
  options.container = container;
  options.codec = codec;
  options.pixels = pixels;
  return options;
}

TestVideo With(TestVideo options, bool TestVideo::*what) {
  options.*what = true;
  return options;
}

INSTANTIATE_TEST_SUITE_P(
    Formats, Kinds,
    testing::Values(
        Kind{"H264InMov", Of("mov", "libx264")}, Kind{"H264InMp4", Of("mp4", "libx264")},
        Kind{"H264InFragments", With(Of("mp4", "libx264"), &TestVideo::contents_first)},
        Kind{"H264InMatroska", Of("matroska", "libx264")},
        Kind{"H264InMpegTs", Of("mpegts", "libx264")},
        Kind{"Bt601", With(Of("mov", "libx264"), &TestVideo::bt601)},
        Kind{"FullRange", With(Of("mov", "libx264"), &TestVideo::full_range)},
        Kind{"H264Of10Bits", Of("mov", "libx264", "yuv420p10le")},
        Kind{"HevcInMov", Of("mov", "libx265")},
        Kind{"HevcOf10Bits", Of("mov", "libx265", "yuv420p10le")},
        Kind{"Av1InMatroska", Of("matroska", "libsvtav1")},
        // These have BT.601, as they say nothing of it.
        Kind{"Vp8InWebm", With(Of("webm", "libvpx"), &TestVideo::bt601)},
        Kind{"Mpeg4InAvi", With(Of("avi", "mpeg4"), &TestVideo::bt601)},
        Kind{"MotionJpegInAvi",
             With(With(Of("avi", "mjpeg", "yuvj420p"), &TestVideo::full_range), &TestVideo::bt601)},
        Kind{"Vp9InWebm", Of("webm", "libvpx-vp9")},
        Kind{"Mpeg2InMpegTs", Of("mpegts", "mpeg2video")},
        Kind{"ProResInMov", Of("mov", "prores_ks", "yuv422p10le")}),
    [](const auto& info) { return info.param.name; });

TEST(VideoFile, StandsUprightAsAPlayerShowsIt) {
  // Where the corner goes by a quarter turn clockwise, each; mirrored, it starts at the right.
  constexpr int kCorners[2][4][2] = {{{4, 4}, {59, 4}, {91, 59}, {4, 91}},
                                     {{91, 4}, {59, 91}, {4, 59}, {4, 4}}};
  for (const bool mirror : {false, true}) {
    for (int quarters = 0; quarters < 4; ++quarters) {
      TestVideo options;
      options.quarters = quarters;
      options.mirror = mirror;
      const Photo photo = FirstPicture(Video(Corner(), options));
      EXPECT_EQ(photo.width, quarters % 2 ? kHeight : kWidth);
      const auto [x, y] = kCorners[mirror][quarters];
      ExpectCodes(photo, x, y, {230, 230, 230}, 3);
    }
  }
}

TEST(VideoFile, SaysWhetherItIsAPanorama) {
  TestVideo options = Of("matroska", "libx264");
  options.sphere = "equirectangular";
  const std::vector<ImageU8> frames(5, ImageU8(128, 64));
  const auto file = VideoFile::Open(EncodeVideo(frames, options), "videos[v]");
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_TRUE((*file)->info().panorama);
  EXPECT_FALSE((*VideoFile::Open(EncodeVideo(frames, {}), "videos[v]"))->info().panorama);
}

TEST(VideoFile, PixelsBecomeSquare) {
  TestVideo options;
  options.aspect_num = 3;
  options.aspect_den = 2;
  const Photo photo = FirstPicture(Video(Corner(), options));
  EXPECT_EQ(photo.width, 144);
  EXPECT_EQ(photo.height, kHeight);
  ExpectCodes(photo, 18, 10, {230, 230, 230}, 3);
  ExpectCodes(photo, 30, 10, {30, 30, 30}, 3);
}

TEST(VideoFile, HlgBecomesTheLightOfTheScene) {
  TestVideo options;
  options.codec = "libx265";
  options.pixels = "yuv420p10le";
  options.bt2020_hlg = true;
  options.quality = "4";
  for (const int code : {60, 120, 180}) {
    const std::string bytes = Video(Flat(code, code, code), options);
    if (bytes.empty()) GTEST_SKIP() << "this FFmpeg has no libx265";
    // ITU-R BT.2100: up to half of the signal the light is its square over 3.
    const double signal = code / 255.0;
    const double light = signal <= 0.5
                             ? signal * signal / 3
                             : (std::exp((signal - 0.55991073) / 0.17883277) + 0.28466892) / 12;
    const double srgb = 255 * SrgbFromLinear(light);
    ExpectCodes(FirstPicture(bytes), 40, 30, {srgb, srgb, srgb}, 1.5);
  }
}

TEST(VideoFile, ColoursBetweenTwoCodesStay) {
  // 8-bit Y'CbCr of another grid than R'G'B': rounding to 8 bits would move most colours.
  const Photo photo = FirstPicture(Video(Flat(17, 17, 17)));
  const int sample = photo.pixel(40, 30)[0];
  EXPECT_NEAR(sample / double(kPhotoCode), 17, 0.7);
  // Y' = 16 + 219/255 * 17 = 30.6, which is stored as 31: 17.47 in 8-bit codes.
  EXPECT_NEAR(sample / double(kPhotoCode), 255 / 219.0 * 15, 0.1);
}

TEST(VideoFile, WhatLiesBelowBlackStays) {
  // Pixels that share their chroma: its mean takes green below black in every second one.
  ImageU8 stripes(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) stripes.pixel(x, y)[x % 2 * 2] = 80;
  }
  TestVideo options;
  options.quality = "1";
  const Photo photo = FirstPicture(Video(stripes, options));
  EXPECT_LT(photo.pixel(41, 30)[1], 0);
  double green = 0;
  for (size_t i = 1; i < photo.data.size(); i += 3) {
    green += photo.data[i] / (kPhotoCode * photo.pixels());
  }
  EXPECT_NEAR(green, 0, 1);  // codes are rounded to 8 bits; cut off at black it would be 3
}

TEST(BadVideo, WhatIsNoVideoIsRefused) {
  EXPECT_EQ(Reason(StatusOf("")), "VIDEO_NOT_RECOGNIZED");
  EXPECT_EQ(Reason(StatusOf("#EXTM3U\nhttp://example.com/a.ts\n")), "VIDEO_NOT_RECOGNIZED");
  for (const char* photo : {"heic", "hevx", "mif2", "crx "}) {
    EXPECT_FALSE(IsVideo(std::string("\0\0\0\x18", 4) + "ftyp" + photo)) << photo;
  }
  EXPECT_EQ(Reason(StatusOf(std::string("\0\0\0\x18"
                                        "ftypmp42",
                                        12))),
            "VIDEO_CORRUPT");
}

TEST(BadVideo, SoundAloneIsRefused) {
  TestVideo options;
  options.with_sound_only = true;
  const absl::Status status = StatusOf(EncodeVideo({}, options));
  EXPECT_EQ(Reason(status), "VIDEO_WITHOUT_PICTURES");
  EXPECT_THAT(std::string(status.message()), HasSubstr("videos[v]: has no pictures"));
}

TEST(BadVideo, OneFrameIsRefused) {
  const absl::Status status = CheckVideo(EncodeVideo({Flat(9, 9, 9)}, {}), "videos[v]").status();
  EXPECT_EQ(Reason(status), "TOO_FEW_FRAMES");
  EXPECT_THAT(std::string(status.message()), HasSubstr("has 1 frame;"));
}

TEST(BadVideo, TwoHoursAreRefusedByWhatTheFileSays) {
  TestVideo options;
  options.frames_per_second = 1;
  options.gap = 1440;  // s; five frames
  const absl::Status status = StatusOf(Video(Flat(9, 9, 9), options));
  EXPECT_EQ(Reason(status), "VIDEO_TOO_LONG");
  EXPECT_THAT(std::string(status.message()), HasSubstr("20 minutes"));
}

TEST(BadVideo, FramesAreCountedWhateverTheFileSays) {
  TestVideo options;
  options.contents_first = true;  // in fragments: the head states no length
  options.container = "mp4";
  const std::string bytes = Video(Flat(9, 9, 9), options);
  EXPECT_EQ(StatusOf(bytes, {.max_frames = 5}), absl::OkStatus());
  EXPECT_EQ(Reason(StatusOf(bytes, {.max_frames = 4})), "VIDEO_TOO_LONG");
  EXPECT_EQ(Reason(StatusOf(bytes, {.max_seconds = 0.1})), "VIDEO_TOO_LONG");
}

TEST(BadVideo, LargeFramesAreRefusedByTheHead) {
  EXPECT_EQ(Reason(StatusOf(Video(Flat(9, 9, 9)), {.max_pixels = kWidth * kHeight - 1})),
            "VIDEO_TOO_LARGE");
  EXPECT_EQ(Reason(StatusOf(Video(Flat(9, 9, 9)), {.max_side = kWidth - 1})), "VIDEO_TOO_LARGE");
  TestVideo stretched;
  stretched.aspect_num = 3;
  EXPECT_EQ(StatusOf(Video(Flat(9, 9, 9)), {.max_side = 2 * kWidth}), absl::OkStatus());
  EXPECT_EQ(Reason(StatusOf(Video(Flat(9, 9, 9), stretched), {.max_side = 2 * kWidth})),
            "VIDEO_TOO_LARGE");
}

TEST(BadVideo, WhatCannotBeShownRightIsRefusedByName) {
  TestVideo pq;
  pq.pq = true;
  // A conversion that keeps PQ's light, or both moments, would not help.
  EXPECT_THAT(std::string(StatusOf(Video(Flat(9, 9, 9), pq)).message()),
              AllOf(HasSubstr("PQ"), HasSubstr("zscale=t=arib-std-b67")));
  TestVideo interlaced;
  interlaced.interlaced = true;
  EXPECT_THAT(std::string(StatusOf(Video(Corner(), interlaced)).message()),
              AllOf(HasSubstr("interlaced"), HasSubstr("-vf bwdif")));
  TestVideo cube = Of("matroska", "libx264");
  cube.sphere = "cubemap";
  EXPECT_THAT(
      std::string(StatusOf(Video(Corner(), cube)).message()),
      AllOf(HasSubstr("360-degree video (cubemap) of 96x64 px"), HasSubstr("twice as wide")));
  const absl::Status codec = StatusOf(Video(Flat(9, 9, 9), Of("avi", "ffv1")));
  EXPECT_EQ(Reason(codec), "VIDEO_UNSUPPORTED");
  EXPECT_THAT(std::string(codec.message()),
              AllOf(HasSubstr("ffv1"), HasSubstr("IN -pix_fmt yuv420p OUT.mp4")));
}

TEST(BadVideo, TruncatedOnesAreRefusedOrGiveTheFramesThatCame) {
  const auto frames = WalkFrames(kWidth, kHeight, 60, 1);
  const std::string movie = EncodeVideo(frames, {});
  // Phones write the table of contents last.
  for (const size_t n : {movie.size() / 4, movie.size() / 2, movie.size() - 100}) {
    EXPECT_EQ(Reason(StatusOf(movie.substr(0, n))), "VIDEO_CORRUPT") << n;
  }
  const std::string stream = EncodeVideo(frames, Of("matroska", "libx264"));
  const auto file = VideoFile::Open(std::string_view(stream).substr(0, stream.size() / 2), "v");
  ASSERT_TRUE(file.ok()) << file.status();
  int came = 0;
  while (*(*file)->Next()) ++came;
  EXPECT_GT(came, 10);
  EXPECT_LT(came, 50);
}

// Decoders say so of the frame or of the packet. MP4 tells where each packet lies.
TEST(BadVideo, DamagedFramesArePassedOverAndCounted) {
  for (const TestVideo& options :
       {Of("mov", "libx264"), Of("mov", "mjpeg", "yuvj420p"), Of("mp4", "libsvtav1")}) {
    SCOPED_TRACE(options.codec);
    std::string bytes = EncodeVideo(WalkFrames(kWidth, kHeight, 60, 1), options);
    if (bytes.empty()) continue;  // this FFmpeg does not write it
    EXPECT_EQ(CountFrames(bytes).damaged, 0);
    for (size_t i = bytes.size() / 2; i < bytes.size() * 3 / 5; i += 7) bytes[i] ^= 0x5a;
    const FrameCounts counts = CountFrames(bytes);
    EXPECT_GE(counts.damaged, 3);
    EXPECT_GE(counts.whole, 20);
  }
}

// The file is not damaged, and frames must not be missing without a word. (H.264's decoder says
// that its data are invalid.)
TEST(BadVideo, WithoutMemoryItIsNotCalledDamaged) {
  for (const TestVideo& options :
       {Of("mov", "prores_ks", "yuv422p10le"), With(Of("webm", "libvpx"), &TestVideo::bt601)}) {
    SCOPED_TRACE(options.codec);
    const std::string bytes = Video(Flat(9, 9, 9), options);
    if (bytes.empty()) continue;  // this FFmpeg does not write it
    const auto file = VideoFile::Open(bytes, "videos[v]");
    ASSERT_TRUE(file.ok()) << file.status();
    av_max_alloc(1000);
    const absl::StatusOr<bool> next = (*file)->Next();
    EXPECT_EQ(Reason(next.status()), "VIDEO_TOO_COSTLY") << next.status();
    EXPECT_THAT(std::string(next.status().message()),
                HasSubstr("videos[v]: reading it takes more memory than a video may"));
    EXPECT_EQ(StatusOf(bytes), absl::OkStatus());  // Open() sets the limit again
  }
}

TEST(BadVideo, DamagedOnesEndOrGiveFrames) {
  const std::string good = EncodeVideo(WalkFrames(kWidth, kHeight, 8, 1), {});
  ForEachCorruption(good, 200, [](const std::string& bytes) {
    const absl::Status status = StatusOf(bytes);
    EXPECT_TRUE(status.ok() || absl::IsInvalidArgument(status)) << status;
  });
}

}  // namespace
}  // namespace litags
