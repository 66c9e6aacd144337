#include "client/job_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace litags::client {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

v1::JobFile File(const std::string& name, v1::FileRole role) {
  v1::JobFile file;
  file.set_file_name(name);
  file.set_role(role);
  file.set_size_bytes(1200);
  return file;
}

v1::JobFile Photo(const std::string& name, double stops, const std::string& left_out = "") {
  v1::JobFile photo = File(name, v1::FILE_ROLE_PHOTO);
  photo.set_width(64);
  photo.set_height(48);
  photo.mutable_found()->set_focal_length_mm(28);
  photo.mutable_found()->set_mean_code(7.5);
  photo.mutable_found()->set_stops(stops);
  photo.mutable_found()->set_left_out(left_out);
  return photo;
}

TEST(JobFiles, WhatWouldBeUsedIsALineAndWhatIsNotALineEach) {
  EXPECT_THAT(
      DescribeFiles({File("a.jpg.png", v1::FILE_ROLE_MASK), Photo("a.jpg", -0.42),
                     Photo("b.jpg", 0.61), Photo("c.jpg", 0, "is the same photo as a.jpg")}),
      ElementsAre("2 photos would be used, 1 is left out; 64x48 px; 28 mm; light: -0.4 to "
                  "+0.6 stops from the middle photo; 1 mask",
                  "left out: c.jpg: it is the same photo as a.jpg"));
}

TEST(JobFiles, PhotosWithoutOneOfTheCamerasAreNotPromised) {
  EXPECT_THAT(DescribeFiles({Photo("a.jpg", 0), Photo("b.jpg", 0), Photo("c.jpg", 0, "is black"),
                             File("transforms.json", v1::FILE_ROLE_CAMERAS)})[0],
              HasSubstr("2 photos would be used if they have a camera, 1 is left out; "));
}

TEST(JobFiles, PhotosThatSayNothingHaveNoLensAndNoLight) {
  v1::JobFile black = Photo("a.jpg", 0);
  black.mutable_found()->clear_stops();
  black.mutable_found()->clear_focal_length_mm();
  EXPECT_THAT(DescribeFiles({black}), ElementsAre("1 photo would be used; 64x48 px"));
}

TEST(JobFiles, ManyLensesAreCounted) {
  std::vector<v1::JobFile> photos;
  for (int i = 0; i < 4; ++i) {
    photos.push_back(Photo("a.jpg", -0.01));
    photos.back().mutable_found()->set_focal_length_mm(20 + i);
  }
  EXPECT_THAT(
      DescribeFiles(photos),
      ElementsAre("4 photos would be used; 64x48 px; 4 focal lengths; light: 0.0 stops from "
                  "the middle photo"));
}

TEST(JobFiles, AVideoSaysHowLongItIs) {
  v1::JobFile video = File("night.mp4", v1::FILE_ROLE_VIDEO);
  video.set_width(640);
  video.set_height(480);
  video.mutable_found_in_video()->mutable_duration()->set_seconds(12);
  video.mutable_found_in_video()->set_frames(360);
  EXPECT_THAT(
      DescribeFiles({video}),
      ElementsAre("a video of 640x480 px, 12s, 360 frames: its sharpest frames become photos"));
}

TEST(JobFiles, TheTableNamesEachFileAndWhyItIsLeftOut) {
  const std::string table = FileTable(
      {Photo("a.jpg", 0.3), Photo("b.jpg", 0, "is black"), File("b.png", v1::FILE_ROLE_MASK)});
  EXPECT_THAT(table, HasSubstr("photo       1.2 KiB       64x48    7.5   +0.3         a.jpg\n"));
  EXPECT_THAT(table, HasSubstr("b.jpg  (left out: it is black)\n"));
  EXPECT_THAT(table, HasSubstr("mask        1.2 KiB                                   b.png\n"));
}

TEST(JobFiles, TheTablesLegendExplainsEachNumberAndIsThereOnlyWithNumbers) {
  const std::string table = FileTable({Photo("a.jpg", 0.3)});
  for (const char* column : {"CODE", "STOPS", "SHARP"}) {
    EXPECT_THAT(table.substr(0, table.find('\n')), HasSubstr(column));
    EXPECT_THAT(table.substr(table.find("a.jpg")), HasSubstr(std::string(column) + ": "));
  }
  EXPECT_THAT(table, EndsWith("SHARP: sharpness beside the middle photo\n"));
  EXPECT_THAT(FileTable({File("b.png", v1::FILE_ROLE_MASK)}), Not(HasSubstr("CODE:")));
}

}  // namespace
}  // namespace litags::client
