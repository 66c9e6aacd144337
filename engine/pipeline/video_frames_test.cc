#include "engine/pipeline/video_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/wide_photos.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class VideoFrames : public testing::Test {
 protected:
  void SetUp() override {
    input_.work_dir = dir_ / "work";
    input_.video_path = dir_ / "night.mov";
    fs::create_directory(input_.work_dir);
    Write(EncodeVideo(WalkFrames(160, 90, 40, 4), {}));
  }

  void Write(const std::string& bytes) {
    ASSERT_TRUE(WriteFileAtomically(input_.video_path, bytes).ok());
  }

  absl::StatusOr<ReconstructInput> Pick(int frames = 6) {
    notes_.clear();
    said_.clear();
    return WithFramesAsPhotos(
        input_, frames, CancelToken(), [&](const std::string& text) { said_.push_back(text); },
        &notes_);
  }

  size_t Photos() const { return ListPhotos(input_.work_dir + "/frames", "frames")->size(); }

  TempDir dir_;
  ReconstructInput input_;
  std::vector<std::string> notes_, said_;
};

TEST_F(VideoFrames, BecomeThePhotos) {
  const auto photos = Pick();
  ASSERT_TRUE(photos.ok()) << photos.status();
  EXPECT_EQ(photos->images_dir, input_.work_dir + "/frames");
  EXPECT_EQ(photos->video_path, "");
  EXPECT_EQ(Photos(), 6u);
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("6 of the 40 frames of night.mov (1.3 s)")));
  EXPECT_EQ(said_.front(), "choosing frames of night.mov");
}

TEST_F(VideoFrames, OfAPanoramaArePanoramas) {
  TestVideo options;
  options.container = "matroska";
  options.sphere = "equirectangular";
  Write(EncodeVideo(WalkFrames(160, 80, 40, 4), options));
  const auto photos = Pick();
  ASSERT_TRUE(photos.ok()) << photos.status();
  const auto names = ListPhotos(photos->images_dir, "frames");
  const auto wide = FindWidePhotos(*photos, *names, 1, CancelToken());
  ASSERT_TRUE(wide.ok()) << wide.status();
  ASSERT_EQ(wide->photos.size(), 6u);
  EXPECT_EQ(wide->photos[0].kind, "panorama");
  EXPECT_EQ(wide->photos[0].views.size(), 6u);
}

TEST_F(VideoFrames, AreKeptForTheSameVideoAndNumberOnly) {
  ASSERT_TRUE(Pick().ok());
  const auto note = notes_;
  fs::remove(input_.work_dir + "/frames/frame_0002.png");
  ASSERT_TRUE(Pick().ok());
  EXPECT_EQ(Photos(), 5u);  // not looked at again
  EXPECT_EQ(notes_, note);
  EXPECT_TRUE(said_.empty());
  ASSERT_TRUE(Pick(4).ok());
  EXPECT_EQ(Photos(), 4u);
  Write(EncodeVideo(WalkFrames(160, 90, 50, 4), {}));
  ASSERT_TRUE(Pick(4).ok());
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("4 of the 50 frames")));
}

// As ffmpeg cuts them: see docs/video.md.
TEST_F(VideoFrames, FramesOfTheUsersStay) {
  const std::string mine = input_.work_dir + "/frames/0001.png";
  fs::create_directory(input_.work_dir + "/frames");
  ASSERT_TRUE(WriteFileAtomically(mine, "mine").ok());
  const auto status = Pick().status();
  EXPECT_EQ(Reason(status), "FOLDER_NOT_OURS");
  EXPECT_THAT(std::string(status.message()), HasSubstr(input_.work_dir + "/frames"));
  EXPECT_EQ(ReadFile(mine, "", 9).value(), "mine");
  EXPECT_EQ(Photos(), 1u);
}

TEST_F(VideoFrames, ThoseOfAnOlderVersionAreUsed) {
  ASSERT_TRUE(Pick().ok());
  fs::remove(input_.work_dir + "/frames/" + kOwnFolderMarker);
  ASSERT_TRUE(Pick().ok());
  EXPECT_EQ(Pick(4).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Photos(), 6u);
  ASSERT_TRUE(Pick().ok()) << "still known";
}

TEST_F(VideoFrames, AMissingEndIsNoted) {
  TestVideo options;
  options.container = "matroska";
  const std::string bytes = EncodeVideo(WalkFrames(160, 90, 240, 2), options);
  Write(bytes.substr(0, bytes.size() / 2));
  ASSERT_TRUE(Pick().ok());
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("the file should last 8.0 s: its end is missing")));
}

TEST_F(VideoFrames, DamagedOnesAreNotedWhereTheyAreMany) {
  TestVideo options;
  options.codec = "mjpeg";
  options.pixels = "yuvj420p";
  std::string bytes = EncodeVideo(WalkFrames(160, 90, 120, 2), options);
  const auto damage = [&](double from, double to) {
    for (auto i = static_cast<size_t>(from * bytes.size()); i < to * bytes.size(); i += 7) {
      bytes[i] ^= 0x5a;
    }
    Write(bytes);
  };
  damage(0.5, 0.501);
  ASSERT_TRUE(Pick().ok());
  EXPECT_THAT(notes_, ElementsAre(Not(HasSubstr("damaged"))));
  damage(0.6, 0.7);
  ASSERT_TRUE(Pick().ok());
  EXPECT_THAT(
      notes_,
      ElementsAre(testing::ContainsRegex("; [0-9]+ frames more are damaged and were passed over")));
}

// Matroska states the length of its longest stream.
TEST_F(VideoFrames, SoundThatLastsLongerIsNoMissingEnd) {
  TestVideo options;
  options.container = "matroska";
  options.sound_seconds = 20;
  const std::string bytes = EncodeVideo(WalkFrames(160, 90, 240, 2), options);
  Write(bytes);
  ASSERT_TRUE(Pick().ok());
  EXPECT_THAT(notes_, ElementsAre(Not(HasSubstr("missing"))));
  Write(bytes.substr(0, bytes.size() / 4));
  ASSERT_TRUE(Pick().ok());
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("the file should last 20.0 s: its end is missing")));
}

// Whoever made them cut frames out by another rule.
TEST_F(VideoFrames, TakeNothingThatIsOfPhotosByTheirNames) {
  using Input = ReconstructInput;
  for (std::string Input::*path : {&Input::cameras_path, &Input::depth_dir, &Input::masks_dir}) {
    input_.*path = dir_ / "beside";
    EXPECT_EQ(Reason(Pick().status()), "VIDEO_NOT_ALONE");
    (input_.*path).clear();
  }
  EXPECT_TRUE(Pick().ok());
}

TEST_F(VideoFrames, ErrorsNameTheVideo) {
  Write("no video");
  const absl::Status status = Pick().status();
  EXPECT_EQ(Reason(status), "VIDEO_NOT_RECOGNIZED");
  EXPECT_EQ(GetErrorDetail(status)->field, "videos[night.mov]");
  input_.video_path = dir_ / "gone.mov";
  EXPECT_TRUE(absl::IsNotFound(Pick().status()));
}

TEST_F(VideoFrames, OtherInputsComeBackAsTheyAre) {
  input_.video_path.clear();
  input_.images_dir = "photos";
  EXPECT_EQ(Pick()->images_dir, "photos");
  EXPECT_TRUE(notes_.empty());
}

}  // namespace
}  // namespace litags
