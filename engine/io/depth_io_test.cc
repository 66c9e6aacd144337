#include "engine/io/depth_io.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/mask_io.h"
#include "engine/io/npy_test_util.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

Planes Ramp(int height, int width) {
  Planes map(1, height, width);
  for (size_t i = 0; i < map.data.size(); ++i) map.data[i] = 0.25f + 0.5f * i;
  return map;
}

TEST(DepthMap, RoundTripsThroughPfmAndNpy) {
  TempDir dir;
  const Planes map = Ramp(5, 3);
  ASSERT_TRUE(WritePfm(dir / "a.pfm", map).ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "a.npy", NumpyFile("1, 5, 3", map.data)).ok());
  for (const char* name : {"a.pfm", "a.npy"}) {
    const auto back = ReadDepthMap(dir / name, "depth[a]");
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->channels, 1);
    EXPECT_EQ(back->height, 5);
    EXPECT_EQ(back->width, 3);
    EXPECT_EQ(back->data, map.data) << name;
    EXPECT_EQ(ReadDepthSize(dir / name, "f")->height, 5) << name;
    EXPECT_EQ(ReadDepthSize(dir / name, "f")->width, 3) << name;
  }
}

TEST(DepthMap, SizesAreThoseOfTheFirstBytes) {
  TempDir dir;
  ASSERT_TRUE(WriteFileAtomically(dir / "a.png", EncodePng16(Ramp(5, 3), 1.0).value()).ok());
  EXPECT_EQ(ReadDepthSize(dir / "a.png", "f")->pixels(), 15);
  ASSERT_TRUE(WriteFileAtomically(dir / "cut.pfm", "Pf\n640 480\n-1.0\n").ok());
  EXPECT_EQ(ReadDepthSize(dir / "cut.pfm", "f")->pixels(), 640 * 480);
}

TEST(DepthMap, TheFirstBytesTellWhatIsNoMap) {
  TempDir dir;
  const auto reason = [&](const std::string& bytes) {
    EXPECT_TRUE(WriteFileAtomically(dir / "a.png", bytes).ok());
    return Reason(ReadDepthSize(dir / "a.png", "f").status());
  };
  EXPECT_EQ(reason("no map"), "DEPTH_NOT_RECOGNIZED");
  EXPECT_EQ(reason(EncodePng(TestImage(8, 8)).value()), "DEPTH_SIZE");
  EXPECT_EQ(reason(EncodeMask(PlaneU8(8, 8)).value()), "DEPTH_BITS");
  EXPECT_EQ(reason(NumpyFile("6,", {1, 2, 3, 4, 5, 6})), "DEPTH_SIZE");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader("<c8", "3, 2"), std::string(48, '\0'))),
            "NPY_UNSUPPORTED");
  EXPECT_EQ(reason("Pf\n2 x\n-1\n"), "DEPTH_CORRUPT");
  EXPECT_EQ(reason("Pf\n30000 30000\n-1\n"), "IMAGE_TOO_LARGE");
}

TEST(DepthMap, ReadsCodesOfA16BitPng) {
  Planes map(1, 2, 3);
  map.data = {0, 1, 256, 65535, 70000, -4};
  const auto back = DecodeDepthMap(EncodePng16(map, 1.0).value(), "f");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_THAT(back->data, testing::ElementsAre(0, 1, 256, 65535, 65535, 0));
}

TEST(DepthMap, PfmRowsRunUpwardsInEitherByteOrder) {
  const std::string little = std::string("Pf\n1 2\n-1.0\n") + std::string("\0\0\x80\x3F", 4) +
                             std::string("\0\0\0\x40", 4);
  const std::string big =
      std::string("Pf\n1 2\n1.0\n") + std::string("\x3F\x80\0\0", 4) + std::string("\x40\0\0\0", 4);
  for (const std::string& bytes : {little, big}) {
    const auto map = DecodeDepthMap(bytes, "f");
    ASSERT_TRUE(map.ok()) << map.status();
    EXPECT_THAT(map->data, testing::ElementsAre(2.0f, 1.0f));
  }
}

TEST(DepthMap, AcceptsNpyWithASingletonAxis) {
  const std::vector<float> values = {1, 2, 3, 4, 5, 6};
  for (const char* shape : {"2, 3", "1, 2, 3", "2, 3, 1"}) {
    const auto map = DecodeDepthMap(NumpyFile(shape, values), "f");
    ASSERT_TRUE(map.ok()) << map.status();
    EXPECT_EQ(map->height, 2);
    EXPECT_EQ(map->width, 3);
    EXPECT_EQ(map->data, values);
  }
  const auto flat = DecodeDepthMap(NumpyFile("6,", values), "f");
  EXPECT_EQ(Reason(flat.status()), "DEPTH_SIZE");
}

TEST(DepthMap, MarksWhatIsNotFiniteAsNaN) {
  Planes map = Ramp(1, 3);
  map.data[0] = std::numeric_limits<float>::infinity();
  const auto back = DecodeDepthMap(EncodePfm(map), "f");
  EXPECT_TRUE(std::isnan(back->data[0]));
  EXPECT_EQ(back->data[1], 0.75f);
  for (float& v : map.data) v = NAN;
  EXPECT_EQ(Reason(DecodeDepthMap(EncodePfm(map), "f").status()), "NOT_FINITE");
}

// Of depth, float's largest, Blender's for the background and int32's largest are no distances.
TEST(DepthMap, MarksWhatIsTooLargeForADepthAsNaN) {
  constexpr float kMost = std::numeric_limits<float>::max();
  for (const float none : {kMost, -kMost, 1e10f, 2147483648.0f, 1.1e9f}) {
    Planes map = Ramp(1, 3);
    map.data[0] = none;
    const auto back = DecodeDepthMap(EncodePfm(map), "f");
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_TRUE(std::isnan(back->data[0])) << none;
    EXPECT_EQ(back->data[1], 0.75f);
    for (float& v : map.data) v = none;
    EXPECT_EQ(Reason(DecodeDepthMap(EncodePfm(map), "f").status()), "NOT_FINITE") << none;
  }
}

// A map may have any unit and offset.
TEST(DepthMap, OtherNumbersAreDepths) {
  Planes map(1, 1, 5);
  map.data = {-1, 10000, 65504, 65535, 1e9f};
  const auto back = DecodeDepthMap(EncodePfm(map), "f");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->data, map.data);
}

TEST(DepthMap, RefusesWhatIsNoMap) {
  const auto reason = [](const std::string& bytes) {
    return Reason(DecodeDepthMap(bytes, "f", {.max_pixels = 1 << 20}).status());
  };
  EXPECT_EQ(reason(""), "DEPTH_NOT_RECOGNIZED");
  EXPECT_EQ(reason(EncodeJpeg(TestImage(8, 8)).value()), "DEPTH_NOT_RECOGNIZED");
  EXPECT_EQ(reason(EncodePng(TestImage(8, 8)).value()), "DEPTH_SIZE");
  EXPECT_EQ(reason(EncodeMask(PlaneU8(8, 8)).value()), "DEPTH_BITS");
  EXPECT_EQ(reason("Pf\n2 2\n-1\nshort"), "DEPTH_TRUNCATED");
  EXPECT_EQ(reason("Pf\n-2 2\n-1\n"), "DEPTH_SIZE");
  EXPECT_EQ(reason("Pf\n2 x\n-1\n"), "DEPTH_CORRUPT");
  EXPECT_EQ(reason("Pf\n30000 30000\n-1\n"), "IMAGE_TOO_LARGE");
}

TEST(DepthMap, RefusesEveryTruncation) {
  const Planes map = Ramp(6, 7);
  const std::string npy = NumpyFile("6, 7", map.data);
  for (const std::string& bytes : {EncodePfm(map), npy, EncodePng16(map, 100).value()}) {
    ASSERT_TRUE(DecodeDepthMap(bytes, "f").ok());
    for (size_t n = 0; n < bytes.size(); ++n) {
      ASSERT_FALSE(DecodeDepthMap(std::string_view(bytes).substr(0, n), "f").ok()) << n;
    }
  }
}

TEST(FindDepthMap, PrefersThePhotosWholeNameAndNpyThenPfmThenPng) {
  TempDir dir;
  EXPECT_EQ(FindDepthMap(dir.path(), "a.jpg"), "");
  for (const char* name : {"a.png", "a.pfm", "a.NPY", "a.npy", "a.jpg.PNG", "a.jpg.npy"}) {
    std::ofstream(dir / name) << "x";
    EXPECT_EQ(FindDepthMap(dir.path(), "a.jpg"), dir / name);
  }
}

}  // namespace
}  // namespace litags
