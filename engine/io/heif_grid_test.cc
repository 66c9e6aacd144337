// HEIC as phones write it: a grid of tiles, each a picture of its own.
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/testing_photos.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr int kTile = 64;  // px

std::string Big16(uint32_t v) { return Big32(v).substr(2); }

std::string Box(const std::string& type, const std::string& data) {
  return Big32(static_cast<uint32_t>(data.size() + 8)) + type + data;
}

std::string FullBox(const std::string& type, uint8_t version, const std::string& data) {
  return Box(type, Big32(uint32_t{version} << 24) + data);
}

// A box of a file that has one of its type, without its size and type.
std::string DataOf(const std::string& file, const std::string& type) {
  const size_t at = file.find(type) - 4;
  size_t size = 0;
  for (size_t i = at; i < at + 4; ++i) size = size << 8 | static_cast<uint8_t>(file[i]);
  return file.substr(at + 8, size - 8);
}

std::string Entry(int id, const std::string& type) {
  return FullBox("infe", 2, Big16(id) + Big16(0) + type + '\0');
}

std::string Location(int id, int method, uint32_t offset, size_t length) {
  return Big16(id) + Big16(method) + Big16(0) + Big16(1) + Big32(offset) +
         Big32(static_cast<uint32_t>(length));
}

// A picture made of two of the same tile, as an item of a type (grid, iovl) says with its data.
// `stated`: its size, as the property says; `turns`: counter-clockwise, as another does.
std::string Derived(const std::string& tile_file, const std::string& type, const std::string& data,
                    std::pair<int, int> stated, int turns = 0) {
  const std::string tile = DataOf(tile_file, "mdat");
  const std::string ftyp = Box("ftyp", "heic" + Big32(0) + "mif1heic");
  const auto ispe = [](int w, int h) { return FullBox("ispe", 0, Big32(w) + Big32(h)); };
  const std::string properties =
      Box("ipco", Box("hvcC", DataOf(tile_file, "hvcC")) + ispe(kTile, kTile) +
                      ispe(stated.first, stated.second) +
                      Box("irot", std::string(1, static_cast<char>(turns))));
  // Items and their properties, by number.
  const std::string owners =
      Big32(3) + Big16(1) + "\2\3\x84" + Big16(2) + "\2\x81\2" + Big16(3) + "\2\x81\2";
  const auto meta = [&](uint32_t tile_at) {
    return FullBox(
        "meta", 0,
        FullBox("hdlr", 0, Big32(0) + "pict" + std::string(13, '\0')) +
            FullBox("pitm", 0, Big16(1)) +
            FullBox("iloc", 1,
                    std::string("\x44\0", 2) + Big16(3) + Location(1, 1, 0, data.size()) +
                        Location(2, 0, tile_at, tile.size()) +
                        Location(3, 0, tile_at, tile.size())) +
            FullBox("iinf", 0, Big16(3) + Entry(1, type) + Entry(2, "hvc1") + Entry(3, "hvc1")) +
            FullBox("iref", 0, Box("dimg", Big16(1) + Big16(2) + Big16(2) + Big16(3))) +
            Box("iprp", properties + FullBox("ipma", 0, owners)) + Box("idat", data));
  };
  const auto tile_at = static_cast<uint32_t>(ftyp.size() + meta(0).size() + 8);
  return ftyp + meta(tile_at) + Box("mdat", tile);
}

// The tiles beside each other. `width`, `height`: of the whole, as the grid has them.
std::string Grid(const std::string& tile_file, int width, int height, std::pair<int, int> stated,
                 int turns = 0) {
  return Derived(tile_file, "grid", std::string("\0\0\0\1", 4) + Big16(width) + Big16(height),
                 stated, turns);
}

class HeifGrid : public testing::Test {
 protected:
  const std::string tile_ = EncodeTestHeif(Ramp(3, kTile, kTile), false, 8);
};

TEST_F(HeifGrid, IsPutTogether) {
  const auto photo = DecodePhoto(Grid(tile_, 120, 60, {120, 60}), "f");
  ASSERT_TRUE(photo.ok()) << photo.status();
  ASSERT_EQ(photo->width, 120);
  ASSERT_EQ(photo->height, 60);
  const auto tile = DecodePhoto(tile_, "f");
  ASSERT_TRUE(tile.ok()) << tile.status();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 120; ++x) {
      ASSERT_NEAR(photo->pixel(x, y)[0], tile->pixel(x % kTile, y)[0], kPhotoCode) << x << "," << y;
    }
  }
}

TEST_F(HeifGrid, IsTurnedAsAWhole) {
  for (const int bits : {8, 10}) {
    const std::string tile = EncodeTestHeif(Ramp(3, kTile, kTile), false, bits);
    const auto upright = DecodePhoto(Grid(tile, 120, 60, {120, 60}), "f");
    ASSERT_TRUE(upright.ok()) << upright.status();
    const auto turned = DecodePhoto(Grid(tile, 120, 60, {120, 60}, 3), "f");
    ASSERT_TRUE(turned.ok()) << turned.status();
    EXPECT_EQ(turned->data, TurnUpright(*upright, 6).data) << bits;
  }
}

TEST_F(HeifGrid, ThatLacksTilesOrTheirEndIsRefused) {
  EXPECT_FALSE(DecodePhoto(Grid(tile_, 200, 60, {200, 60}), "f").ok());
  const std::string whole = Grid(tile_, 120, 60, {120, 60});
  EXPECT_FALSE(DecodePhoto(whole.substr(0, whole.size() - 30), "f").ok());
}

TEST_F(HeifGrid, IsNoLargerThanItStates) {
  for (const int side : {20'000, 32'000, 65'535}) {
    EXPECT_FALSE(DecodePhoto(Grid(tile_, side, side, {120, 60}), "f").ok()) << side;
    EXPECT_EQ(Reason(DecodePhoto(Grid(tile_, side, side, {side, side}), "f").status()),
              "IMAGE_TOO_LARGE")
        << side;
  }
}

// libheif would follow that until the stack is full.
TEST_F(HeifGrid, WhoseTileIsItselfIsRefused) {
  std::string file = Grid(tile_, 120, 60, {120, 60});
  const size_t first_tile = file.find("dimg") + 9;  // after the type, the grid, and how many
  ASSERT_EQ(file[first_tile], 2);
  file[first_tile] = 1;
  EXPECT_EQ(Reason(ReadImageInfo(file, "f").status()), "IMAGE_CORRUPT");
  EXPECT_EQ(Reason(DecodePhoto(file, "f").status()), "IMAGE_CORRUPT");
}

// libheif would lay codes of YCbCr over a colour of RGB.
TEST_F(HeifGrid, OfPicturesLaidOverEachOtherIsRefused) {
  const std::string black = Big32(0) + Big32(0), offsets = Big32(0) + Big16(20) + Big16(0);
  const std::string overlay =
      std::string(2, '\0') + black + Big16(kTile + 20) + Big16(kTile) + offsets;
  const std::string file = Derived(tile_, "iovl", overlay, {kTile + 20, kTile});
  EXPECT_EQ(Reason(DecodePhoto(file, "f").status()), "IMAGE_UNSUPPORTED")
      << DecodePhoto(file, "f").status();
}

}  // namespace
}  // namespace litags
