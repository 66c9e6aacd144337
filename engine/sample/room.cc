#include <numbers>
#include <utility>

#include "engine/sample/poster.h"
#include "engine/sample/texture.h"
#include "engine/sample/world.h"

namespace litags::sample {
namespace {

constexpr double kTableTop = 0.76;
constexpr double kBackWall = 2.1, kLeftWall = -2.5, kRightWall = 2.5, kCeiling = 2.6;

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

class Builder {
 public:
  explicit Builder(uint64_t seed) : seed_(seed * 1000) {}

  // A seed of its own for each texture.
  uint64_t Seed() { return seed_ += 37; }

  int Material(Texture albedo, double gloss = 0, Vec3 emission = {}) {
    materials_.push_back({std::move(albedo), emission, gloss});
    return static_cast<int>(materials_.size()) - 1;
  }

  void Box(Vec3 center, Vec3 half, int material, double yaw_deg = 0, double tilt_deg = 0) {
    shapes_.push_back(
        {Shape::Kind::kBox, center, half, YawTilt(Radians(yaw_deg), Radians(tilt_deg)), material});
  }
  void Sphere(Vec3 center, double radius, int material, double yaw_deg = 0, double tilt_deg = 0) {
    shapes_.push_back({Shape::Kind::kSphere,
                       center,
                       {radius, radius, radius},
                       YawTilt(Radians(yaw_deg), Radians(tilt_deg)),
                       material});
  }
  void Cylinder(Vec3 foot, double radius, double height, int material) {
    shapes_.push_back({Shape::Kind::kCylinder,
                       foot + Vec3{0, 0, height / 2},
                       {radius, radius, height / 2},
                       {},
                       material});
  }
  void Room(Vec3 center, Vec3 half, int material) {
    shapes_.push_back({Shape::Kind::kRoom, center, half, {}, material});
  }
  void Add(const Light& light) { lights_.push_back(light); }

  World Build(Vec3 ambient_up, Vec3 ambient_down) {
    return World(std::move(shapes_), std::move(materials_), std::move(lights_), ambient_up,
                 ambient_down);
  }

 private:
  uint64_t seed_;
  std::vector<Shape> shapes_;
  std::vector<litags::sample::Material> materials_;
  std::vector<Light> lights_;
};

void AddWalls(Builder& b) {
  const Texture floor = Planks(Rgb(0xC49A6C), Rgb(0x6B4428), 0.14, b.Seed());
  const Texture ceiling = Speckled(Rgb(0xE8E6E0), 0.08, b.Seed());
  const Texture plaster = Speckled(Rgb(0xD8C8A8), 0.30, b.Seed());
  const Texture bricks = Bricks(Rgb(0xA8573E), Rgb(0xB9AE9C), b.Seed());
  const Texture paper = Terrazzo(
      Rgb(0x3E6C70), {Rgb(0x5E8F8B), Rgb(0xC9B88A), Rgb(0x2C4E57), Rgb(0x86A88F)}, 0.055, b.Seed());
  const Texture wainscot = Planks(Rgb(0xEDE6D6), Rgb(0xB5A88F), 0.11, b.Seed());
  const int walls = b.Material([=](const SurfacePoint& s) {
    if (s.normal.z > 0.5) return floor(s);
    if (s.normal.z < -0.5) return ceiling(s);
    const double height = s.position.z + kCeiling / 2;
    if (height < 0.09) return Rgb(0x4A3B30);
    if (s.normal.x > 0.5) return bricks(s);
    if (s.normal.x < -0.5) return paper(s);
    if (height < 0.85) {  // vertical boards: swap the face's axes
      return wainscot({{s.position.z, 0, s.position.x}, {0, 1, 0}});
    }
    return height < 0.9 ? Rgb(0xF1EADB) : plaster(s);
  });
  b.Room({0, -0.2, kCeiling / 2}, {kRightWall, kBackWall + 0.2, kCeiling / 2}, walls);
}

void AddLights(Builder& b) {
  const Vec3 panel{15, 14.2, 13}, daylight{2.5, 2.9, 3.5}, bulb{5.6, 3.3, 1.35};
  // Choice: pane and globe look dimmer than they shine, or the mean of a dark photo would be
  // theirs.
  const Vec3 pane = daylight * 0.3, glass = bulb * 0.25;
  const Vec3 panel_at{-1.0, -1.0, kCeiling - 0.02}, window_at{kRightWall - 0.02, 0.75, 1.6};

  b.Add({Light::Kind::kRectangle,
         panel_at - Vec3{0, 0, 0.02},
         {0.55, 0, 0},
         {0, -0.35, 0},
         0,
         panel});
  b.Box(panel_at, {0.55, 0.35, 0.015}, b.Material({}, 0, panel));

  b.Add({Light::Kind::kRectangle,
         window_at - Vec3{0.02, 0, 0},
         {0, 0.5, 0},
         {0, 0, -0.55},
         0,
         daylight});
  b.Box(window_at, {0.015, 0.5, 0.55}, b.Material({}, 0, pane));
  const int frame = b.Material(Speckled(Rgb(0xF2EEE4), 0.12, b.Seed()));
  for (const double side : {-1.0, 0.0, 1.0}) {
    b.Box(window_at + Vec3{0, side * 0.52, 0}, {0.04, side == 0 ? 0.015 : 0.035, 0.58}, frame);
    b.Box(window_at + Vec3{0, 0, side * 0.57}, {0.04, 0.55, side == 0 ? 0.015 : 0.035}, frame);
  }

  const Vec3 globe{-0.6, 0.3, kTableTop + 0.42};
  const int brass = b.Material(Speckled(Rgb(0xB08D3C), 0.25, b.Seed()), 1);
  b.Cylinder({globe.x, globe.y, kTableTop}, 0.09, 0.03, brass);
  b.Cylinder({globe.x, globe.y, kTableTop + 0.03}, 0.014, 0.32, brass);
  b.Add({Light::Kind::kSphere, globe, {}, {}, 0.085, bulb});
  b.Sphere(globe, 0.085, b.Material({}, 0, glass));
}

void AddFurniture(Builder& b) {
  const int oak = b.Material(Wood(Rgb(0xB98850), Rgb(0x744722), b.Seed()), 0.2);
  const int walnut = b.Material(Wood(Rgb(0x7D5334), Rgb(0x3F2616), b.Seed()));
  const int rug = b.Material(Rug(1.5, 1.05, b.Seed()));
  b.Box({0, 0, 0.006}, {1.5, 1.05, 0.006}, rug);

  b.Box({0, 0, kTableTop - 0.02}, {0.85, 0.5, 0.02}, oak);
  b.Box({0, 0, kTableTop - 0.08}, {0.78, 0.43, 0.04}, oak);
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      b.Box({0.76 * x, 0.41 * y, 0.33}, {0.035, 0.035, 0.32}, oak);
    }
  }

  const Vec3 seat{1.15, 0.95, 0.45};  // a chair, turned towards the table
  const double yaw = 28;
  const Frame chair = YawTilt(Radians(yaw));
  const auto part = [&](Vec3 at, Vec3 half) { b.Box(seat + chair.ToWorld(at), half, walnut, yaw); };
  part({0, 0, 0}, {0.22, 0.21, 0.02});
  for (const double x : {-0.19, 0.19}) {
    part({x, -0.18, -0.225}, {0.02, 0.02, 0.215});
    part({x, 0.19, 0.02}, {0.02, 0.02, 0.46});
  }
  for (const double z : {0.14, 0.27, 0.40}) part({0, 0.19, z}, {0.19, 0.012, 0.04});

  const int crate = b.Material(Planks(Rgb(0xD8B47A), Rgb(0x8A6238), 0.09, b.Seed()));
  b.Box({-1.5, 1.15, 0.24}, {0.33, 0.33, 0.24}, crate, -18);
  b.Sphere({-1.5, 1.15, 0.48 + 0.25}, 0.25,
           b.Material(BeachBall({Rgb(0xD62839), Rgb(0xF7F4EA), Rgb(0x1D6FB8), Rgb(0xF9C22E)},
                                Rgb(0xF7F4EA), 8, b.Seed()),
                      0.8),
           20, 35);

  const int clay = b.Material(Speckled(Rgb(0xB5623C), 0.4, b.Seed()));
  const int leaves = b.Material(Terrazzo(
      Rgb(0x16300F), {Rgb(0x3F7A2E), Rgb(0x5E9C3A), Rgb(0x2C5A22), Rgb(0x86B049)}, 0.05, b.Seed()));
  b.Cylinder({1.95, 1.55, 0}, 0.19, 0.36, clay);
  b.Cylinder({1.95, 1.55, 0.36}, 0.03, 0.35, walnut);
  b.Sphere({1.95, 1.55, 0.98}, 0.36, leaves);
  b.Sphere({1.80, 1.42, 1.28}, 0.20, leaves, 50);
  b.Sphere({2.10, 1.50, 1.32}, 0.22, leaves, 130);
}

void AddShelf(Builder& b) {
  const int board = b.Material(Wood(Rgb(0xA87B4B), Rgb(0x6A4220), b.Seed()));
  const double z = 1.12, depth = 0.11, y = kBackWall - depth;
  b.Box({0.75, y, z}, {0.72, depth, 0.015}, board);
  for (const double x : {0.25, 1.25}) b.Box({x, y + 0.04, z - 0.08}, {0.012, 0.07, 0.065}, board);

  const uint32_t covers[] = {0x9B2226, 0x005F73, 0xEE9B00, 0x3D405B, 0x81B29A, 0xE07A5F,
                             0x264653, 0xF2CC8F, 0x6A4C93, 0x2A9D8F, 0xBC4749, 0x386641};
  double x = 0.08;
  for (int i = 0; i < 15; ++i) {
    const double thick = 0.015 + 0.012 * CellNoise(i, 1, 0, 5),
                 tall = 0.09 + 0.035 * CellNoise(i, 2, 0, 5);
    const double deep = 0.06 + 0.02 * CellNoise(i, 3, 0, 5);
    const Vec3 cover = Rgb(covers[i % 12]);
    const Vec3 band = i % 3 ? Rgb(0xE9D8A6) : Rgb(0x1B1B1B);
    b.Box({x + thick, y, z + 0.015 + tall}, {thick, deep, tall},
          b.Material(Book(cover, band, 2, b.Seed())));
    x += 2 * thick + 0.002;
  }
  b.Sphere({1.02, y, z + 0.015 + 0.085}, 0.085,
           b.Material(Marble(Rgb(0x2F6690), Rgb(0xE6EEF2), 0.1, b.Seed()), 1));
  b.Box({1.27, y, z + 0.015 + 0.07}, {0.07, 0.07, 0.07},
        b.Material(Rings({Rgb(0xF4F1DE), Rgb(0xE07A5F)}, 0.028, b.Seed())), 25);
}

void AddPictures(Builder& b) {
  const int black = b.Material(Speckled(Rgb(0x2A2522), 0.3, b.Seed()));
  const int gold = b.Material(Speckled(Rgb(0xA9853B), 0.35, b.Seed()), 0.6);
  const auto hang = [&](const ImageU8& image, Vec3 at, double half_x, double half_z, int frame,
                        double yaw) {
    const Vec3 out = -YawTilt(Radians(yaw)).ey;
    b.Box(at, {half_x + 0.03, 0.012, half_z + 0.03}, frame, yaw);
    b.Box(at + out * 0.012, {half_x, 0.006, half_z},
          b.Material(Picture(image, half_x, half_z, Rgb(0xDDD6C8))), yaw);
  };
  hang(DrawPoster(), {-0.95, kBackWall - 0.02, 1.62}, 0.35, 0.50, black, 0);
  hang(DrawPainting(), {0.72, kBackWall - 0.02, 1.85}, 0.48, 0.30, gold, 0);
  hang(DrawPainting(), {kLeftWall + 0.02, 0.1, 1.55}, 0.40, 0.25, black, 90);

  const int card = b.Material(Picture(DrawColorChart(), 0.15, 0.125, Rgb(0x202020)));
  b.Box({-0.36, -0.20, kTableTop + 0.118}, {0.15, 0.006, 0.125}, card, -12, 18);
}

void AddStillLife(Builder& b) {
  const double z = kTableTop;
  // A pile of books with a marble on it.
  const struct {
    uint32_t cover, band;
    Vec3 half;
    double yaw;
  } books[] = {{0x1D3557, 0xF1FAEE, {0.15, 0.11, 0.022}, 12},
               {0xC44536, 0xFFE8D6, {0.14, 0.10, 0.018}, -7},
               {0x2D6A4F, 0xD8F3DC, {0.13, 0.095, 0.025}, 21},
               {0xE9C46A, 0x3A2E1F, {0.11, 0.08, 0.015}, 3}};
  double top = z;
  for (const auto& book : books) {
    b.Box({0.47, 0.20, top + book.half.z}, book.half,
          b.Material(Book(Rgb(book.cover), Rgb(book.band), 0, b.Seed())), book.yaw);
    top += 2 * book.half.z;
  }
  b.Sphere({0.47, 0.20, top + 0.06}, 0.06,
           b.Material(Marble(Rgb(0xEDE7DD), Rgb(0x6B4E71), 0.08, b.Seed()), 1));

  b.Sphere({-0.04, 0.02, z + 0.13}, 0.13,
           b.Material(Terrazzo(Rgb(0xB3202C), {Rgb(0xF4E9DA), Rgb(0xE8A33D), Rgb(0x7A1420)}, 0.035,
                               b.Seed()),
                      1));
  b.Sphere({0.22, -0.26, z + 0.085}, 0.085,
           b.Material(Rings({Rgb(0x0E7C7B), Rgb(0xF4F1DE), Rgb(0xF2B134)}, 0.03, b.Seed()), 1), 30,
           40);

  // Vase and topiary.
  b.Cylinder(
      {0.08, 0.33, z}, 0.065, 0.22,
      b.Material(
          Rings({Rgb(0xF1EEE6), Rgb(0x2B4C8C), Rgb(0xF1EEE6), Rgb(0x6C8FC7)}, 0.027, b.Seed()), 1));
  b.Sphere({0.08, 0.33, z + 0.22 + 0.10}, 0.125,
           b.Material(Terrazzo(Rgb(0x1B3A16), {Rgb(0x4C8B35), Rgb(0x76AC4B), Rgb(0xE58FB1)}, 0.026,
                               b.Seed())));

  // A parcel with a ribbon.
  const int paper =
      b.Material(Terrazzo(Rgb(0x6A3D9A), {Rgb(0x9B72CF), Rgb(0xF3E9F7)}, 0.03, b.Seed()));
  const int ribbon = b.Material(Speckled(Rgb(0xF6C945), 0.25, b.Seed()));
  b.Box({0.56, -0.20, z + 0.09}, {0.09, 0.09, 0.09}, paper, 33);
  b.Box({0.56, -0.20, z + 0.0905}, {0.0915, 0.018, 0.0915}, ribbon, 33);
  b.Box({0.56, -0.20, z + 0.0905}, {0.018, 0.0915, 0.0915}, ribbon, 33);

  // Mug and fruit.
  b.Cylinder({-0.62, -0.16, z}, 0.045, 0.10,
             b.Material(Terrazzo(Rgb(0xEFEBE2), {Rgb(0x31708E), Rgb(0x8FC1A9), Rgb(0xD9583B)},
                                 0.022, b.Seed()),
                        1));
  const int peel = b.Material(Speckled(Rgb(0xF07F13), 0.35, b.Seed()), 0.6);
  const int skin = b.Material(Speckled(Rgb(0x8DB600), 0.45, b.Seed()), 0.6);
  b.Sphere({-0.17, -0.34, z + 0.045}, 0.045, peel);
  b.Sphere({-0.07, -0.36, z + 0.043}, 0.043, peel, 70);
  b.Sphere({-0.11, -0.27, z + 0.041}, 0.041, skin, 20);
}

}  // namespace

World MakeRoom(uint64_t seed) {
  Builder b(seed);
  AddWalls(b);
  AddLights(b);
  AddFurniture(b);
  AddShelf(b);
  AddPictures(b);
  AddStillLife(b);
  return b.Build(Vec3{0.62, 0.66, 0.74} * 1.3, Vec3{0.50, 0.40, 0.32} * 1.3);
}

}  // namespace litags::sample
