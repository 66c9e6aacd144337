// A phone's video of the sample room becomes a scene by one command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/sample/capture.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class TrainOnVideo : public testing::Test {
 protected:
  // A walk of `views` steps through the dark room, each held for three frames.
  void WriteVideo(int views) {
    sample::CaptureOptions options;
    options.width = 320;
    options.height = 240;
    options.views = views;
    options.antialias = 2;
    options.jitter = 0;  // phones hold the exposure of a video
    options.low_mean = 0.1;
    ASSERT_TRUE(sample::WriteCapture(options, dir_ / "room").ok());
    const SubprocessResult result = RunProgram(LITAGS_TEST_VIDEO, {dir_ / "room/low", video_});
    ASSERT_EQ(result.exit_code, 0) << result.tail;
  }

  std::string Train(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {video_, "-o",           out_, "--threads",
                                          "2",    "--iterations", "60"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const SubprocessResult result = RunProgram(LITAGS_TRAIN, arguments);
    exit_code_ = result.exit_code;
    return result.tail;
  }

  TempDir dir_;
  const std::string video_ = dir_ / "night.mov", out_ = dir_ / "out";
  int exit_code_ = -1;
};

TEST_F(TrainOnVideo, AWalkThroughADarkRoomBecomesAScene) {
  ASSERT_NO_FATAL_FAILURE(WriteVideo(48));
  const std::string text = Train({"--frames", "20"});
  ASSERT_EQ(exit_code_, 0) << text;
  EXPECT_THAT(text, HasSubstr("loading: choosing frames of night.mov"));
  EXPECT_THAT(text, HasSubstr("20 of the 144 frames of night.mov (4.8 s)"));
  EXPECT_THAT(text, HasSubstr("20 of 20 photos placed"));
  EXPECT_TRUE(fs::exists(out_ + "/scene.ply"));
  const auto view = ReadImage(out_ + "/views/frame_0001.png", "view");
  ASSERT_TRUE(view.ok()) << view.status();
  EXPECT_EQ(view->width, 320);  // upright
  EXPECT_EQ(view->height, 240);
  // Again: nothing is chosen or placed anew.
  const std::string again = Train({"--frames", "20"});
  EXPECT_EQ(exit_code_, 0) << again;
  EXPECT_THAT(again, testing::Not(HasSubstr("choosing frames")));
}

TEST_F(TrainOnVideo, BadOnesAreOneErrorAndInspectingTrainsNothing) {
  ASSERT_TRUE(WriteFileAtomically(video_, "no video").ok());
  const std::string text = Train({});
  EXPECT_EQ(exit_code_, 2);
  EXPECT_THAT(text, HasSubstr("VIDEO_NOT_RECOGNIZED"));
  ASSERT_TRUE(WriteFileAtomically(video_, EncodeVideo(WalkFrames(320, 180, 60, 4), {})).ok());
  const std::string inspected = Train({"--frames", "7", "--inspect"});
  EXPECT_EQ(exit_code_, 0) << inspected;
  EXPECT_THAT(inspected, HasSubstr("7 photos would be used"));
  EXPECT_FALSE(fs::exists(out_ + "/scene.litags"));
}

}  // namespace
}  // namespace litags
