#include "client/view_args.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "client/client.h"
#include "client/picture_file.h"
#include "client/status.h"

namespace litags::client {
namespace {

std::string ReasonOf(const absl::Status& status) { return DetailOf(status).reason(); }

TEST(ParsePose, TakesSixteenNumbersTogetherOrApart) {
  PoseArgs together, apart;
  together.pose = {"1 0 0 0, 0 1 0 0, 0 0 1 -2.5, 0 0 0 1"};
  apart.pose = {"1", "0", "0", "0", "0", "1", "0", "0", "0", "0", "1", "-2.5", "0", "0", "0", "1"};
  for (const PoseArgs& args : {together, apart}) {
    const auto pose = ParsePose(args);
    ASSERT_TRUE(pose.ok()) << pose.status();
    ASSERT_EQ(pose->viewmat().values_size(), 16);
    EXPECT_EQ(pose->viewmat().values(11), -2.5);
    EXPECT_EQ(pose->viewmat().values(15), 1);
  }
}

TEST(ParsePose, ReadsAMatrixFromAFile) {
  const auto path = std::filesystem::temp_directory_path() / ("pose-" + RandomId());
  std::ofstream(path) << "[[1,0,0,0],\n [0,1,0,0],\n [0,0,1,3],\n [0,0,0,1]]\n";
  PoseArgs args;
  args.pose = {path.string()};
  const auto pose = ParsePose(args);
  std::filesystem::remove(path);
  ASSERT_TRUE(pose.ok()) << pose.status();
  EXPECT_EQ(pose->viewmat().values(11), 3);
}

TEST(ParsePose, SaysWhyAFileCannotBeRead) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "UBSan needs descriptors to see whether memory is there";
#endif
  const auto path = std::filesystem::temp_directory_path() / ("pose-" + RandomId());
  std::ofstream(path) << "1 0 0 0";
  rlimit limit = {};
  getrlimit(RLIMIT_NOFILE, &limit);
  const rlimit none = {0, limit.rlim_max};
  setrlimit(RLIMIT_NOFILE, &none);
  PoseArgs args;
  args.pose = {path.string()};
  const auto pose = ParsePose(args);
  setrlimit(RLIMIT_NOFILE, &limit);
  std::filesystem::remove(path);
  EXPECT_EQ(ReasonOf(pose.status()), "FILE_UNREADABLE");
  EXPECT_THAT(std::string(pose.status().message()),
              ::testing::HasSubstr("cannot be read (Too many open files); give a file"));
}

TEST(ParsePose, PassesNanOnToTheServer) {
  PoseArgs args;
  args.pose = {"nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"};
  const auto pose = ParsePose(args);
  ASSERT_TRUE(pose.ok());
  EXPECT_TRUE(std::isnan(pose->viewmat().values(0)));
}

TEST(ParsePose, RefusesWrongCountsAndWords) {
  PoseArgs args;
  args.pose = {"1 2 3"};
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "POSE_INVALID");
  args.pose = {"1"};
  EXPECT_THAT(std::string(ParsePose(args).status().message()),
              ::testing::HasSubstr("1 number; give the 16"));
  args.pose = {"no-such-file.txt"};
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "NUMBER_INVALID");
}

TEST(ParsePose, WantsExactlyOneWay) {
  PoseArgs args;
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "POSE_MISSING");
  args.camera = "a.jpg";
  args.look_at = {"0,0,0", "0,0,1"};
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "POSE_MISSING");
}

TEST(ParsePose, TakesEyeTargetAndUp) {
  PoseArgs args;
  args.look_at = {"-1,-2,3", "0,0,0.5"};
  args.up = "0,-1,0";
  const auto pose = ParsePose(args);
  ASSERT_TRUE(pose.ok()) << pose.status();
  EXPECT_EQ(pose->look_at().eye().y(), -2);
  EXPECT_EQ(pose->look_at().target().z(), 0.5);
  EXPECT_EQ(pose->look_at().up().y(), -1);
  args.look_at[1] = "0,0";
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "VECTOR_INVALID");
}

TEST(ParsePose, RefusesUpWithoutLookAt) {
  PoseArgs args;
  args.camera = "a.jpg";
  args.up = "0,1,0";
  EXPECT_EQ(ReasonOf(ParsePose(args).status()), "UP_WITHOUT_LOOK_AT");
}

TEST(ParseSettings, ReadsSizes) {
  SettingsArgs args;
  args.size = "640x480";
  EXPECT_EQ(ParseSettings(args)->height(), 480);
  args.size = "x480";
  EXPECT_EQ(ParseSettings(args)->width(), 0);
  for (const char* bad : {"640", "x", "0x10", "-1x2", "1x2x3", "9999999999x1", "axb"}) {
    args.size = bad;
    EXPECT_EQ(ReasonOf(ParseSettings(args).status()), "SIZE_INVALID") << bad;
  }
}

TEST(ParseSettings, TakesFourNumbersOfALens) {
  SettingsArgs args;
  args.intrinsics = "500,510,320,240";
  EXPECT_EQ(ParseSettings(args)->intrinsics().cy(), 240);
  args.intrinsics = "500,510,320";
  EXPECT_EQ(ReasonOf(ParseSettings(args).status()), "INTRINSICS_INVALID");
}

TEST(ParseSettings, ALightAloneChoosesItsChannelAnExposureDoesNot) {
  SettingsArgs args;
  args.exposure = 1.5;
  EXPECT_EQ(ParseSettings(args)->channel(), v1::CHANNEL_UNSPECIFIED);
  EXPECT_EQ(ParseSettings(args)->exposure_stops(), 1.5);
  args.light = 0.5;
  EXPECT_EQ(ParseSettings(args)->channel(), v1::CHANNEL_LIGHT);
  EXPECT_EQ(ParseSettings(args)->light(), 0.5);
  args.channel = "Depth";
  EXPECT_EQ(ParseSettings(args)->channel(), v1::CHANNEL_DEPTH);
  args.channel = "exposure";
  EXPECT_EQ(ReasonOf(ParseSettings(args).status()), "CHANNEL_UNKNOWN");
  EXPECT_THAT(std::string(ParseSettings(args).status().message()), ::testing::HasSubstr("--light"));
  args.channel = "unspecified";
  EXPECT_EQ(ReasonOf(ParseSettings(args).status()), "CHANNEL_UNKNOWN");
}

TEST(PictureFile, TheNameSaysTheFormat) {
  EXPECT_EQ(*PictureFormatOf("a/b.JPG"), v1::PICTURE_FORMAT_JPEG);
  EXPECT_EQ(*PictureFormatOf("b.npy"), v1::PICTURE_FORMAT_RAW_FLOAT);
  EXPECT_EQ(ReasonOf(PictureFormatOf("b.gif").status()), "PICTURE_FORMAT_UNKNOWN");
}

TEST(PictureFile, AnNpyFileHasAnAlignedHeaderAndTheFloats) {
  v1::RenderedView view;
  view.set_width(2);
  view.set_height(1);
  view.set_planes(3);
  view.set_data(std::string(24, 'f'));
  const auto bytes = PictureFileBytes("x.npy", view);
  ASSERT_TRUE(bytes.ok());
  EXPECT_EQ(bytes->substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  EXPECT_EQ((bytes->size() - 24) % 64, 0u);
  uint16_t header_length = 0;
  std::memcpy(&header_length, bytes->data() + 8, 2);
  EXPECT_EQ(header_length + 10u + 24u, bytes->size());
  EXPECT_THAT(*bytes, ::testing::HasSubstr("'shape': (1, 2, 3)"));
  view.set_width(3);
  EXPECT_EQ(ReasonOf(PictureFileBytes("x.npy", view).status()), "PICTURE_BROKEN");
}

TEST(OutputFile, LeavesNothingWithoutCommit) {
  const auto path = (std::filesystem::temp_directory_path() / ("out-" + RandomId())).string();
  {
    OutputFile file;
    ASSERT_TRUE(file.Open(path).ok());
    ASSERT_TRUE(file.Write("half").ok());
  }
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(path).parent_path())) {
    EXPECT_FALSE(entry.path().string().starts_with(path)) << entry.path();
  }
  OutputFile file;
  ASSERT_TRUE(file.Open(path).ok());
  ASSERT_TRUE(file.Write("whole").ok());
  ASSERT_TRUE(file.Commit().ok());
  EXPECT_EQ(std::filesystem::file_size(path), 5u);
  std::filesystem::remove(path);
}

TEST(OutputFile, ASymbolicLinkStaysOne) {
  const auto dir = std::filesystem::temp_directory_path() / ("out-" + RandomId());
  std::filesystem::create_directories(dir / "there");
  std::filesystem::create_symlink("there/real.png", dir / "link.png");
  for (const std::string bytes : {"first", "second"}) {  // of what is not there yet, and of a file
    ASSERT_TRUE(WriteWhole((dir / "link.png").string(), bytes).ok());
    EXPECT_TRUE(std::filesystem::is_symlink(dir / "link.png"));
    EXPECT_EQ(std::filesystem::file_size(dir / "there/real.png"), bytes.size());
  }
  std::filesystem::remove_all(dir);
}

TEST(OutputFile, WritesToWhatIsNoFile) {
  const auto path = (std::filesystem::temp_directory_path() / ("out-" + RandomId())).string();
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const int reader = open(path.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  OutputFile file;
  ASSERT_TRUE(file.Open(path).ok());
  ASSERT_TRUE(file.Open(path).ok()) << "nothing is written yet";
  ASSERT_TRUE(file.Write("whole").ok());
  EXPECT_EQ(ReasonOf(file.Open(path)), "OUTPUT_FAILED");
  ASSERT_TRUE(file.Commit().ok());
  EXPECT_TRUE(std::filesystem::is_fifo(path));
  char bytes[16];
  EXPECT_EQ(read(reader, bytes, sizeof(bytes)), 5);
  close(reader);
  std::filesystem::remove(path);
}

TEST(OutputFile, TwoOfOneNameDoNotMix) {
  const auto path = (std::filesystem::temp_directory_path() / ("out-" + RandomId())).string();
  OutputFile first, second;
  ASSERT_TRUE(first.Open(path).ok() && second.Open(path).ok());
  ASSERT_TRUE(first.Write("first").ok() && second.Write("the second").ok());
  ASSERT_TRUE(first.Commit().ok());
  EXPECT_EQ(std::filesystem::file_size(path), 5u);
  ASSERT_TRUE(second.Commit().ok());
  EXPECT_EQ(std::filesystem::file_size(path), 10u);
  std::filesystem::remove(path);
}

TEST(OutputFile, SaysWhereItCannotBeWritten) {
  OutputFile file;
  EXPECT_EQ(ReasonOf(file.Open("/no/such/folder/x.png")), "OUTPUT_NOT_WRITABLE");
  EXPECT_EQ(ReasonOf(file.Open(std::filesystem::temp_directory_path().string())),
            "OUTPUT_NOT_WRITABLE");
  EXPECT_EQ(ReasonOf(file.Write("x")), "OUTPUT_FAILED");
  EXPECT_EQ(ReasonOf(file.Commit()), "OUTPUT_FAILED");
}

}  // namespace
}  // namespace litags::client
