#include "engine/io/npy.h"

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/npy_test_util.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

TEST(DecodeNpy, ReadsEveryTypeAndBothVersions) {
  for (int version : {1, 2}) {
    const int32_t ints[] = {-5, 7};
    const auto i4 = DecodeNpy(
        NumpyFile(version, NumpyHeader("<i4", "2,"), std::string((const char*)ints, 8)), "f");
    ASSERT_TRUE(i4.ok()) << i4.status();
    EXPECT_THAT(i4->shape, testing::ElementsAre(2));
    EXPECT_THAT(i4->ToDoubles(), testing::ElementsAre(-5, 7));

    const double doubles[] = {0.1, -2};
    const auto f8 = DecodeNpy(
        NumpyFile(version, NumpyHeader("<f8", "1, 2"), std::string((const char*)doubles, 16)), "f");
    EXPECT_THAT(f8->shape, testing::ElementsAre(1, 2));
    EXPECT_THAT(f8->ToDoubles(), testing::ElementsAre(0.1, -2));
    EXPECT_THAT(f8->ToFloats(), testing::ElementsAre(0.1f, -2.0f));

    const int64_t wide[] = {int64_t{1} << 40};
    const auto i8 = DecodeNpy(
        NumpyFile(version, NumpyHeader("<i8", ""), std::string((const char*)wide, 8)), "f");
    EXPECT_TRUE(i8->shape.empty());
    EXPECT_THAT(i8->ToDoubles(), testing::ElementsAre(0x1p40));

    const auto u1 = DecodeNpy(NumpyFile(version, NumpyHeader("|u1", "3,"), "\x01\x80\xFF"), "f");
    EXPECT_THAT(u1->ToFloats(), testing::ElementsAre(1, 128, 255));

    // Depths in mm, as sensors have them.
    const uint16_t codes[] = {0, 1500, 65535};
    const auto u2 = DecodeNpy(
        NumpyFile(version, NumpyHeader("<u2", "3,"), std::string((const char*)codes, 6)), "f");
    ASSERT_TRUE(u2.ok()) << u2.status();
    EXPECT_THAT(u2->ToFloats(), testing::ElementsAre(0, 1500, 65535));

    const uint16_t halves[] = {0x3C00, 0xC100, 0x7BFF, 0x0001, 0x0400, 0x8000, 0xFC00, 0x7E00};
    const auto f2 = DecodeNpy(
        NumpyFile(version, NumpyHeader("<f2", "8,"), std::string((const char*)halves, 16)), "f");
    ASSERT_TRUE(f2.ok()) << f2.status();
    EXPECT_THAT(f2->ToDoubles(), testing::ElementsAre(1, -2.5, 65504, 0x1p-24, 0x1p-14, 0,
                                                      -INFINITY, testing::IsNan()));
    EXPECT_EQ(f2->ToFloats()[1], -2.5f);

    const auto none = DecodeNpy(NumpyFile(version, NumpyHeader("<f4", "0, 3"), ""), "f");
    EXPECT_THAT(none->shape, testing::ElementsAre(0, 3));
    EXPECT_TRUE(none->ToFloats().empty());
  }
}

TEST(DecodeNpy, RefusesWhatItDoesNotKnow) {
  const std::string data(64, '\0');
  const auto reason = [&](const std::string& bytes) {
    return Reason(DecodeNpy(bytes, "f").status());
  };
  EXPECT_EQ(reason("PK\x03\x04"), "NOT_A_NPY");
  EXPECT_EQ(reason(""), "NOT_A_NPY");
  EXPECT_EQ(reason(NumpyFile(3, NumpyHeader("<f4", "1,"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader(">f4", "1,"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader("<c8", "1,"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader("<f4", "2, 2", "True"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader("<f4", "-1,"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, NumpyHeader("<f4", "x"), data)), "NPY_UNSUPPORTED");
  EXPECT_EQ(reason(NumpyFile(1, "{}", data)), "NPY_UNSUPPORTED");
}

TEST(DecodeNpy, RefusesHostileCountsWithoutAllocating) {
  const std::string data(64, '\0');
  for (const char* shape : {"17,", "1000000000000,", "4611686018427387904, 1"}) {
    EXPECT_EQ(Reason(DecodeNpy(NumpyFile(1, NumpyHeader("<f4", shape), data), "f").status()),
              "NPY_TRUNCATED")
        << shape;
  }
  // The product overflows 64 bits.
  EXPECT_EQ(Reason(DecodeNpy(NumpyFile(1, NumpyHeader("<f4", "4294967296, 4294967296"), data), "f")
                       .status()),
            "NPY_UNSUPPORTED");
}

TEST(DecodeNpy, SurvivesTruncationAndCorruption) {
  const std::vector<float> values(24, 1.0f);
  const std::string bytes = NumpyFile("2, 3, 4", values);
  for (size_t n = 0; n < bytes.size(); ++n) {
    ASSERT_FALSE(DecodeNpy(std::string_view(bytes).substr(0, n), "f").ok()) << n;
  }
  int refused = 0;
  ForEachCorruption(bytes.substr(0, 128), 3000, [&](const std::string& front) {
    const auto array = DecodeNpy(front + bytes.substr(128), "f");
    refused += !array.ok();
    if (array.ok()) {
      EXPECT_EQ(array->ToFloats().size(), static_cast<size_t>(array->size()));
    }
  });
  EXPECT_GT(refused, 100);
}

TEST(ReadNpy, ReadsFiles) {
  TempDir dir;
  const std::vector<float> values = {1, 2};
  ASSERT_TRUE(WriteFileAtomically(dir / "a.npy", NumpyFile("2,", values)).ok());
  EXPECT_EQ(ReadNpy(dir / "a.npy", "")->ToFloats(), values);
  EXPECT_EQ(ReadNpy(dir / "b.npy", "").status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace litags
