#include "engine/depth/depth_provider.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/npy_test_util.h"
#include "engine/io/sparse_model.h"

namespace litags {
namespace {

class FolderDepth : public testing::Test {
 protected:
  std::string Path(const std::string& file) const { return folder_ / file; }

  absl::StatusOr<std::optional<DepthMap>> Depth(const std::string& name, int width, int height) {
    auto provider = MakeFolderDepthProvider(folder_.path(), &notes_);
    if (!provider.ok()) return provider.status();
    const View view{name, {}};
    const Photo photo(width, height);
    auto maps = (*provider)->Maps({{&view, &photo}}, CancelToken(), [](int, int) {});
    if (!maps.ok()) return maps.status();
    return (*maps)[0];
  }

  // depth = 1 + x + 10 y.
  static Planes Ramp(int width, int height) {
    Planes ramp(1, height, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) ramp.at(0, y, x) = 1.0f + x + 10.0f * y;
    }
    return ramp;
  }

  const TempDir folder_;
  std::vector<std::string> notes_;
};

TEST_F(FolderDepth, AViewWithoutAMapHasNone) {
  const auto depth = Depth("0001.JPG", 8, 6);
  ASSERT_TRUE(depth.ok());
  EXPECT_FALSE(depth->has_value());
}

TEST_F(FolderDepth, AMissingFolderIsAnError) {
  const auto provider = MakeFolderDepthProvider(folder_ / "nowhere");
  EXPECT_EQ(provider.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(GetErrorDetail(provider.status())->field, "depth_dir");
}

TEST_F(FolderDepth, ReadsPfmAndNpyByThePhotosStem) {
  const Planes ramp = Ramp(8, 6);
  ASSERT_TRUE(WritePfm(Path("a.pfm"), ramp).ok());
  ASSERT_TRUE(WriteFileAtomically(Path("b.npy"), NumpyFile("6, 8", ramp.data)).ok());
  for (const char* name : {"a.JPG", "sub/b.png"}) {
    const auto depth = Depth(name, 8, 6);
    ASSERT_TRUE(depth.ok()) << depth.status();
    ASSERT_TRUE(depth->has_value()) << name;
    EXPECT_EQ((*depth)->depth.data, ramp.data);
    EXPECT_TRUE((*depth)->confidence.empty());
  }
}

TEST_F(FolderDepth, PhotosOfOneStemHaveMapsByTheirWholeNames) {
  for (const char* name : {"0001.JPG", "0001.jpeg"}) {
    Planes ramp = Ramp(8, 6);
    ramp.data[0] = name == std::string("0001.JPG") ? 2 : 3;
    ASSERT_TRUE(WritePfm(Path(std::string(name) + ".pfm"), ramp).ok());
  }
  for (const auto& [name, first] : {std::pair("0001.JPG", 2), std::pair("0001.jpeg", 3)}) {
    const auto depth = Depth(name, 8, 6);
    ASSERT_TRUE(depth.ok()) << depth.status();
    ASSERT_TRUE(depth->has_value()) << name;
    EXPECT_EQ((*depth)->depth.data[0], first) << name;
  }
}

TEST_F(FolderDepth, UnknownPixelsGetNoConfidenceAndFiniteDepth) {
  Planes ramp = Ramp(8, 6);
  ramp.at(0, 2, 3) = NAN;
  ramp.at(0, 4, 1) = INFINITY;
  ramp.at(0, 5, 5) = 0;
  ramp.at(0, 5, 6) = std::numeric_limits<float>::max();
  ramp.at(0, 5, 7) = 1e10f;
  ASSERT_TRUE(WritePfm(Path("a.pfm"), ramp).ok());
  const auto depth = Depth("a.jpg", 8, 6);
  ASSERT_TRUE(depth.ok()) << depth.status();
  const DepthMap& map = **depth;
  ASSERT_FALSE(map.confidence.empty());
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) {
      const bool unknown = (y == 2 && x == 3) || (y == 4 && x == 1) || (y == 5 && x >= 5);
      EXPECT_EQ(map.confidence.at(0, y, x), unknown ? 0 : 1);
      EXPECT_EQ(map.depth.at(0, y, x), unknown ? 0 : ramp.at(0, y, x));
    }
  }
}

TEST_F(FolderDepth, AMapOfTwiceTheSizeIsAveraged) {
  Planes big = Ramp(16, 12);
  big.at(0, 0, 0) = 0;  // one of the four pixels under (0, 0) is unknown
  big.at(0, 11, 15) = std::numeric_limits<float>::max();  // and of those under (7, 5)
  ASSERT_TRUE(WritePfm(Path("a.pfm"), big).ok());
  const auto depth = Depth("a.jpg", 8, 6);
  ASSERT_TRUE(depth.ok()) << depth.status();
  const Planes& map = (*depth)->depth;
  ASSERT_EQ(map.width, 8);
  EXPECT_TRUE((*depth)->confidence.empty());  // three of four are known
  EXPECT_NEAR(map.at(0, 0, 0), (2 + 11 + 12) / 3.0, 1e-5);
  EXPECT_NEAR(map.at(0, 5, 7), (115 + 116 + 125) / 3.0, 1e-3);
  EXPECT_NEAR(map.at(0, 2, 3), 1 + 6.5 + 10 * 4.5, 1e-4);
}

// A map of an RGB-D camera has its lens, as its photo had.
TEST_F(FolderDepth, TheLensIsTakenOutOfTheMapAsOutOfThePhoto) {
  View view{"a.jpg", {}};
  Camera& camera = view.camera;
  camera.width = 96, camera.height = 64;
  camera.fx = camera.fy = 60, camera.cx = 48, camera.cy = 32;
  const Photo photo(96, 64);
  ASSERT_TRUE(WritePfm(Path("a.pfm"), Ramp(96, 64)).ok());
  auto provider = MakeFolderDepthProvider(folder_.path());
  ASSERT_TRUE(provider.ok());
  for (const double k1 : {-0.2, 0.2}) {
    const Distortion lens{.k1 = k1};
    const auto maps =
        (*provider)->Maps({{&view, &photo, nullptr, &lens}}, CancelToken(), [](int, int) {});
    ASSERT_TRUE(maps.ok()) << maps.status();
    const DepthMap& map = *maps->front();
    // Pixel (80, 50): where the photo had it.
    const double x = (80.5 - 48) / 60, y = (50.5 - 32) / 60, stretch = 1 + k1 * (x * x + y * y);
    const double column = 60 * x * stretch + 48 - 0.5, row = 60 * y * stretch + 32 - 0.5;
    EXPECT_NEAR(map.depth.at(0, 50, 80), 1 + std::round(column) + 10 * std::round(row), 1e-3);
    // Outward the photo ends before its corners.
    EXPECT_EQ(map.confidence.empty(), k1 < 0);
    if (k1 > 0) {
      EXPECT_EQ(map.confidence.at(0, 0, 0), 0);
    }
  }
}

// Between two surfaces there is no depth to invent.
TEST_F(FolderDepth, ASmallerMapStaysAsItIs) {
  Planes edge(1, 3, 4);
  for (int i = 0; i < 12; ++i) edge.data[i] = i % 4 < 2 ? 1 : 5;
  edge.data[11] = 0;
  ASSERT_TRUE(WritePfm(Path("a.pfm"), edge).ok());
  const auto depth = Depth("a.jpg", 32, 24);
  ASSERT_TRUE(depth.ok()) << depth.status();
  EXPECT_EQ((*depth)->depth.width, 4);
  EXPECT_EQ((*depth)->depth.data, edge.data);
  EXPECT_EQ((*depth)->confidence.at(0, 2, 3), 0);
  DepthMap large;
  ResizeDepth(**depth, 32, 24, 1, &large);
  for (const float z : large.depth.data) EXPECT_TRUE(z == 0 || z == 1 || z == 5) << z;
}

// Of almost the photo's aspect ratio.
TEST_F(FolderDepth, AMapWithMoreColumnsAndFewerRowsLosesColumnsOnly) {
  ASSERT_TRUE(WritePfm(Path("a.pfm"), Ramp(401, 199)).ok());
  const auto depth = Depth("a.jpg", 400, 200);
  ASSERT_TRUE(depth.ok()) << depth.status();
  EXPECT_EQ((*depth)->depth.width, 400);
  EXPECT_EQ((*depth)->depth.height, 199);
}

TEST_F(FolderDepth, AMapThatSaysNothingIsNotUsed) {
  Planes flat(1, 6, 8);
  ASSERT_TRUE(WritePfm(Path("empty.pfm"), flat).ok());
  for (float& d : flat.data) d = 3;
  ASSERT_TRUE(WritePfm(Path("flat.pfm"), flat).ok());
  for (float& d : flat.data) d = NAN;
  ASSERT_TRUE(WritePfm(Path("nan.pfm"), flat).ok());
  for (const std::string stem : {"empty", "flat", "nan"}) {
    notes_.clear();
    const auto depth = Depth(stem + ".jpg", 8, 6);
    ASSERT_TRUE(depth.ok()) << depth.status();
    EXPECT_FALSE(depth->has_value()) << stem;
    ASSERT_EQ(notes_.size(), 1u);
    EXPECT_TRUE(notes_[0].starts_with("1 depth map is not used: depth/" + stem)) << notes_[0];
  }
}

TEST_F(FolderDepth, MapsThatCannotBeUsedAreErrorsThatNameTheFile) {
  ASSERT_TRUE(WritePfm(Path("tall.pfm"), Ramp(6, 8)).ok());
  std::ofstream(Path("junk.png")) << "not an image";
  const auto reason = [&](const std::string& stem, const std::string& file) {
    const auto depth = Depth(stem + ".jpg", 8, 6);
    EXPECT_EQ(depth.status().code(), absl::StatusCode::kInvalidArgument) << stem;
    const auto detail = GetErrorDetail(depth.status());
    if (!detail) return std::string("no detail");
    EXPECT_EQ(detail->field, "depth/" + file);
    return detail->reason;
  };
  EXPECT_EQ(reason("tall", "tall.pfm"), "DEPTH_MAP_SIZE");
  EXPECT_NE(reason("junk", "junk.png"), "no detail");
}

TEST(ResizeDepth, ASlantedSurfaceStaysFlat) {
  DepthMap map{Planes(1, 3, 4), Planes()}, large;
  for (int i = 0; i < 12; ++i) map.depth.data[i] = 5 + 0.1f * (i % 4) + 0.05f * (i / 4);
  ResizeDepth(map, 8, 9, 2, &large);
  EXPECT_TRUE(large.confidence.empty());
  for (int y = 1; y < 8; ++y) {  // beyond the outer centres it is constant
    for (int x = 1; x < 7; ++x) {
      const double expected = 5 + 0.1 * ((x + 0.5) / 2 - 0.5) + 0.05 * ((y + 0.5) / 3 - 0.5);
      EXPECT_NEAR(large.depth.at(0, y, x), expected, 1e-5) << x << " " << y;
    }
  }
}

TEST(ResizeDepth, KeepsEdgesAndUnknownPixels) {
  DepthMap map{Planes(1, 2, 4), Planes(1, 2, 4)};
  map.depth.data = {1, 1.02f, 3, 0, 1, 1.02f, 3, 0};
  map.confidence.data = {1, 1, 0.5f, 0, 1, 1, 0.5f, 0};
  DepthMap large;
  ResizeDepth(map, 8, 4, 1, &large);
  for (int y = 0; y < 4; ++y) {
    EXPECT_EQ(large.depth.at(0, y, 7), 0);
    EXPECT_EQ(large.confidence.at(0, y, 7), 0);
    for (int x = 0; x < 8; ++x) {  // nothing between the two surfaces
      const float z = large.depth.at(0, y, x);
      EXPECT_TRUE(z == 0 || z == 3 || (z >= 1 && z <= 1.02f)) << z;
    }
    EXPECT_GT(large.depth.at(0, y, 2), large.depth.at(0, y, 1));
  }
}

// A wall that is slanted, and things before it.
DepthMap WallAndThings() {
  DepthMap map{Planes(1, 9, 12), Planes(1, 9, 12)};
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      const bool thing = x % 5 < 2 && y > 5;
      map.depth.at(0, y, x) = thing ? 2.0f : 3 + 0.01f * x + 0.1f * y;
      map.confidence.at(0, y, x) = 1;
    }
  }
  map.depth.at(0, 2, 3) = map.confidence.at(0, 2, 3) = 0;
  return map;
}

TEST(ResizeDepth, OfAMapThatHasAnEdgeIsTheSameInAnyUnitAndOffset) {
  DepthMap map = WallAndThings(), large;
  map.edge = EdgeOf(map);
  ResizeDepth(map, 36, 27, 1, &large);
  EXPECT_EQ(large.edge, map.edge);
  for (const auto& [unit, offset] : {std::pair{1000.0f, 0.0f}, {0.5f, 40.0f}, {2.0f, -6.5f}}) {
    SCOPED_TRACE(offset);
    DepthMap other = map, other_large;
    for (size_t i = 0; i < map.depth.data.size(); ++i) {
      if (map.confidence.data[i] > 0) other.depth.data[i] = unit * map.depth.data[i] + offset;
    }
    other.edge = EdgeOf(other);
    ResizeDepth(other, 36, 27, 1, &other_large);
    EXPECT_EQ(other_large.confidence.data, large.confidence.data);
    for (size_t i = 0; i < large.depth.data.size(); ++i) {
      const float z = large.depth.data[i];
      const float expected = large.confidence.data[i] > 0 ? unit * z + offset : 0;
      ASSERT_NEAR(other_large.depth.data[i], expected, 1e-4 * unit) << i;
    }
  }
}

// Nor is what is unknown taken for a surface, of a map whose depths lie around 0.
TEST(ResizeDepth, OfAMapThatHasAnEdgeInventsNoDepth) {
  DepthMap map{Planes(1, 1, 4), Planes(1, 1, 4)}, large;
  map.depth.data = {-0.5f, 0, 0.5f, 9};
  map.confidence.data = {1, 0, 1, 1};
  map.edge = 1;
  ResizeDepth(map, 12, 1, 1, &large);
  for (const float z : large.depth.data) {
    EXPECT_TRUE(z == -0.5f || z == 0 || z == 0.5f || z == 9) << z;
  }
}

TEST(EdgeOf, IsAShareOfWhatTheKnownDepthsSpan) {
  DepthMap map{Planes(1, 1, 101), Planes()};
  for (int i = 0; i <= 100; ++i) map.depth.data[i] = 7 + 2.0f * i;
  EXPECT_FLOAT_EQ(EdgeOf(map), 0.05f * 100);
  map.depth.data[100] = 1e9;  // wild values change nothing
  EXPECT_FLOAT_EQ(EdgeOf(map), 0.05f * 100);
  map.confidence = Planes(1, 1, 101);
  for (int i = 0; i <= 40; ++i) map.confidence.data[i] = 1;
  EXPECT_FLOAT_EQ(EdgeOf(map), 0.05f * 40);
}

}  // namespace
}  // namespace litags
