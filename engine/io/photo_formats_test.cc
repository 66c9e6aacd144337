// Every format but JPEG and PNG, which have tests of their own, and the colours of all.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/io/dng.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"
#include "engine/io/test_util.h"
#include "engine/io/testing_formats.h"
#include "engine/io/testing_jpeg.h"
#include "engine/io/testing_photos.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

// Of libgomp, which LibRaw runs its loops with.
extern "C" void omp_set_num_threads(int);
extern "C" int omp_get_max_threads();

namespace litags {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

constexpr int kWidth = kRampWidth, kHeight = kRampHeight;

double Mean(const Photo& photo, int channel) {
  double sum = 0;
  for (size_t i = channel; i < photo.data.size(); i += 3) sum += photo.data[i];
  return sum / static_cast<double>(photo.pixels());
}

// The same code in all pixels.
DeepImage Flat(std::array<uint16_t, 3> codes, int width = kWidth, int height = kHeight) {
  DeepImage image{width, height, 3, {}};
  for (int i = 0; i < width * height; ++i) {
    image.codes.insert(image.codes.end(), codes.begin(), codes.end());
  }
  return image;
}

class EveryFormat : public testing::TestWithParam<TestFormat> {
 protected:
  std::string Encode(const DeepImage& image, const Extras& extras = {}) const {
    return GetParam().encode(image, extras);
  }
};

INSTANTIATE_TEST_SUITE_P(Formats, EveryFormat, testing::ValuesIn(TestFormats()),
                         [](const auto& info) { return info.param.name; });

TEST_P(EveryFormat, GivesBackItsCodes) {
  const DeepImage image = Ramp();
  const std::string bytes = Encode(image);
  const auto info = ReadImageInfo(bytes, "images[a]");
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->format, GetParam().format);
  EXPECT_EQ(info->width, kWidth);
  EXPECT_EQ(info->height, kHeight);
  const auto photo = DecodePhoto(bytes, "images[a]");
  ASSERT_TRUE(photo.ok()) << photo.status();
  ASSERT_EQ(photo->width, kWidth);
  ASSERT_EQ(photo->height, kHeight);
  double most = 0;
  for (size_t i = 0; i < photo->data.size(); ++i) {
    const double want = image.codes[i] / 65535.0 * kPhotoWhite;
    most = std::max(most, std::abs(photo->data[i] - want) / kPhotoCode);
  }
  EXPECT_LT(most, GetParam().error);
}

TEST_P(EveryFormat, ColorsAreThoseOfItsProfile) {
  const DeepImage image = Flat({65535, 0, 0});
  const auto red =
      DecodePhoto(Encode(image, {.icc = MakeTestProfile(TestProfile::kDisplayP3)}), "");
  ASSERT_TRUE(red.ok()) << red.status();
  // Display P3's red has 1.2249, -0.0420, -0.0196 of sRGB's light.
  const double slack = 8 * kPhotoCode;
  EXPECT_NEAR(Mean(*red, 0), PhotoSample(1.0931f), slack);
  EXPECT_NEAR(Mean(*red, 1), PhotoSample(-0.0420f * 12.92f), slack);
  EXPECT_NEAR(Mean(*red, 2), PhotoSample(-0.0196f * 12.92f), slack);
}

TEST_P(EveryFormat, LinearCodesBecomeEncoded) {
  constexpr uint16_t kCode = 257 * 50;
  const std::string icc = MakeTestProfile(TestProfile::kLinear);
  const auto photo = DecodePhoto(Encode(Flat({kCode, kCode, kCode}), {.icc = icc}), "");
  ASSERT_TRUE(photo.ok()) << photo.status();
  const double want = kPhotoWhite * SrgbFromLinear(50 / 255.0);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(Mean(*photo, c), want, 2 * kPhotoCode);
}

TEST_P(EveryFormat, BrokenProfilesArePassedOver) {
  const DeepImage image = Flat({20000, 10000, 5000});
  const Photo plain = DecodePhoto(Encode(image), "").value();
  std::string broken = MakeTestProfile(TestProfile::kDisplayP3);
  broken.replace(128, 4, "\xFF\xFF\xFF\xFF");  // the number of tags
  // libjxl's encoder refuses it, and its decoder would refuse the file.
  if (GetParam().format == ImageFormat::kJxl) return;
  const auto photo = DecodePhoto(Encode(image, {.icc = broken}), "");
  ASSERT_TRUE(photo.ok()) << photo.status();
  EXPECT_EQ(photo->data, plain.data);
}

TEST_P(EveryFormat, KeepsEachLimitByItsHeader) {
  const std::string bytes = Encode(Ramp());
  const auto reason = [&](const ImageLimits& limits) {
    EXPECT_EQ(ReadImageInfo(bytes, "f", limits).ok(), DecodePhoto(bytes, "f", limits).ok());
    return Reason(ReadImageInfo(bytes, "f", limits).status());
  };
  EXPECT_EQ(reason({.max_pixels = kWidth * kHeight}), "");
  EXPECT_EQ(reason({.max_pixels = kWidth * kHeight - 1}), "IMAGE_TOO_LARGE");
  EXPECT_EQ(reason({.max_side = kWidth - 1}), "IMAGE_TOO_LARGE");
  EXPECT_EQ(reason({.max_bytes = int64_t(bytes.size()) - 1}), "IMAGE_TOO_LARGE");
}

TEST_P(EveryFormat, RefusesTruncations) {
  const std::string bytes = Encode(Ramp());
  for (size_t n = 0; n + 1 < bytes.size(); n += 1 + n / 40) {
    const auto photo = DecodePhoto(bytes.substr(0, n), "images[a]");
    ASSERT_FALSE(photo.ok()) << n << " of " << bytes.size();
    EXPECT_THAT(Reason(photo.status()),
                AnyOf("IMAGE_EMPTY", "IMAGE_NOT_RECOGNIZED", "IMAGE_TRUNCATED", "IMAGE_CORRUPT",
                      "IMAGE_UNSUPPORTED"))
        << n << " of " << bytes.size();
  }
  EXPECT_EQ(Reason(DecodePhoto(bytes.substr(0, bytes.size() - 20), "f").status()),
            "IMAGE_TRUNCATED");
}

TEST_P(EveryFormat, NeverCrashesOnCorruption) {
  const std::string bytes = Encode(Ramp(), {.icc = MakeTestProfile(TestProfile::kDisplayP3)});
  ForEachCorruption(bytes, 300, [&](const std::string& broken) {
    const auto photo = DecodePhoto(broken, "f", {.max_pixels = 1 << 20});
    if (photo.ok()) {
      EXPECT_EQ(photo->data.size(), size_t{3} * photo->width * photo->height);
    } else {
      EXPECT_EQ(photo.status().code(), absl::StatusCode::kInvalidArgument);
    }
  });
}

TEST(Exif, IsReadInFormatsThatCarryIt) {
  const std::string exif = FocalBlock(26, 425, 100);
  for (const TestFormat& format : TestFormats()) {
    if (format.format == ImageFormat::kTiff) continue;  // it is one block of EXIF itself
    const auto info = ReadImageInfo(format.encode(Ramp(), {.exif = exif}), "f");
    ASSERT_TRUE(info.ok()) << format.name << info.status();
    EXPECT_EQ(info->focal_length, 26) << format.name;
  }
}

TEST(Exif, TellsTheExposure) {
  SensorFrame frame = FlatFrame({1000, 1000, 1000});
  frame.exposure_time = 0.125;
  frame.f_number = 1.8;
  frame.iso = 3200;
  frame.focal_length_35mm = 24;
  const std::string dng = EncodeDng(frame);  // whose directories are those of EXIF
  std::vector<std::pair<std::string, std::string>> photos = {
      {"dng", dng},
      {"jpeg", WithJpegExif(EncodeJpeg(TestImage(16, 8)).value(), dng)},
      {"tiff", EncodeTestTiff(Ramp(), {.exposure_time = 0.125, .f_number = 1.8, .iso = 3200})}};
  for (const TestFormat& format : TestFormats()) {
    if (format.format == ImageFormat::kTiff) continue;
    photos.emplace_back(format.name, format.encode(Ramp(), {.exif = dng}));
  }
  for (const auto& [name, bytes] : photos) {
    const auto info = ReadImageInfo(bytes, "f");
    ASSERT_TRUE(info.ok()) << name << info.status();
    EXPECT_NEAR(info->exposure_time, 0.125, 1e-6) << name;
    EXPECT_NEAR(info->f_number, 1.8, 1e-6) << name;
    EXPECT_EQ(info->iso, 3200) << name;
    EXPECT_EQ(info->focal_length, name == "tiff" ? 0 : 24) << name;
    EXPECT_TRUE(DecodePhoto(bytes, "f").ok()) << name;
  }
}

TEST(Webp, RefusesAnimations) {
  std::string bytes = EncodeTestWebp(TestImage(16, 8), {.exif = ExifBlock(1, true)});
  bytes[20] |= 0x02;  // the flags of its first chunk
  const absl::Status status = DecodePhoto(bytes, "f").status();
  EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("animated"));
}

TEST(Webp, IsTurnedUpright) {
  // Some programs write JPEG's prefix there.
  for (const std::string& prefix : {std::string(), std::string("Exif\0\0", 6)}) {
    const auto photo =
        DecodePhoto(EncodeTestWebp(TestImage(16, 8), {.exif = prefix + ExifBlock(6, true)}), "");
    ASSERT_TRUE(photo.ok()) << photo.status();
    EXPECT_EQ(photo->width, 8);
  }
}

TEST(Jxl, ForHdrScreensIsRefused) {
  constexpr int kPq = 16;
  const absl::Status status = DecodePhoto(EncodeTestJxl(Ramp(), 16, {}, 0, kPq), "f").status();
  EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("PQ"));
}

TEST(Jxl, OfHlgIsTheLightOfTheScene) {
  constexpr int kHlg = 18;
  constexpr uint16_t kCode = 257 * 180;
  // ITU-R BT.2100.
  const double light = (std::exp((180 / 255.0 - 0.55991073) / 0.17883277) + 0.28466892) / 12;
  for (const int channels : {1, 3}) {
    DeepImage image = Ramp(channels);
    std::fill(image.codes.begin(), image.codes.end(), kCode);
    const auto photo = DecodePhoto(EncodeTestJxl(image, 16, {}, 0, kHlg), "f");
    ASSERT_TRUE(photo.ok()) << photo.status();
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(Mean(*photo, c), kPhotoWhite * SrgbFromLinear(light), 3) << channels;
    }
  }
}

TEST(Tiff, EveryLayoutGivesTheSame) {
  const DeepImage image = Ramp();
  const Photo want = DecodePhoto(EncodeTestTiff(image, {.bits = 16}), "").value();
  for (const int compression : {1, 5, 8, 32773, 50000}) {
    for (const bool tiled : {false, true}) {
      for (const bool planar : {false, true}) {
        const auto photo = DecodePhoto(
            EncodeTestTiff(
                image, {.bits = 16, .compression = compression, .tiled = tiled, .planar = planar}),
            "f");
        ASSERT_TRUE(photo.ok()) << compression << photo.status();
        EXPECT_EQ(photo->data, want.data) << compression << tiled << planar;
      }
    }
  }
  EXPECT_EQ(DecodePhoto(EncodeTestTiff(image, {.bits = 16, .extra = 1}), "f")->data, want.data);
  EXPECT_EQ(DecodePhoto(EncodeTestTiff(image, {.bits = 16, .big = true}), "f")->data, want.data);
  EXPECT_EQ(DecodePhoto(EncodeTestTiff(image, {.bits = 16, .pages = 3}), "f")->data, want.data);
}

TEST(Tiff, GreyBecomesThreeEqualChannels) {
  const DeepImage grey = Ramp(1);
  const Photo photo = DecodePhoto(EncodeTestTiff(grey, {.bits = 16}), "").value();
  const Photo linear =
      DecodePhoto(
          EncodeTestTiff(grey, {.bits = 16, .icc = MakeTestProfile(TestProfile::kGreyLinear)}), "")
          .value();
  for (size_t i = 0; i < grey.codes.size(); ++i) {
    const double code = grey.codes[i] / 65535.0;
    ASSERT_NEAR(photo.data[3 * i], code * kPhotoWhite, 0.51);
    ASSERT_EQ(photo.data[3 * i], photo.data[3 * i + 2]);
    ASSERT_NEAR(linear.data[3 * i + 1], SrgbFromLinear(code) * kPhotoWhite, 1);
  }
}

// Seven stops under, sixteen linear bits are the 16,384 steps of a photo and more.
TEST(Tiff, LinearCodesStayApartInTheDark) {
  DeepImage image{64, 1, 3, {}};
  for (int x = 0; x < 64; ++x) image.codes.insert(image.codes.end(), 3, uint16_t(4 * x));
  const std::string icc = MakeTestProfile(TestProfile::kLinear);
  const Photo photo = DecodePhoto(EncodeTestTiff(image, {.bits = 16, .icc = icc}), "").value();
  for (int x = 1; x < 64; ++x) {
    EXPECT_GT(photo.pixel(x, 0)[0], photo.pixel(x - 1, 0)[0] + 8) << x;
  }
}

TEST(Tiff, FloatingPointIsLight) {
  const DeepImage image = Ramp();
  const Photo photo = DecodePhoto(EncodeTestTiff(image, {.bits = 32}), "").value();
  for (size_t i = 0; i < image.codes.size(); ++i) {
    ASSERT_NEAR(photo.data[i], kPhotoWhite * SrgbFromLinear(image.codes[i] / 65535.0), 1);
  }
}

TEST(Tiff, HolesOfFloatingPointAreBlack) {
  const DeepImage image = Ramp();
  std::string tiff = EncodeTestTiff(image, {.bits = 32});
  const size_t hole = image.codes.size() / 2;
  const float light = image.codes[hole] / 65535.0f, nothing = std::nanf("");
  const size_t at = tiff.find(std::string(reinterpret_cast<const char*>(&light), sizeof(light)));
  ASSERT_NE(at, std::string::npos);
  std::memcpy(&tiff[at], &nothing, sizeof(nothing));
  const Photo photo = DecodePhoto(tiff, "").value();
  EXPECT_EQ(std::count(photo.data.begin(), photo.data.end(), 0),
            1 + std::count(image.codes.begin(), image.codes.end(), 0));
  EXPECT_GE(*std::min_element(photo.data.begin(), photo.data.end()), 0);
}

// Of a thermal camera, in degrees Celsius.
TEST(Tiff, TemperaturesAreRefusedByName) {
  DeepImage image = Ramp();
  for (uint16_t& code : image.codes) code = static_cast<uint16_t>(12000 + code / 5);
  const std::string tiff = EncodeTestTiff(image, {.bits = 32, .white = 65.535f});
  const absl::Status status = DecodePhoto(tiff, "images[t.tif]").status();
  EXPECT_EQ(Reason(status), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("values from 12 to 2"));
}

TEST(Tiff, IsTurnedUpright) {
  const auto info = ReadImageInfo(EncodeTestTiff(Ramp(), {.orientation = 6}), "f");
  ASSERT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->width, kHeight);
  EXPECT_EQ(info->orientation, 6);
}

TEST(Tiff, RefusesBombsByTheirHeader) {
  std::string tiff = EncodeTestTiff(Ramp(), {.compression = 8});
  // The entries of width and height: tag, type, count, value.
  for (const uint16_t tag : {256, 257}) {
    std::string entry{static_cast<char>(tag), 1, 3, 0, 1, 0, 0, 0};
    const size_t at = tiff.find(entry);
    ASSERT_NE(at, std::string::npos);
    tiff.replace(at + 8, 2, "\xFF\xFF");
  }
  EXPECT_EQ(Reason(DecodePhoto(tiff, "f").status()), "IMAGE_TOO_LARGE");

  // A tile of 1 GiB for each colour of a small picture.
  std::string tiles = EncodeTestTiff(Ramp(), {.bits = 32, .tiled = true, .planar = true});
  for (const char* tag : {"\x42\1", "\x43\1"}) {
    const size_t at = tiles.find(tag + std::string("\3\0\1\0\0\0", 6));
    ASSERT_NE(at, std::string::npos);
    tiles.replace(at + 8, 2, std::string("\0\x40", 2));
  }
  EXPECT_THAT(std::string(DecodePhoto(tiles, "f").status().message()),
              HasSubstr("no possible size"));
}

TEST(Cmyk, IsConvertedByItsProfile) {
  const std::string icc = MakeTestProfile(TestProfile::kCmyk);
  DeepImage image{kWidth, kHeight, 4, {}};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const uint16_t ink[] = {0, 32768, 65535, 0};  // no cyan, half magenta, all yellow
    image.codes.insert(image.codes.end(), ink, ink + 4);
  }
  const auto photo = DecodePhoto(EncodeTestTiff(image, {.icc = icc}), "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  EXPECT_NEAR(Mean(*photo, 0) / kPhotoCode, 255, 3);
  EXPECT_NEAR(Mean(*photo, 1) / kPhotoCode, 127, 3);
  EXPECT_NEAR(Mean(*photo, 2) / kPhotoCode, 0, 3);
  const absl::Status without = DecodePhoto(EncodeTestTiff(image), "f").status();
  EXPECT_EQ(Reason(without), "IMAGE_UNSUPPORTED");
  EXPECT_THAT(std::string(without.message()), HasSubstr("CMYK"));

  // All inks of this JPEG are half, stored the way Adobe does.
  const std::string jpeg = EncodeTestJpeg(TestImage(16, 16), TestJpeg::kCmyk);
  const auto grey = DecodePhoto(WithJpegProfile(jpeg, icc), "f");
  ASSERT_TRUE(grey.ok()) << grey.status();
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(Mean(*grey, c) / kPhotoCode, 64, 3);
}

TEST(Profiles, AreReadFromJpegAndPng) {
  const Photo plain = DecodePhoto(EncodeJpeg(TestImage(16, 16)).value(), "f").value();
  const std::string jpeg = EncodeJpeg(TestImage(16, 16)).value();
  const auto same = DecodePhoto(WithJpegProfile(jpeg, MakeTestProfile(TestProfile::kSrgb)), "f");
  EXPECT_EQ(same->data, plain.data);
  const auto broken = DecodePhoto(WithJpegProfile(jpeg, "no profile at all"), "f");
  EXPECT_EQ(broken->data, plain.data);
  const auto wide =
      DecodePhoto(WithJpegProfile(jpeg, MakeTestProfile(TestProfile::kAdobeRgb)), "f");
  ASSERT_TRUE(wide.ok()) << wide.status();
  const size_t i = 3 * (8 * 16 + 8);  // in the middle
  const auto light = [&](const Photo& photo, size_t c) {
    return LinearFromSrgb(EncodedOf(photo.data[i + c]));
  };
  // Codes to light by the power 2.2, then Adobe RGB's primaries: red = 1.3983 r - 0.3983 g.
  const double r = std::pow(EncodedOf(plain.data[i]), 2.2),
               g = std::pow(EncodedOf(plain.data[i + 1]), 2.2);
  EXPECT_NEAR(light(*wide, 0), 1.3983 * r - 0.3983 * g, 0.003);
  EXPECT_NEAR(light(*wide, 1), g, 0.003);
}

// Cameras that are set to it write no profile.
TEST(Profiles, AdobeRgbIsToldByExif) {
  const std::string jpeg = EncodeJpeg(TestImage(16, 16)).value();
  const std::string icc = MakeTestProfile(TestProfile::kAdobeRgb);
  const Photo want = DecodePhoto(WithJpegProfile(jpeg, icc), "f").value();
  const auto photo = DecodePhoto(WithJpegExif(jpeg, InteroperabilityBlock("R03")), "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  for (size_t i = 0; i < want.data.size(); ++i) {
    ASSERT_NEAR(photo->data[i], want.data[i], 0.5 * kPhotoCode);
  }
  const auto srgb = DecodePhoto(WithJpegExif(jpeg, InteroperabilityBlock("R98")), "f");
  EXPECT_EQ(srgb->data, DecodePhoto(jpeg, "f")->data);
}

TEST(Profiles, CodePointsOfAPngAreFollowed) {
  ImageU8 red(16, 8);
  for (size_t i = 0; i < red.data.size(); i += 3) red.data[i] = 255;
  const std::string png = EncodePng(red).value();
  const auto with = [&](const char* points) {
    return DecodePhoto(WithPngChunk(png, "cICP", std::string(points, 4)), "f");
  };
  const auto p3 = with("\x0C\x0D\0\1");
  ASSERT_TRUE(p3.ok()) << p3.status();
  EXPECT_NEAR(Mean(*p3, 0), PhotoSample(1.0931f), 8 * kPhotoCode);
  EXPECT_NEAR(Mean(*p3, 1), PhotoSample(-0.0420f * 12.92f), 8 * kPhotoCode);
  EXPECT_NEAR(Mean(*p3, 2), PhotoSample(-0.0196f * 12.92f), 8 * kPhotoCode);
  EXPECT_EQ(with("\1\x0D\0\1")->data, DecodePhoto(png, "f")->data);
  for (const char* refused : {"\x09\x10\0\1", "\1\1\0\0"}) {  // PQ, limited range
    EXPECT_EQ(Reason(with(refused).status()), "IMAGE_UNSUPPORTED");
  }
}

TEST(Raw, IsLightWithTheCamerasWhiteBalance) {
  SensorFrame frame = FlatFrame({1000, 2000, 500});
  frame.neutral = {0.5, 1, 0.25};
  const auto photo = DecodePhoto(EncodeDng(frame), "images[a.dng]");
  ASSERT_TRUE(photo.ok()) << photo.status();
  ASSERT_EQ(photo->width, kWidth);
  ASSERT_EQ(photo->height, kHeight);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(Mean(*photo, c), kPhotoWhite * SrgbFromLinear(0.2), 0.5 * kPhotoCode) << c;
  }
}

TEST(Raw, LeavesTheCallersThreadsAlone) {
  const int before = omp_get_max_threads();
  omp_set_num_threads(3);
  const std::string dng = EncodeDng(FlatFrame({1000, 2000, 500}));
  EXPECT_TRUE(DecodePhoto(dng, "f").ok());
  EXPECT_EQ(omp_get_max_threads(), 3);
  omp_set_num_threads(before);
}

TEST(Raw, HasThePrimariesOfItsMatrix) {
  const Photo photo = DecodePhoto(EncodeDng(FlatFrame({4000, 1000, 300})), "f").value();
  EXPECT_NEAR(Mean(photo, 0), kPhotoWhite * SrgbFromLinear(0.4), 2 * kPhotoCode);
  EXPECT_NEAR(Mean(photo, 1), kPhotoWhite * SrgbFromLinear(0.1), 2 * kPhotoCode);
  EXPECT_NEAR(Mean(photo, 2), kPhotoWhite * SrgbFromLinear(0.03), 2 * kPhotoCode);
}

TEST(Raw, ClippedIsWhiteInEveryChannel) {
  SensorFrame frame = FlatFrame({10000, 10000, 10000});
  frame.neutral = {0.5, 1, 0.4};
  const Photo photo = DecodePhoto(EncodeDng(frame), "f").value();
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(Mean(photo, c), kPhotoWhite, 0.5 * kPhotoCode) << c;
}

// The darkest of two photos tells nothing of the other's white.
TEST(Raw, IsNotBrightened) {
  const Photo photo = DecodePhoto(EncodeDng(FlatFrame({10, 10, 10})), "f").value();
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(Mean(photo, c), kPhotoWhite * SrgbFromLinear(0.001), 0.2 * kPhotoCode) << c;
  }
}

TEST(Raw, NoiseAroundBlackIsNotCutOff) {
  SensorFrame frame = FlatFrame({0, 0, 0}, 96, 96);
  const CounterRng rng(3, 0);
  double sum = 0;
  for (size_t i = 0; i < frame.numbers.size(); ++i) {
    const int noise = static_cast<int>(std::lround(40 * rng.Normal(i)));
    frame.numbers[i] = static_cast<uint16_t>(frame.numbers[i] + noise);
    sum += noise;
  }
  const Photo photo = DecodePhoto(EncodeDng(frame), "f").value();
  double light = 0;
  for (const int16_t sample : photo.data) light += LinearTable::Get()(sample);
  // In the sensor's numbers. Cut off at black it would be 40 / sqrt(2 pi) = 16.
  EXPECT_NEAR(light / static_cast<double>(photo.data.size()) * 10000, sum / (96 * 96), 1.5);
  EXPECT_LT(*std::min_element(photo.data.begin(), photo.data.end()), -kPhotoCode);
}

// Phones' RAW has one.
TEST(Raw, AGainMapIsSaid) {
  SensorFrame frame = FlatFrame({1000, 1000, 1000});
  EXPECT_FALSE(ReadImageInfo(EncodeDng(frame), "f")->has_gain_map);
  frame.has_gain_map = true;
  const std::string dng = EncodeDng(frame);
  EXPECT_TRUE(ReadImageInfo(dng, "f")->has_gain_map);
  EXPECT_TRUE(DecodePhoto(dng, "f").ok());
}

TEST(Raw, IsTurnedUpright) {
  SensorFrame frame = FlatFrame({1000, 1000, 1000});
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) frame.numbers[y * kWidth + x] = 512;  // the left is dark
  }
  frame.orientation = 6;  // its left is to be the top
  const Photo photo = DecodePhoto(EncodeDng(frame), "f").value();
  ASSERT_EQ(photo.width, kHeight);
  ASSERT_EQ(photo.height, kWidth);
  EXPECT_LT(photo.pixel(kHeight / 2, 4)[1], kPhotoCode);
  EXPECT_GT(photo.pixel(kHeight / 2, kWidth - 5)[1], 60 * kPhotoCode);
}

TEST(Raw, KeepsLimitsAndRefusesDamage) {
  const std::string dng = EncodeDng(FlatFrame({1000, 2000, 500}));
  EXPECT_EQ(Reason(DecodePhoto(dng, "f", {.max_pixels = 100}).status()), "IMAGE_TOO_LARGE");
  SensorFrame cut = FlatFrame({1000, 2000, 500});
  cut.numbers.resize(cut.numbers.size() / 2);  // the directory follows, the numbers do not
  EXPECT_EQ(Reason(DecodePhoto(EncodeDng(cut), "f").status()), "IMAGE_TRUNCATED");
  for (size_t n = 0; n + 1 < dng.size(); n += 1 + n / 30) {
    EXPECT_FALSE(DecodePhoto(dng.substr(0, n), "images[a]").ok()) << n;
  }
  ForEachCorruption(dng, 300, [&](const std::string& broken) {
    const auto photo = DecodePhoto(broken, "f", {.max_pixels = 1 << 20});
    if (photo.ok()) return;
    EXPECT_EQ(photo.status().code(), absl::StatusCode::kInvalidArgument);
  });
}

TEST(Raw, SaysThatACameraIsNotKnown) {
  const absl::Status status =
      DecodePhoto("FUJIFILMCCD-RAW " + std::string(4000, '7'), "f").status();
  EXPECT_THAT(Reason(status), AnyOf("IMAGE_UNSUPPORTED", "IMAGE_TRUNCATED", "IMAGE_CORRUPT"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("RAW"));
}

}  // namespace
}  // namespace litags
