#include "engine/export/point_cloud.h"

#include <gtest/gtest.h>

#include <string>

#include "engine/export/export_test_util.h"

namespace litags {
namespace {

const PointCloud kPoints = {{{3500000.123456, 5400000.5, 312.25}, {0, 128, 255}},
                            {{3500010.5, 5400003.75, 300.0}, {255, 7, 1}},
                            {{3500004.0, 5400000.0, 301.5}, {9, 9, 9}}};

TEST(PointCloud, LasHoldsCoordinatesOfAMap) {
  const std::string las = EncodeLas(kPoints);
  EXPECT_EQ(las.substr(0, 4), "LASF");
  EXPECT_EQ(NumberAt<uint8_t>(las, 24), 1);
  EXPECT_EQ(NumberAt<uint8_t>(las, 25), 2);
  EXPECT_EQ(NumberAt<uint16_t>(las, 94), 227);
  EXPECT_EQ(NumberAt<uint32_t>(las, 96), 227u);
  EXPECT_EQ(NumberAt<uint8_t>(las, 104), 2);
  EXPECT_EQ(NumberAt<uint16_t>(las, 105), 26);
  EXPECT_EQ(NumberAt<uint32_t>(las, 107), 3u);
  ASSERT_EQ(las.size(), 227 + 3 * 26u);
  for (int k = 0; k < 3; ++k) {
    const double scale = NumberAt<double>(las, 131 + 8 * k),
                 offset = NumberAt<double>(las, 155 + 8 * k);
    EXPECT_LT(scale, 1.1e-7);
    for (size_t i = 0; i < 3; ++i) {
      const double x = offset + scale * NumberAt<int32_t>(las, 227 + 26 * i + 4 * k);
      EXPECT_NEAR(x, kPoints[i].xyz[k], 1e-7);
      EXPECT_EQ(NumberAt<uint16_t>(las, 227 + 26 * i + 20 + 2 * k), 257 * kPoints[i].rgb[k]);
    }
  }
  EXPECT_EQ(NumberAt<double>(las, 179), 3500010.5);       // largest x
  EXPECT_EQ(NumberAt<double>(las, 187), 3500000.123456);  // smallest x
  EXPECT_EQ(NumberAt<double>(las, 219), 300.0);           // smallest z
}

TEST(PointCloud, OnePointHasAScaleToo) {
  const std::string las = EncodeLas({kPoints[0]});
  EXPECT_GT(NumberAt<double>(las, 131), 0);
  EXPECT_EQ(NumberAt<double>(las, 155), kPoints[0].xyz[0]);
  EXPECT_EQ(NumberAt<int32_t>(las, 227), 0);
}

TEST(PointCloud, PlyHoldsDoubles) {
  const std::string ply = EncodePointsPly(kPoints);
  const size_t body = ply.find("end_header\n") + 11;
  EXPECT_NE(ply.find("element vertex 3\n"), std::string::npos);
  ASSERT_EQ(ply.size(), body + 3 * 27);
  EXPECT_EQ(NumberAt<double>(ply, body), kPoints[0].xyz[0]);
  EXPECT_EQ(NumberAt<uint8_t>(ply, body + 27 + 24), 255);
}

}  // namespace
}  // namespace litags
