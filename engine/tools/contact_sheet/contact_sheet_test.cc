#include "engine/tools/contact_sheet/contact_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

class ContactSheet : public testing::Test {
 protected:
  // A picture of one colour.
  std::string Paint(const std::string& name, int width, int height,
                    const std::array<uint8_t, 3>& color) {
    const std::string path = dir_ + "/" + name;
    ImageU8 picture(width, height);
    for (size_t i = 0; i < picture.data.size(); ++i) picture.data[i] = color[i % 3];
    EXPECT_TRUE(WritePng(path, picture).ok());
    return path;
  }

  // Pixels of the sheet that have exactly this colour.
  static int Count(const ImageU8& image, int r, int g, int b) {
    int n = 0;
    for (size_t i = 0; i < image.data.size(); i += 3) {
      n += image.data[i] == r && image.data[i + 1] == g && image.data[i + 2] == b;
    }
    return n;
  }

  const TempDir temporary_;
  const std::string dir_ = temporary_.path();
};

TEST_F(ContactSheet, EveryPictureAppearsInItsOwnColoursAndWidth) {
  Sheet sheet;
  sheet.columns = {"left", "right"};
  sheet.cell_width = 100;
  sheet.rows = {
      {"one", {{Paint("a.png", 50, 40, {0, 0, 255})}, {Paint("b.png", 200, 100, {255, 0, 0})}}}};
  const auto image = DrawSheet(sheet);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(Count(*image, 0, 0, 255), 100 * 80);  // enlarged
  EXPECT_EQ(Count(*image, 255, 0, 0), 100 * 50);  // shrunk
}

TEST_F(ContactSheet, PhotosAreUpright) {
  const std::string path = dir_ + "/phone.jpg";
  const std::string jpeg = EncodeJpeg(ImageU8(40, 20)).value();
  ASSERT_TRUE(WriteFileAtomically(path, WithJpegExif(jpeg, ExifBlock(6, true))).ok());
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.cell_width = 20;
  sheet.rows = {{"", {{path}}}};
  const auto image = DrawSheet(sheet);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(Count(*image, 0, 0, 0), 20 * 40);
}

TEST_F(ContactSheet, ARowNeedNotFillItsColumns) {
  Sheet sheet;
  sheet.columns = {"a", "b", "c"};
  sheet.cell_width = 60;
  sheet.rows = {{"one", {ParseSheetCell("-"), {Paint("a.png", 60, 30, {0, 255, 0})}}}};
  const auto image = DrawSheet(sheet);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(Count(*image, 0, 255, 0), 60 * 30);
  EXPECT_GT(image->width, 3 * 60);
}

TEST_F(ContactSheet, CellsThatFillUpARowArePaper) {
  Sheet sheet;
  sheet.columns = {"a", "b"};
  sheet.cell_width = 200;
  sheet.rows = {{"one", {{Paint("a.png", 60, 30, {0, 255, 0})}}}};
  EXPECT_LT(Count(*DrawSheet(sheet), 226, 226, 224), 100);  // edges of letters
  sheet.rows[0].cells.push_back({});
  EXPECT_GT(Count(*DrawSheet(sheet), 226, 226, 224), 10000);
}

TEST_F(ContactSheet, CaptionsStandBelowTheirPictures) {
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.cell_width = 100;
  sheet.rows = {{"", {{Paint("a.png", 100, 50, {0, 255, 0})}}}};
  const int height = DrawSheet(sheet)->height, width = DrawSheet(sheet)->width;
  EXPECT_LT(width, 140) << "no column of labels without any";
  sheet.rows[0].cells[0].caption = "a name";
  EXPECT_EQ(DrawSheet(sheet)->height, height + CaptionHeight(1));
  sheet.rows[0].cells[0].caption = "a name\nand a reason of some words that do not fit";
  EXPECT_EQ(DrawSheet(sheet)->height, height + CaptionHeight(kCaptionLines));
  EXPECT_EQ(Count(*DrawSheet(sheet), 0, 255, 0), 100 * 50);
}

TEST_F(ContactSheet, ARampOfFloatingPointValuesHasAScale) {
  const std::string path = dir_ + "/depth.pfm";
  Planes depth(1, 30, 60);
  std::ranges::fill(depth.data, 2.5f);
  ASSERT_TRUE(WritePfm(path, depth).ok());
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.rows = {{"", {ParseSheetCell("gray:" + path)}}};
  const int height = DrawSheet(sheet)->height;
  sheet.rows = {{"", {ParseSheetCell("ramp:" + path)}}};
  EXPECT_EQ(DrawSheet(sheet)->height, height + CaptionHeight(1));
}

TEST_F(ContactSheet, ARampIsYellowFarAwayAndBlackWhereUnknown) {
  Planes depth(1, 30, 90);
  for (size_t i = 0; i < depth.data.size(); ++i) depth.data[i] = std::array{1, 7, 0}[i % 90 / 30];
  depth.data[80] = std::numeric_limits<float>::quiet_NaN();
  const std::string path = dir_ + "/depth.pfm";
  ASSERT_TRUE(WritePfm(path, depth).ok());
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.cell_width = 90;
  sheet.rows = {{"", {ParseSheetCell("ramp:" + path)}}};
  const auto image = DrawSheet(sheet);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(Count(*image, 68, 1, 84), 30 * 30);
  EXPECT_EQ(Count(*image, 253, 231, 37), 30 * 30);
  EXPECT_EQ(Count(*image, 0, 0, 0), 30 * 30);
}

TEST_F(ContactSheet, OneChannelOfAPngIsShownAsGrey) {
  std::vector<uint16_t> codes(16 * 3, 9);
  for (int x = 0; x < 16; ++x) codes[3 * x] = x < 8 ? 100 : 900;
  const std::string path = dir_ + "/structure.png";
  ASSERT_TRUE(WriteFileAtomically(path, EncodePngCodes(codes.data(), 16, 1, 3).value()).ok());
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.cell_width = 16;
  sheet.rows = {{"", {ParseSheetCell("gray:" + path)}}};
  const auto image = DrawSheet(sheet);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(Count(*image, 0, 0, 0), 8);
  EXPECT_EQ(Count(*image, 255, 255, 255), 8);
}

TEST_F(ContactSheet, LongLabelsAreGivenRoomAndLinesShareARow) {
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.cell_width = 60;
  sheet.rows = {{"short", {{Paint("a.png", 60, 60, {0, 255, 0})}}}};
  const int narrow = DrawSheet(sheet)->width, height = DrawSheet(sheet)->height;
  sheet.rows[0].label = "a label of many words\nand two lines";
  const auto wide = DrawSheet(sheet);
  ASSERT_TRUE(wide.ok()) << wide.status();
  EXPECT_GT(wide->width, narrow + 50);
  EXPECT_EQ(wide->height, height);
  EXPECT_EQ(Count(*wide, 0, 255, 0), 60 * 60);  // no text over the picture
}

TEST_F(ContactSheet, TheWrittenFileHoldsTheSheet) {
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.rows = {{"one", {{Paint("a.png", 360, 10, {10, 20, 30})}}}};
  const std::string path = dir_ + "/sheet.png";
  ASSERT_TRUE(WriteSheet(sheet, path).ok());
  EXPECT_EQ(ReadImage(path, path)->data, DrawSheet(sheet)->data);
  EXPECT_EQ(Count(*DrawSheet(sheet), 10, 20, 30), 360 * 10);
  EXPECT_EQ(GetErrorDetail(WriteSheet(sheet, dir_ + "/sheet.tif"))->reason, "CANNOT_WRITE");
}

TEST_F(ContactSheet, AMissingPictureIsNamed) {
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.rows = {{"one", {{dir_ + "/nothing.png"}}}};
  const absl::Status status = DrawSheet(sheet).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_NE(std::string(status.message()).find("nothing.png"), std::string::npos);
}

TEST_F(ContactSheet, MorePicturesThanColumnsAreRefused) {
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.rows = {{"one", {{}, {}}}};
  EXPECT_EQ(GetErrorDetail(DrawSheet(sheet).status())->reason, "TOO_MANY_CELLS");
  sheet.rows.clear();
  EXPECT_EQ(GetErrorDetail(DrawSheet(sheet).status())->reason, "EMPTY_SHEET");
}

TEST(PlainText, HasNoCharacterThatTheFontLacks) {
  EXPECT_EQ(PlainText("Bild \u00f6\u2013\u00df 1.JPG"), "Bild o-ss 1.JPG");
  EXPECT_EQ(PlainText("Ho\u0308hle \u0141\u00f3d\u017a \u017fx"), "Hohle Lodz sx");
  EXPECT_EQ(PlainText("\u6771\u4eac \U0001f600.png"), "__ _.png");
  EXPECT_EQ(PlainText("cut \xe6\x9d"), "cut _");
  EXPECT_EQ(PlainText("\xc3"), "_");
}

TEST(ParseSheetCell, APrefixChoosesTheLook) {
  EXPECT_EQ(ParseSheetCell("a.png").look, SheetCell::Look::kPhoto);
  EXPECT_EQ(ParseSheetCell("ramp:d.pfm").look, SheetCell::Look::kRamp);
  EXPECT_EQ(ParseSheetCell("ramp:d.pfm").path, "d.pfm");
  EXPECT_EQ(ParseSheetCell("gray:s.png").look, SheetCell::Look::kGray);
  EXPECT_TRUE(ParseSheetCell("-").path.empty());
}

}  // namespace
}  // namespace litags
