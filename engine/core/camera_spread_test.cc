#include "engine/core/camera_spread.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace litags {
namespace {

using Places = std::vector<std::array<double, 3>>;

Places Ring(int n) {
  Places places;
  for (int i = 0; i < n; ++i) places.push_back({std::cos(i), std::sin(i), 0.1 * (i % 3)});
  return places;
}

int Count(const std::vector<bool>& far) {
  return static_cast<int>(std::count(far.begin(), far.end(), true));
}

TEST(FarPlaces, IsTheOneThatStandsAlone) {
  Places places = Ring(20);
  EXPECT_EQ(Count(FarPlaces(places)), 0);
  places.insert(places.begin() + 7, {300, -20, 5});
  const std::vector<bool> far = FarPlaces(places);
  EXPECT_EQ(Count(far), 1);
  EXPECT_TRUE(far[7]);
  places.push_back({-500, 0, 0});
  EXPECT_EQ(Count(FarPlaces(places)), 2);
}

TEST(FarPlaces, AreNoneOfAWalkALineOrTwoPlaces) {
  Places walk = Ring(40);
  for (int i = 0; i < 10; ++i) walk.push_back({2.0 + 3 * i, 0, 0});
  EXPECT_EQ(Count(FarPlaces(walk)), 0);
  Places line, rooms = Ring(20);
  for (int i = 0; i < 30; ++i) line.push_back({0.5 * i, 0, 0});
  EXPECT_EQ(Count(FarPlaces(line)), 0);
  for (const auto& [x, y, z] : Ring(15)) rooms.push_back({x + 40, y, z});
  EXPECT_EQ(Count(FarPlaces(rooms)), 0);
}

TEST(FarPlaces, AreNoneIfTheyAreManyOrTogether) {
  Places views_from_afar = Ring(20);
  for (int i = 0; i < 3; ++i) views_from_afar.push_back({200.0 * (i - 1), 300, 50});
  EXPECT_EQ(Count(FarPlaces(views_from_afar)), 0);
  views_from_afar.pop_back();
  EXPECT_EQ(Count(FarPlaces(views_from_afar)), 2);
  Places pair = Ring(20);
  pair.push_back({300, 0, 0});
  pair.push_back({301, 0, 0});
  EXPECT_EQ(Count(FarPlaces(pair)), 0);
}

// Panoramas: their views' places differ by rounding.
TEST(FarPlaces, MayBeThoseOfSeveralViewsOfOnePhoto) {
  Places places;
  for (const auto& [x, y, z] : Ring(9)) {
    for (int view = 0; view < 6; ++view) places.push_back({x, y + 1e-13 * view, z});
  }
  for (int view = 0; view < 6; ++view) places.push_back({300, 1e-12 * view, 0});
  const std::vector<bool> far = FarPlaces(places);
  EXPECT_EQ(Count(far), 6);
  EXPECT_TRUE(far.back());
}

TEST(FarPlaces, AreNoneWhereThereIsNoMeasure) {
  EXPECT_EQ(Count(FarPlaces(Places{})), 0);
  EXPECT_EQ(Count(FarPlaces(Places{{0, 0, 0}, {1, 0, 0}, {100, 0, 0}})), 0);
  EXPECT_EQ(Count(FarPlaces(Places(5, {1, 2, 3}))), 0);
}

TEST(NearViews, AreThoseThatAreNotFar) {
  std::vector<View> views(9);
  for (int i = 0; i < 9; ++i) views[i].camera.t = {std::cos(i), std::sin(i), 0};
  views[4].camera.t = {0, 0, 400};
  views[4].name = "lost";
  const std::vector<View> near = NearViews(views);
  EXPECT_EQ(near.size(), 8u);
  for (const View& view : near) EXPECT_NE(view.name, "lost");
}

}  // namespace
}  // namespace litags
