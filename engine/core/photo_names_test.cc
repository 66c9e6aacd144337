#include "engine/core/photo_names.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "engine/core/error_test_util.h"

namespace litags {
namespace {

TEST(PhotoNames, AWholeNameGoesBeforeAStemOfOnePhoto) {
  const PhotoNames photos({"a.jpg", "a.jpg.jpeg", "b.jpg", "b.png", "c.d.jpg"});
  EXPECT_EQ(photos.Find("a"), "a.jpg");
  EXPECT_EQ(photos.Find("a.jpg"), "a.jpg");
  EXPECT_EQ(photos.Find("b"), "");
  EXPECT_EQ(photos.Find("b.png"), "b.png");
  EXPECT_EQ(photos.Find("c.d"), "c.d.jpg");
  EXPECT_EQ(photos.Find("c"), std::nullopt);
}

TEST(HowNamed, AWholeNameIsCloserThanAStem) {
  const std::set<std::string> keys = {"left_a.jpg", "left_a", "a.jpg", "a", "c.jpg"};
  const auto named = [&](const char* photo) {
    return HowNamed(photo, [&](const std::string& key) { return keys.contains(key); });
  };
  EXPECT_EQ(named("left_a.JPG"), 2);
  EXPECT_EQ(named("a.jpeg"), 1);
  EXPECT_EQ(named("b.jpg"), 0);
  EXPECT_EQ(named("c.jpg"), 0) << "KeysOf has every stem, too";
}

TEST(PhotoNames, ADepthMapIsOfOnePhoto) {
  const PhotoNames photos({"a.jpg", "a.jpg.jpeg", "b.jpg", "b.png"});
  const auto reason = [&](const char* photo, const char* map) {
    return Reason(CheckDepthMapIsOf(photo, map, photos, "f"));
  };
  EXPECT_EQ(reason("a.jpg", "a.npy"), "");
  EXPECT_EQ(reason("a.jpg", "a.jpg.npy"), "");
  EXPECT_EQ(reason("a.jpg.jpeg", "a.jpg.npy"), "DEPTH_MAP_AMBIGUOUS");
  EXPECT_EQ(reason("b.png", "b.png.pfm"), "");
  EXPECT_EQ(reason("b.png", "b.pfm"), "DEPTH_MAP_AMBIGUOUS");
}

}  // namespace
}  // namespace litags
