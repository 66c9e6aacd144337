#include "engine/io/image_io.h"

#include <cmath>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/image_header.h"
#include "engine/io/test_util.h"
#include "engine/io/testing_jpeg.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

double MeanAbsDifference(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) sum += std::abs(a.data[i] - b.data[i]);
  return sum / a.data.size();
}

std::string PngChunk(const std::string& type, const std::string& data) {
  uint32_t crc = 0xFFFFFFFFu;
  for (char c : type + data) {
    crc ^= static_cast<uint8_t>(c);
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
  }
  return Big32(static_cast<uint32_t>(data.size())) + type + data + Big32(~crc);
}

uint32_t Adler32(const std::string& bytes) {
  uint32_t a = 1, b = 0;
  for (const char c : bytes) {
    a = (a + static_cast<uint8_t>(c)) % 65521;
    b = (b + a) % 65521;
  }
  return b << 16 | a;
}

constexpr size_t kPngHeaderEnd = 8 + 25;  // magic and IHDR

TEST(DecodeImage, GivesBackAPngExactly) {
  const ImageU8 image = TestImage(37, 21);
  const std::string png = EncodePng(image).value();
  const absl::StatusOr<ImageU8> back = DecodeImage(png, "images[a.png]");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->width, 37);
  EXPECT_EQ(back->height, 21);
  EXPECT_EQ(back->data, image.data);
}

TEST(DecodeImage, GivesBackAJpegNearly) {
  const ImageU8 image = TestImage(64, 48);
  const absl::StatusOr<ImageU8> back = DecodeImage(EncodeJpeg(image, 95).value(), "f");
  ASSERT_TRUE(back.ok()) << back.status();
  // Quality 95 with halved chroma: measured 4.4 of 255 on this noisy blue; swapped channels
  // give 70.
  EXPECT_LT(MeanAbsDifference(*back, image), 6);
}

TEST(DecodeImage, GreyBecomesThreeEqualChannels) {
  Planes plane(1, 5, 4);
  for (size_t i = 0; i < plane.data.size(); ++i) plane.data[i] = i / 20.0f;
  const ImageU8 image = DecodeImage(EncodePng16(plane).value(), "f").value();
  ASSERT_EQ(image.width, 4);
  for (int i = 0; i < 20; ++i) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(image.data[3 * i + c], 255 * plane.data[i], 0.51);
  }
}

TEST(DecodePhoto, SixteenBitsAreRoundedToTheNearestSample) {
  Planes plane(1, 64, 64);
  for (size_t i = 0; i < plane.data.size(); ++i)
    plane.data[i] = static_cast<float>(16 * i + i % 16);
  const Photo photo = DecodePhoto(EncodePng16(plane, 1).value(), "f").value();
  double sum = 0;
  for (size_t i = 0; i < plane.data.size(); ++i) {
    const double error = photo.data[3 * i] - plane.data[i] / 65535 * kPhotoWhite;
    ASSERT_LE(std::abs(error), 0.501) << i;  // a sample is a 64th of a code
    ASSERT_EQ(photo.data[3 * i], photo.data[3 * i + 2]);
    sum += error;
  }
  EXPECT_NEAR(sum / plane.data.size(), 0, 0.02);  // cut off it would be -0.5
}

TEST(DecodePhoto, SixteenBitsBelowACodeStayApart) {
  Planes plane(1, 1, 64);
  for (int x = 0; x < 64; ++x) plane.data[x] = 4.0f * x;  // of 65535; 257 are a code
  const Photo photo = DecodePhoto(EncodePng16(plane, 1).value(), "f").value();
  for (int x = 1; x < 64; ++x) EXPECT_GT(photo.pixel(x, 0)[0], photo.pixel(x - 1, 0)[0]) << x;
  EXPECT_LT(photo.pixel(63, 0)[0], kPhotoCode);
}

TEST(CodeStep, IsThatOfTheFilesBits) {
  const auto step = [](const std::string& bytes) {
    return CodeStep(ReadImageInfo(bytes, "f").value());
  };
  const Photo photo = PhotoFromU8(TestImage(16, 8));
  EXPECT_EQ(step(EncodeJpeg(TestImage(16, 8)).value()), 1);
  EXPECT_EQ(step(EncodePng(TestImage(16, 8)).value()), 1);
  EXPECT_DOUBLE_EQ(step(EncodePng16(Planes(1, 8, 16)).value()), 1.0 / 257);
  EXPECT_DOUBLE_EQ(step(EncodePng16(photo).value()), 255.0 / 4095);
  const std::string of_bytes = EncodePng16(photo, 8).value();
  EXPECT_EQ(step(of_bytes), 1);
  EXPECT_EQ(SignificantBits(ReadImageInfo(of_bytes, "f").value()), 8);
  EXPECT_EQ(PhotoToU8(DecodePhoto(of_bytes, "f").value()).data, TestImage(16, 8).data);
}

TEST(EncodePng16, WhatLiesBelowBlackStays) {
  Photo photo(64, 4);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    photo.data[i] = static_cast<int16_t>(24 * static_cast<int>(i) - 900);
  }
  photo.data[4] = 0;
  photo.data.back() = kPhotoWhite;
  const std::string png = EncodePng16(photo).value();
  const Photo back = DecodePhoto(png, "f").value();
  const double step = (kPhotoWhite + 900) / 4095.0;
  for (size_t i = 0; i < photo.data.size(); ++i) {
    const int below_white = std::min<int>(photo.data[i], kPhotoWhite);
    ASSERT_NEAR(back.data[i], below_white, step / 2 + 1) << i;
  }
  EXPECT_EQ(back.data[4], 0);
  EXPECT_EQ(back.data.back(), kPhotoWhite);
  // A calibration of another name is of another quantity.
  std::string foreign = png;
  const size_t name = foreign.find("pCALlitags");
  ASSERT_NE(name, std::string::npos);
  foreign.replace(name + 4, 6, "metres");
  EXPECT_GE(ReadPngColors(foreign).least, 0);
  EXPECT_LT(ReadPngColors(png).least, 0);
}

TEST(DecodePhoto, SixteenBitColorsComeInOrder) {
  const std::string row("\0\x10\0\x80\0\xff\xff", 7);  // no filter; red, green, blue
  const std::string zlib = std::string("\x78\x01\x01\x07\0\xf8\xff", 7) + row + Big32(Adler32(row));
  const std::string ihdr = Big32(1) + Big32(1) + std::string("\x10\x02\0\0\0", 5);
  const std::string png = EncodePng(TestImage(1, 1)).value().substr(0, 8) + PngChunk("IHDR", ihdr) +
                          PngChunk("IDAT", zlib) + PngChunk("IEND", "");
  const auto photo = DecodePhoto(png, "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  EXPECT_EQ(photo->data, (std::vector<int16_t>{1024, 8192, kPhotoWhite}));
}

TEST(DecodeImage, RefusesWhatIsNoPhoto) {
  EXPECT_EQ(Reason(DecodeImage("", "images[3.jpg]").status()), "IMAGE_EMPTY");
  const absl::Status text = DecodeImage("GIF89a and so on", "images[3.jpg]").status();
  EXPECT_EQ(text.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Reason(text), "IMAGE_NOT_RECOGNIZED");
  EXPECT_EQ(GetErrorDetail(text)->field, "images[3.jpg]");
  EXPECT_THAT(std::string(text.message()), StartsWith("images[3.jpg]: "));
  EXPECT_THAT(std::string(text.message()), HasSubstr("JPEG"));
  EXPECT_THAT(std::string(text.message()), HasSubstr("PNG"));
}

TEST(DecodeImage, RefusesEveryTruncation) {
  const ImageU8 image = TestImage(40, 24);
  for (const std::string& bytes : {EncodeJpeg(image).value(), EncodePng(image).value(),
                                   EncodeTestJpeg(image, TestJpeg::kProgressive),
                                   EncodeTestJpeg(image, TestJpeg::kScanEach)}) {
    ASSERT_TRUE(DecodeImage(bytes, "f").ok());
    std::set<std::string> reasons;
    const size_t end_mark = bytes.starts_with("\xFF\xD8") ? 2 : 0;
    for (size_t n = 0; n < bytes.size() - end_mark; ++n) {
      const absl::StatusOr<ImageU8> result = DecodeImage(std::string_view(bytes).substr(0, n), "f");
      ASSERT_FALSE(result.ok()) << n << " of " << bytes.size();
      reasons.insert(Reason(result.status()));
    }
    EXPECT_THAT(reasons, testing::UnorderedElementsAre("IMAGE_EMPTY", "IMAGE_NOT_RECOGNIZED",
                                                       "IMAGE_TRUNCATED"));
  }
}

TEST(DecodeImage, AJpegMayLackItsEndMarkIfNothingElseIsMissing) {
  const ImageU8 image = TestImage(40, 24);
  for (const TestJpeg kind : {TestJpeg::kPlain, TestJpeg::kProgressive}) {
    const std::string bytes = EncodeTestJpeg(image, kind);
    for (const size_t missing : {1, 2}) {
      const auto cut = DecodeImage(bytes.substr(0, bytes.size() - missing), "f");
      ASSERT_TRUE(cut.ok()) << cut.status();
      EXPECT_EQ(cut->data, DecodeImage(bytes, "f")->data);
    }
    EXPECT_TRUE(LacksJpegEnd(bytes.substr(0, bytes.size() - 2)));
    // As phones append a video: bytes that look like the start of a scan are none.
    EXPECT_FALSE(LacksJpegEnd(bytes + "ftypmp42\xFF\xDA"));
  }
  // Nothing tells whether the scan that came last was the last.
  const std::string scans = EncodeTestJpeg(image, TestJpeg::kScanEach);
  EXPECT_EQ(Reason(DecodeImage(scans.substr(0, scans.size() - 2), "f").status()),
            "IMAGE_TRUNCATED");
}

// libjpeg reads on at the next marker, too.
TEST(DecodeImage, BytesBetweenSegmentsAreSkipped) {
  std::string jpeg = WithJpegExif(EncodeJpeg(TestImage(40, 24)).value(), ExifBlock(1, true));
  const ImageU8 want = DecodeImage(jpeg, "f").value();
  const size_t end = jpeg.find("\xFF\xDB");  // the quantisation tables
  ASSERT_NE(end, std::string::npos);
  jpeg.insert(end, 2, '\0');
  const absl::StatusOr<ImageU8> image = DecodeImage(jpeg, "f");
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->data, want.data);
}

TEST(DecodeImage, RefusesAShortScanThatPretendsToEnd) {
  const std::string jpeg = EncodeJpeg(TestImage(64, 64)).value();
  for (size_t n = jpeg.size() - 40; n > jpeg.size() / 2; n -= 37) {
    const absl::Status status = DecodeImage(jpeg.substr(0, n) + "\xFF\xD9", "f").status();
    EXPECT_THAT(Reason(status), testing::AnyOf("IMAGE_TRUNCATED", "IMAGE_CORRUPT")) << n;
  }
}

TEST(DecodeImage, NeverCrashesOnCorruption) {
  const ImageU8 image = TestImage(40, 24);
  const ImageLimits limits{.max_pixels = 1 << 20};
  for (const std::string& bytes :
       {WithJpegExif(EncodeJpeg(image).value(), ExifBlock(6, true)), EncodePng(image).value()}) {
    int refused = 0;
    ForEachCorruption(bytes, 2000, [&](const std::string& broken) {
      const absl::StatusOr<ImageU8> result = DecodeImage(broken, "f", limits);
      if (!result.ok()) {
        ++refused;
        EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument);
      } else {
        EXPECT_EQ(result->data.size(), size_t{3} * result->width * result->height);
      }
    });
    EXPECT_GT(refused, 100);
  }
}

TEST(DecodeImage, RefusesBombsByTheirHeader) {
  // 90000 x 90000 in a file of a few hundred bytes.
  const std::string ihdr = Big32(90000) + Big32(90000) + std::string("\x08\x02\0\0\0", 5);
  std::string png = EncodePng(TestImage(8, 8)).value();
  png.replace(8, 25, PngChunk("IHDR", ihdr));
  const absl::Status status = DecodeImage(png, "images[3.png]").status();
  EXPECT_EQ(Reason(status), "IMAGE_TOO_LARGE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("90000x90000"));

  std::string jpeg = EncodeJpeg(TestImage(8, 8)).value();
  const size_t sof = jpeg.find("\xFF\xC0");
  ASSERT_NE(sof, std::string::npos);
  jpeg.replace(sof + 5, 4, "\xFD\xE8\xFD\xE8");  // 65000 x 65000
  EXPECT_EQ(Reason(DecodeImage(jpeg, "f").status()), "IMAGE_TOO_LARGE");
}

TEST(DecodeImage, KeepsEachLimit) {
  const std::string png = EncodePng(TestImage(30, 20)).value();
  EXPECT_TRUE(DecodeImage(png, "f", {.max_pixels = 600}).ok());
  EXPECT_EQ(Reason(DecodeImage(png, "f", {.max_pixels = 599}).status()), "IMAGE_TOO_LARGE");
  EXPECT_TRUE(DecodeImage(png, "f", {.max_side = 30}).ok());
  EXPECT_EQ(Reason(DecodeImage(png, "f", {.max_side = 29}).status()), "IMAGE_TOO_LARGE");
  const int64_t size = static_cast<int64_t>(png.size());
  EXPECT_TRUE(DecodeImage(png, "f", {.max_bytes = size}).ok());
  EXPECT_EQ(Reason(DecodeImage(png, "f", {.max_bytes = size - 1}).status()), "IMAGE_TOO_LARGE");
}

TEST(DecodeImage, RefusesJpegKindsThatCannotBeTrusted) {
  const ImageU8 image = TestImage(16, 16);
  const absl::Status cmyk = DecodeImage(EncodeTestJpeg(image, TestJpeg::kCmyk), "f").status();
  EXPECT_EQ(Reason(cmyk), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(cmyk.message()), HasSubstr("CMYK"));
  const absl::Status scans = DecodeImage(EncodeTestJpeg(image, TestJpeg::kManyScans), "f").status();
  EXPECT_EQ(Reason(scans), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(scans.message()), HasSubstr("scans"));
}

// They are whole: "send the whole file again" would not help.
TEST(DecodeImage, RefusesJpegKindsThatAreNotDecodedByName) {
  const std::string bytes = EncodeTestJpeg(TestImage(16, 16), TestJpeg::kPlain);
  const size_t frame = bytes.find("\xFF\xC0");
  ASSERT_NE(frame, std::string::npos);
  const auto expect = [&](size_t at, char value, const char* name) {
    std::string other = bytes;
    other[frame + at] = value;
    const absl::Status status = DecodeImage(other, "f").status();
    EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
    EXPECT_THAT(std::string(status.message()), HasSubstr(name));
  };
  expect(1, '\xC3', "a lossless JPEG");
  expect(1, '\xF7', "a lossless JPEG");
  expect(1, '\xC5', "a hierarchical JPEG");
  expect(4, 12, "a JPEG of 12 bits");
}

// Where EXIF says the stored first row and first column appear, orientations 1..8.
struct Sides {
  char row0, column0;  // T B L R
};
constexpr Sides kExifSides[9] = {{},         {'T', 'L'}, {'T', 'R'}, {'B', 'R'}, {'B', 'L'},
                                 {'L', 'T'}, {'R', 'T'}, {'R', 'B'}, {'L', 'B'}};

char Opposite(char side) { return side == 'T' ? 'B' : side == 'B' ? 'T' : side == 'L' ? 'R' : 'L'; }

// A pixel well inside the corner between two sides.
const uint8_t* CornerPixel(const ImageU8& image, char a, char b) {
  const bool right = a == 'R' || b == 'R', bottom = a == 'B' || b == 'B';
  return image.pixel(right ? image.width - 4 : 3, bottom ? image.height - 4 : 3);
}

TEST(DecodeImage, TurnsPhotosUpright) {
  // Stored: red top left, green top right, blue bottom left, black bottom right.
  ImageU8 stored(48, 32);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 48; ++x) {
      const bool top = y < 16, left = x < 24;
      stored.pixel(x, y)[0] = top && left ? 255 : 0;
      stored.pixel(x, y)[1] = top && !left ? 255 : 0;
      stored.pixel(x, y)[2] = !top && left ? 255 : 0;
    }
  }
  const std::string jpeg = EncodeJpeg(stored).value(), png = EncodePng(stored).value();
  for (int orientation = 1; orientation <= 8; ++orientation) {
    for (bool little : {false, true}) {
      const std::string tiff = ExifBlock(orientation, little);
      const std::string with_exif =
          png.substr(0, kPngHeaderEnd) + PngChunk("eXIf", tiff) + png.substr(kPngHeaderEnd);
      for (const std::string& bytes : {WithJpegExif(jpeg, tiff), with_exif}) {
        const ImageU8 image = DecodeImage(bytes, "f").value();
        const ImageInfo info = ReadImageInfo(bytes, "f").value();
        EXPECT_EQ(info.orientation, orientation);
        EXPECT_EQ(info.width, image.width);
        EXPECT_EQ(info.height, image.height);
        EXPECT_EQ(image.width, orientation >= 5 ? 32 : 48);
        const auto [row0, column0] = kExifSides[orientation];
        EXPECT_GT(CornerPixel(image, row0, column0)[0], 200) << orientation;
        EXPECT_GT(CornerPixel(image, row0, Opposite(column0))[1], 200) << orientation;
        EXPECT_GT(CornerPixel(image, Opposite(row0), column0)[2], 200) << orientation;
      }
    }
  }
}

TEST(DecodeImage, IgnoresBrokenExif) {
  const std::string jpeg = EncodeJpeg(TestImage(16, 8)).value();
  for (int orientation : {0, 9, 65535}) {
    EXPECT_EQ(DecodeImage(WithJpegExif(jpeg, ExifBlock(orientation, true)), "f")->width, 16);
  }
  std::string far = ExifBlock(6, true);
  far.replace(4, 4, "\xF0\xFF\xFF\xFF");  // directory beyond the block
  EXPECT_EQ(DecodeImage(WithJpegExif(jpeg, far), "f")->width, 16);
  for (size_t n = 0; n < 20; ++n) {
    EXPECT_TRUE(DecodeImage(WithJpegExif(jpeg, ExifBlock(6, true).substr(0, n)), "f").ok()) << n;
  }
}

TEST(Encode, RefusesAnEmptyImage) {
  EXPECT_EQ(Reason(EncodePng(ImageU8()).status()), "IMAGE_EMPTY");
  EXPECT_EQ(Reason(EncodeJpeg(ImageU8()).status()), "IMAGE_EMPTY");
  EXPECT_EQ(Reason(EncodePng16(Planes()).status()), "IMAGE_EMPTY");
  EXPECT_EQ(Reason(EncodePng16(Planes(3, 8, 8)).status()), "COUNT_MISMATCH");
}

TEST(ReadImage, ReadsWhatWasWritten) {
  TempDir dir;
  const ImageU8 image = TestImage(20, 10);
  ASSERT_TRUE(WritePng(dir / "a.png", image).ok());
  EXPECT_EQ(ReadImage(dir / "a.png", "f")->data, image.data);
  ASSERT_TRUE(WriteJpeg(dir / "a.jpg", image, 90).ok());
  EXPECT_EQ(ReadImageSize(dir / "a.jpg", "f")->width, 20);
  EXPECT_EQ(ReadImage(dir / "b.png", "f").status().code(), absl::StatusCode::kNotFound);
}

TEST(ListPhotos, ListsPhotosSortedByName) {
  TempDir dir;
  for (const char* name :
       {"b.JPG", "a.png", "c.jpeg", "D.HEIC", "e.dng", "notes.txt", ".hidden.jpg", ".jpg", "jpg"}) {
    std::ofstream(dir / name) << "x";
  }
  std::filesystem::create_directory(dir / "folder.jpg");
  EXPECT_THAT(ListPhotos(dir.path(), "images").value(),
              testing::ElementsAre("D.HEIC", "a.png", "b.JPG", "c.jpeg", "e.dng"));
}

TEST(ListPhotos, RefusesMissingAndEmptyFolders) {
  TempDir dir;
  EXPECT_EQ(Reason(ListPhotos(dir.path(), "images").status()), "NO_PHOTOS");
  const absl::Status missing = ListPhotos(dir / "none", "images").status();
  EXPECT_EQ(Reason(missing), "NO_SUCH_FOLDER");
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
}

TEST(ListPhotos, SaysWhichPicturesAreNotRead) {
  TempDir dir;
  EXPECT_EQ(DescribeOtherPictures(dir.path(), "images").value(), "");
  for (const char* name : {"b.BMP", "a.exr", "notes.txt"}) std::ofstream(dir / name) << "x";
  const std::string want =
      "2 pictures are of a kind that is not read, a.exr for one: convert to JPEG or PNG";
  EXPECT_EQ(DescribeOtherPictures(dir.path(), "images").value(), want);
  const absl::Status none = ListPhotos(dir.path(), "images").status();
  EXPECT_EQ(Reason(none), "NO_PHOTOS");
  EXPECT_THAT(std::string(none.message()), HasSubstr(want));
}

TEST(ResizeArea, AveragesWhatItShrinks) {
  ImageU8 image(4, 2);
  for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<uint8_t>(10 * i);
  const ImageU8 half = ResizeArea(image, 2, 1);
  ASSERT_EQ(half.data.size(), 6u);
  for (int x = 0; x < 2; ++x) {
    for (int c = 0; c < 3; ++c) {
      const double mean = (image.pixel(2 * x, 0)[c] + image.pixel(2 * x + 1, 0)[c] +
                           image.pixel(2 * x, 1)[c] + image.pixel(2 * x + 1, 1)[c]) /
                          4.0;
      EXPECT_NEAR(half.pixel(x, 0)[c], mean, 0.51);
    }
  }
  EXPECT_EQ(ResizeArea(image, 4, 2).data, image.data);
}

TEST(ResizeArea, PhotosAreAveragedInLinearLight) {
  Photo photo(4, 2);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = static_cast<int16_t>(600 * i);
  const Photo half = ResizeArea(photo, 2, 1);
  ASSERT_EQ(half.data.size(), 6u);
  for (int x = 0; x < 2; ++x) {
    for (int c = 0; c < 3; ++c) {
      double light = 0;
      for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
        light += LinearFromSrgb(EncodedOf(photo.pixel(2 * x + u, v)[c])) / 4;
      }
      EXPECT_NEAR(half.pixel(x, 0)[c], kPhotoWhite * SrgbFromLinear(light), 0.7);
    }
  }
  EXPECT_EQ(ResizeArea(photo, 4, 2).data, photo.data);
}

TEST(ResizeArea, NoiseAroundBlackAveragesOut) {
  Photo photo(64, 64);
  const CounterRng rng(4, 0);
  for (size_t i = 0; i < photo.data.size(); i += 2) {
    photo.data[i] = PhotoSample(rng.Normal(i) / 255);
    photo.data[i + 1] = -photo.data[i];
  }
  for (const int16_t sample : ResizeArea(photo, 1, 1).data) EXPECT_NEAR(sample, 0, 8);
  // Cut off at black it would be the mean of half a normal distribution: 0.4 codes.
  for (int16_t& sample : photo.data) sample = std::max<int16_t>(sample, 0);
  for (const int16_t sample : ResizeArea(photo, 1, 1).data) EXPECT_GT(sample, 0.3 * kPhotoCode);
}

TEST(RealPhotos, DecodeAtTheirSize) {
  const std::string scenes = SharedScenes();
  if (scenes.empty()) GTEST_SKIP() << "no shared/scenes beside the source tree";
  for (const char* light : {"low", "high", "over_exp"}) {
    const std::string dir = scenes + "/castle/" + light;
    const auto names = ListPhotos(dir, "images");
    ASSERT_TRUE(names.ok()) << names.status();
    EXPECT_EQ(names->size(), 11u);
    for (const std::string& name : *names) {
      const auto image = ReadImage(dir + "/" + name, name);
      ASSERT_TRUE(image.ok()) << image.status();
      EXPECT_EQ(image->width, 480);
      EXPECT_EQ(image->height, 361);
    }
  }
}

}  // namespace
}  // namespace litags
