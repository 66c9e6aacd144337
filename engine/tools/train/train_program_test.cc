// litags-train as its user sees it: the program on a folder of photos.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/subprocess.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/tools/table/lom_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class TrainProgramTest : public testing::Test {
 protected:
  void SetUp() override { WriteLomScene(scene_); }

  struct Outcome {
    int exit_code = 0;
    std::string text;
  };
  Outcome Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"-o", out_, "--iterations", "30", "--threads", "1"});
    return RunAlone(arguments);
  }
  static Outcome RunAlone(const std::vector<std::string>& arguments) {
    SubprocessOptions child;
    child.args = {LITAGS_TRAIN};
    child.args.insert(child.args.end(), arguments.begin(), arguments.end());
    child.tail_lines = 1000;
    const auto result = RunSubprocess(child, CancelToken());
    EXPECT_TRUE(result.ok()) << result.status();
    return {result->exit_code, result->tail};
  }

  TempDir dir_;
  const std::string scene_ = dir_ / "room", out_ = dir_ / "out";
};

TEST_F(TrainProgramTest, InspectingSaysWhatIsUsedAndStrictRefusesWhatCannotBeRead) {
  const std::string photos = scene_ + "/low";
  const auto names = ListPhotos(photos, "photos");
  ASSERT_TRUE(names.ok() && names->size() > 4);
  const std::string& bad = (*names)[1];
  ASSERT_TRUE(WriteFileAtomically(photos + "/" + bad, "no photo").ok());
  ASSERT_TRUE(WriteFileAtomically(photos + "/old.bmp", "x").ok());
  const Outcome outcome = Run({photos, "--inspect", "--cameras", scene_ + "/sparse"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("7 photos would be used, 1 are left out"));
  EXPECT_THAT(outcome.text, HasSubstr(bad + " is left out"));
  EXPECT_THAT(outcome.text, HasSubstr("old.bmp"));
  EXPECT_FALSE(fs::exists(out_ + "/scene.litags"));
  const Outcome without_out = RunAlone({photos, "--inspect"});
  EXPECT_EQ(without_out.exit_code, 0) << without_out.text;
  EXPECT_THAT(without_out.text, HasSubstr("7 photos would be used"));
  const Outcome nowhere = RunAlone({photos});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.text, HasSubstr("--out is required"));
  const Outcome strict = Run({photos, "--strict", "--cameras", scene_ + "/sparse"});
  EXPECT_EQ(strict.exit_code, 1);
  EXPECT_THAT(strict.text, HasSubstr("PHOTO_UNREADABLE"));
  EXPECT_THAT(strict.text, HasSubstr(bad));
}

TEST_F(TrainProgramTest, EveryPhotoGetsAPictureInNormalLight) {
  const Outcome outcome = Run({scene_ + "/low", "--cameras", scene_ + "/sparse"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto photos = ListPhotos(scene_ + "/low", "photos");
  ASSERT_TRUE(photos.ok()) << photos.status();
  ASSERT_EQ(photos->size(), 8u);
  for (const std::string& photo : *photos) {
    const auto dark = ReadImage(scene_ + "/low/" + photo, photo);
    const auto view = ReadImage(out_ + "/views/" + Stem(photo) + ".png", photo);
    ASSERT_TRUE(dark.ok() && view.ok()) << view.status();
    EXPECT_EQ(view->width, dark->width);
    EXPECT_EQ(view->height, dark->height);
    const auto mean = [](const ImageU8& image) {
      double sum = 0;
      for (const uint8_t byte : image.data) sum += byte;
      return sum / static_cast<double>(image.data.size());
    };
    EXPECT_GT(mean(*view), 2 * mean(*dark)) << photo;
  }
}

TEST_F(TrainProgramTest, ABlackTestPhotoCostsOnlyItsOwnComparison) {
  const std::string cameras = dir_ / "cameras";
  WriteTrainingCameras(scene_, cameras);
  const auto test = ReadCameras(scene_ + "/transforms_test.json", "test");
  ASSERT_TRUE(test.ok()) << test.status();
  const std::string black = test->views[0].name;
  ASSERT_TRUE(WriteJpeg(scene_ + "/low/" + black, ImageU8(64, 48)).ok());

  const Outcome outcome = Run({scene_, "--light", "low", "--cameras", cameras});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr(black + " is all black"));
  EXPECT_THAT(outcome.text, HasSubstr("brightened photos, mean of 1 test views"));
  EXPECT_THAT(outcome.text, HasSubstr("6 of 6 photos placed (given), test views: 2,"));
  EXPECT_TRUE(fs::exists(out_ + "/evaluation.json"));
}

TEST_F(TrainProgramTest, ASceneFromRealDarknessGetsRendersOfItsTestViews) {
  LeaveInTheDark(scene_, /*truth=*/false);
  WriteTrainingCameras(scene_, dir_ / "cameras");
  const Outcome outcome = Run({scene_, "--light", "low", "--cameras", dir_ / "cameras"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("2 test views rendered into " + out_ + "/test; there is no"));
  EXPECT_THAT(outcome.text, HasSubstr("6 of 6 photos placed (given), "));
  for (const char* view : {"0003", "0007"}) {
    const auto picture = ReadImage(out_ + "/test/" + view + ".png", view);
    ASSERT_TRUE(picture.ok()) << picture.status();
    EXPECT_EQ(picture->width, 64);
  }
  EXPECT_FALSE(fs::exists(out_ + "/evaluation.json"));
}

TEST_F(TrainProgramTest, PosesAreRenderedAndScoredWhereThereIsATruth) {
  LeaveInTheDark(scene_, /*truth=*/true);
  WriteTrainingCameras(scene_, dir_ / "cameras");
  const std::string poses = scene_ + "/transforms_test.json";
  const Outcome outcome =
      Run({scene_ + "/low", "--cameras", dir_ / "cameras", "--render-poses", poses});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("2 test views rendered into"));
  // Nothing is held out of six photos: the poses are what is looked at.
  EXPECT_THAT(outcome.text, Not(HasSubstr("held-out")));
  EXPECT_TRUE(fs::exists(out_ + "/test/0003.png"));

  const Outcome scored = Run({scene_ + "/low", "--cameras", dir_ / "cameras", "--render-poses",
                              poses, "--truth", scene_ + "/high"});
  ASSERT_EQ(scored.exit_code, 0) << scored.text;
  EXPECT_THAT(scored.text, HasSubstr("renders, mean of 2 test views: PSNR"));
}

TEST_F(TrainProgramTest, PosesWithoutCamerasAreRefused) {
  const std::string poses = scene_ + "/transforms_test.json";
  const Outcome outcome = Run({scene_ + "/low", "--render-poses", poses});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("POSES_WITHOUT_CAMERAS"));
  EXPECT_THAT(outcome.text, HasSubstr("--cameras"));
}

TEST_F(TrainProgramTest, BadUsageEndsWith2) {
  EXPECT_EQ(Run({scene_, "--tone", "linear"}).exit_code, 2);
  EXPECT_EQ(Run({scene_, "--frobnicate"}).exit_code, 2);
  EXPECT_EQ(Run({"--help"}).exit_code, 0);
}

TEST_F(TrainProgramTest, ASceneWithoutALightIsAnsweredWithTheLightsThereAre) {
  const Outcome outcome = Run({scene_});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.text, HasSubstr("high, low, over_exp; name one with --light"));
}

}  // namespace
}  // namespace litags
