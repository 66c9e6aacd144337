#include "engine/tools/contact_sheet/contact_sheet.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/picture_io.h"

namespace litags {
namespace {

class ContactSheet : public testing::Test {
 protected:
  // A picture of one colour (BGR).
  std::string Paint(const std::string& name, int width, int height, const cv::Scalar& color) {
    const std::string path = dir_ + "/" + name;
    cv::imwrite(path, cv::Mat(height, width, CV_8UC3, color));
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
      {"one", {{Paint("a.png", 50, 40, {255, 0, 0})}, {Paint("b.png", 200, 100, {0, 0, 255})}}}};
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
  cv::imwrite(path, cv::Mat(30, 60, CV_32FC1, cv::Scalar(2.5)));
  Sheet sheet;
  sheet.columns = {"a"};
  sheet.rows = {{"", {ParseSheetCell("gray:" + path)}}};
  const int height = DrawSheet(sheet)->height;
  sheet.rows = {{"", {ParseSheetCell("ramp:" + path)}}};
  EXPECT_EQ(DrawSheet(sheet)->height, height + CaptionHeight(1));
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
  const cv::Mat back = cv::imread(path);
  const auto image = DrawSheet(sheet);
  ASSERT_EQ(back.cols, image->width);
  const cv::Vec3b corner = back.at<cv::Vec3b>(0, 0);
  EXPECT_EQ(corner[2], image->data[0]);
  cv::Mat mask;
  cv::inRange(back, cv::Scalar(10, 20, 30), cv::Scalar(10, 20, 30), mask);
  EXPECT_EQ(cv::countNonZero(mask), 360 * 10);
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

TEST(ColorRamp, BrightensWithTheValueAndLeavesUnknownBlack) {
  Planes depth(1, 1, 102);
  for (int x = 0; x < 100; ++x) depth.data[x] = 1.0f + 0.05f * x;
  depth.data[100] = 0;
  depth.data[101] = std::numeric_limits<float>::quiet_NaN();
  const ImageU8 colors = ColorRamp(depth);
  const auto luma = [&](int x) {
    const uint8_t* p = colors.pixel(x, 0);
    return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
  };
  for (int x = 10; x < 100; x += 10) EXPECT_GT(luma(x), luma(x - 10)) << x;
  EXPECT_EQ(luma(100), 0);
  EXPECT_EQ(luma(101), 0);
}

}  // namespace
}  // namespace litags
