#include "engine/sample/capture.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"
#include "engine/sample/exposure.h"
#include "gtest/gtest.h"

namespace litags::sample {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string ReadBytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

// Every file under a folder, by its path there.
std::map<std::string, std::string> ReadTree(const fs::path& root) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), root)] = ReadBytes(entry.path());
    }
  }
  return files;
}

CaptureOptions Small() {
  CaptureOptions options;
  options.width = 80;
  options.height = 60;
  options.views = 12;
  options.antialias = 1;
  options.truth = true;
  return options;
}

class Capture : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    // Each case is a process of its own, with a capture of its own; they run side by side.
    root_ = fs::path(testing::TempDir()) / ("litags_sample_capture_" + std::to_string(getpid()));
    fs::remove_all(root_);
    const auto report = WriteCapture(Small(), root_ / "a");
    ASSERT_TRUE(report.ok()) << report.status();
    report_ = *report;
  }
  static void TearDownTestSuite() { fs::remove_all(root_); }

  static ImageU8 Photo(const std::string& folder, const std::string& name) {
    auto image = ReadImage(root_ / "a" / folder / name, name);
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? *image : ImageU8();
  }
  static Json Transforms(const std::string& part) {
    return Json::parse(ReadBytes(root_ / "a" / ("transforms_" + part + ".json")));
  }
  static std::vector<std::string> Names(const Json& transforms) {
    std::vector<std::string> names;
    for (const Json& frame : transforms.at("frames")) {
      names.push_back(fs::path(frame.at("file_path").get<std::string>()).filename());
    }
    return names;
  }

  inline static fs::path root_;
  inline static CaptureReport report_;
};

TEST_F(Capture, SensorDataAreTheSamePhotosWithMoreBits) {
  CaptureOptions options = Small();
  options.raw = true;
  ASSERT_TRUE(WriteCapture(options, root_ / "sensor").ok());
  for (const auto& [path, slack] : {std::pair{"deep/low/0003.PNG", 3}, {"raw/low/0003.DNG", 8}}) {
    const auto photo = ReadPhoto(root_ / "sensor" / path, path);
    ASSERT_TRUE(photo.ok()) << photo.status();
    const ImageU8 jpeg = Photo("low", "0003.JPG");
    double deep = 0, shallow = 0;
    for (size_t i = 0; i < jpeg.data.size(); ++i) {
      deep += photo->data[i] / kPhotoCode / jpeg.data.size();
      shallow += double(jpeg.data[i]) / jpeg.data.size();
    }
    EXPECT_NEAR(deep, shallow, slack) << path;
  }
  const Json cameras = Json::parse(ReadBytes(root_ / "sensor/raw/transforms_train.json"));
  EXPECT_EQ(cameras.at("frames")[0].at("file_path"), "low/0001.DNG");
  EXPECT_TRUE(fs::exists(root_ / "sensor/raw/high/0001.JPG"));
}

TEST_F(Capture, ALampLightsTheDarkPhotosByDistanceAndAngle) {
  CaptureOptions options = Small();
  options.lamp = true;
  ASSERT_TRUE(WriteCapture(options, root_ / "lamp").ok());
  const std::string name = "0003.JPG";
  EXPECT_EQ(ReadBytes(root_ / "lamp/high" / name), ReadBytes(root_ / "a/high" / name));
  const auto even = ReadPhoto(root_ / "a/clean/0003.png", name);
  const auto lit = ReadPhoto(root_ / "lamp/clean/0003.png", name);
  const auto depth = ReadDepthMap(root_ / "a/depth/0003.pfm", name);
  ASSERT_TRUE(even.ok() && lit.ok() && depth.ok());
  const Camera camera = CaptureViews(options)[2].camera;
  const Planes lamp = LampLight(camera, *depth);
  EXPECT_NEAR(LampLight(camera, Planes(1, 60, 80)).data[0], 0, 0);
  std::vector<double> factors;  // equal but for edges, where depth is of the pixel's centre alone
  const LinearTable& linear = LinearTable::Get();
  for (size_t i = 0; i < lamp.data.size(); ++i) {
    const int16_t a = even->data[3 * i + 1], b = lit->data[3 * i + 1];
    if (a > kPhotoWhite / 100 && b > kPhotoWhite / 100 && b < kPhotoWhite) {
      factors.push_back(linear(b) / linear(a) / lamp.data[i]);
    }
  }
  ASSERT_GT(factors.size(), lamp.data.size() / 2);
  std::sort(factors.begin(), factors.end());
  EXPECT_NEAR(factors[factors.size() / 10] / factors[factors.size() * 9 / 10], 1, 0.05);
  EXPECT_GT(*std::max_element(lamp.data.begin(), lamp.data.end()),
            4 * *std::min_element(lamp.data.begin(), lamp.data.end()));
}

TEST_F(Capture, HasTheBenchmarkLayout) {
  const Json train = Transforms("train");
  EXPECT_EQ(train.at("w"), 80);
  EXPECT_EQ(train.at("h"), 60);
  EXPECT_EQ(train.at("cx"), 40.0);
  EXPECT_EQ(train.at("cy"), 30.0);
  EXPECT_NEAR(train.at("fl_x").get<double>(), 40 / std::tan(31 * M_PI / 180), 1e-9);
  for (const char* key : {"k1", "k2", "p1", "p2"}) EXPECT_EQ(train.at(key), 0.0);
  EXPECT_EQ(train.at("frames")[0].at("file_path"), "low/0001.JPG");
  EXPECT_EQ(Transforms("test"), Transforms("val"));

  // Every 8th of 12 views is a test view, starting at the fifth.
  EXPECT_EQ(Names(Transforms("test")), std::vector<std::string>{"0005.JPG"});
  EXPECT_EQ(Names(train).size(), 11u);
  EXPECT_EQ(Names(train), report_.train);
  for (const char* folder : {"high", "low", "over_exp"}) {
    for (const std::string& name : Names(train)) {
      const ImageU8 photo = Photo(folder, name);
      EXPECT_EQ(photo.width, 80);
      EXPECT_EQ(photo.height, 60);
    }
  }
}

TEST_F(Capture, HitsItsExposures) {
  double high = 0, low = 0, psnr = 0;
  for (int i = 1; i <= 12; ++i) {
    const std::string name = (i < 10 ? "000" : "00") + std::to_string(i) + ".JPG";
    high += MeanLevel(Photo("high", name)) / 12;
    low += MeanLevel(Photo("low", name)) / 12;
    psnr += PhotoPsnr(Photo("over_exp", name), Photo("high", name)) / 12;
  }
  // Solved on a part of the pixels (about 1 %), and stored as JPEG.
  EXPECT_NEAR(high, 0.47, 0.01);
  EXPECT_NEAR(low, 0.045, 0.002);
  EXPECT_NEAR(psnr, 10, 0.3);
  EXPECT_NEAR(report_.low_mean, low, 0.001);
}

TEST_F(Capture, DepthAndCamerasAgreeWithTheRoom) {
  const Json test = Transforms("test");
  const auto depth = ReadDepthMap(root_ / "a/depth/0005.pfm", "depth");
  ASSERT_TRUE(depth.ok()) << depth.status();
  const Json& m = test.at("frames")[0].at("transform_matrix");
  const double f = test.at("fl_x");
  int on_a_plane = 0;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      // OpenGL axes: y up, z backward.
      const double d = depth->at(0, y, x);
      const std::array<double, 4> cam = {(x + 0.5 - 40) / f * d, -(y + 0.5 - 30) / f * d, -d, 1};
      std::array<double, 3> p = {0, 0, 0};
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 4; ++c) p[r] += m[r][c].get<double>() * cam[c];
      }
      constexpr double kTolerance = 1e-5;  // float depth of some metres
      ASSERT_LE(std::abs(p[0]), 2.5 + kTolerance);
      ASSERT_LE(std::abs(p[1] + 0.2), 2.3 + kTolerance);
      ASSERT_LE(std::abs(p[2] - 1.3), 1.3 + kTolerance);
      const auto at = [&](int axis, double value) {
        return std::abs(p[axis] - value) < kTolerance;
      };
      // Floor, rug, table top, back wall, right wall.
      on_a_plane += at(2, 0) || at(2, 0.012) || at(2, 0.76) || at(1, 2.1) || at(0, 2.5);
    }
  }
  EXPECT_GT(on_a_plane, 80 * 60 / 2);
}

TEST_F(Capture, CleanIsTheLowPhotoWithoutItsNoise) {
  const ImageU8 low = Photo("low", "0003.JPG");
  const std::string clean = ReadFile(root_ / "a/clean/0003.png", "clean", 1 << 20).value();
  double bias = 0, square = 0;
  const auto add = [&](const PngShape& shape, int y, const uint16_t* codes) {
    ASSERT_EQ(shape.white, 65535);
    for (int i = 0; i < 3 * low.width; ++i) {
      const double d = low.pixel(0, y)[i] - codes[i] / 257.0;
      bias += d / low.data.size();
      square += d * d / low.data.size();
    }
  };
  ASSERT_TRUE(ReadPngCodes(clean, PngChannels::kColor, "clean", add).ok());
  EXPECT_LT(std::abs(bias), 0.7);     // codes; the sRGB curve bends the noise's mean a little
  EXPECT_GT(std::sqrt(square), 1.0);  // there is noise,
  EXPECT_LT(std::sqrt(square), 6.0);  // and nothing but noise
}

TEST_F(Capture, HasTheSameBytesForTheSameSeedWhateverTheThreads) {
  CaptureOptions options = Small();
  options.threads = 3;
  ASSERT_TRUE(WriteCapture(options, root_ / "b").ok());
  const auto a = ReadTree(root_ / "a"), b = ReadTree(root_ / "b");
  EXPECT_EQ(a.size(), 12u * 5 + 4 + 1);  // the marker of own folders, too
  EXPECT_TRUE(a == b);

  options.seed = 1;
  ASSERT_TRUE(WriteCapture(options, root_ / "c").ok());
  EXPECT_NE(ReadTree(root_ / "c").at("low/0001.JPG"), a.at("low/0001.JPG"));
}

TEST_F(Capture, AnotherNoiseSeedChangesTheNoiseAlone) {
  CaptureOptions options = Small();
  options.noise_seed = 1;
  ASSERT_TRUE(WriteCapture(options, root_ / "d").ok());
  const auto a = ReadTree(root_ / "a"), d = ReadTree(root_ / "d");
  EXPECT_NE(d.at("low/0001.JPG"), a.at("low/0001.JPG"));
  EXPECT_NE(d.at("over_exp/0001.JPG"), a.at("over_exp/0001.JPG"));
  EXPECT_EQ(d.at("high/0001.JPG"), a.at("high/0001.JPG"));
  EXPECT_EQ(d.at("transforms_train.json"), a.at("transforms_train.json"));
}

TEST(CaptureOptions, NamesTheBadOption) {
  const auto field = [](auto change) {
    CaptureOptions options;
    change(options);
    const auto detail = GetErrorDetail(options.Validate());
    return detail ? detail->field : "none";
  };
  EXPECT_EQ(field([](CaptureOptions&) {}), "none");
  EXPECT_EQ(field([](CaptureOptions& o) { o.width = 0; }), "width");
  EXPECT_EQ(field([](CaptureOptions& o) { o.views = 4; }), "views");
  EXPECT_EQ(field([](CaptureOptions& o) { o.test_every = 1; }), "test_every");
  EXPECT_EQ(field([](CaptureOptions& o) { o.low_mean = std::nan(""); }), "low_mean");
  EXPECT_EQ(field([](CaptureOptions& o) { o.sensor.adc_black = 4000; }), "sensor.adc_black");
}

TEST(WriteCapture, SaysWhereItCannotWrite) {
  const absl::Status status = WriteCapture(Small(), "/proc/nowhere").status();
  EXPECT_EQ(GetErrorDetail(status)->reason, "FOLDER_NOT_WRITABLE");
}

TEST_F(Capture, TakesThePlaceOfTheLastOneAndLeavesOtherFiles) {
  CaptureOptions more = Small();
  more.width = more.height = 32;
  more.views = 14;
  more.raw = true;
  ASSERT_TRUE(WriteCapture(more, root_ / "again").ok());
  ASSERT_TRUE(WriteFileAtomically(root_ / "again/notes.txt", "mine").ok());
  ASSERT_TRUE(WriteCapture(Small(), root_ / "again").ok());
  auto again = ReadTree(root_ / "again");
  EXPECT_EQ(again["notes.txt"], "mine");
  again.erase("notes.txt");
  EXPECT_TRUE(again == ReadTree(root_ / "a"));
}

TEST(WriteCapture, LeavesFilesThatItDidNotWrite) {
  const TempDir dir;
  fs::create_directory(dir / "low");
  ASSERT_TRUE(WriteFileAtomically(dir / "low/0001.JPG", "mine").ok());
  const absl::Status status = WriteCapture(Small(), dir.path()).status();
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(GetErrorDetail(status)->reason, "FOLDER_NOT_OURS") << status;
  EXPECT_EQ(ReadTree(dir.path()).size(), 1u);
  EXPECT_EQ(ReadBytes(dir / "low/0001.JPG"), "mine");
}

}  // namespace
}  // namespace litags::sample
