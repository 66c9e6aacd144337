// litags-train as its user sees it: the program on a folder of photos.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/image.h"
#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
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
    const SubprocessResult result = RunProgram(LITAGS_TRAIN, arguments);
    return {result.exit_code, result.tail};
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
  EXPECT_THAT(outcome.text, HasSubstr("7 photos would be used, 1 is left out"));
  EXPECT_THAT(outcome.text, HasSubstr(bad + " is left out"));
  EXPECT_THAT(outcome.text, HasSubstr("old.bmp"));
  EXPECT_FALSE(fs::exists(out_ + "/scene.litags"));
  const Outcome without_out = RunAlone({photos, "--inspect"});
  EXPECT_EQ(without_out.exit_code, 0) << without_out.text;
  EXPECT_THAT(without_out.text, HasSubstr("7 photos would be used"));
  const Outcome nowhere = RunAlone({photos});
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.text, HasSubstr("--output is not given; litags-train --help says"));
  const Outcome both = Run({photos, "--sfm", "--cameras", scene_ + "/sparse"});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.text, HasSubstr("--cameras and --sfm exclude each other"));
  const Outcome no_video = Run({scene_ + "/none.mp4"});
  EXPECT_EQ(no_video.exit_code, 2);
  EXPECT_THAT(no_video.text, HasSubstr("none.mp4: there is no such file"));
  const Outcome strict = Run({photos, "--strict", "--cameras", scene_ + "/sparse"});
  EXPECT_EQ(strict.exit_code, 2);
  EXPECT_THAT(strict.text, HasSubstr("PHOTO_UNREADABLE"));
  EXPECT_THAT(strict.text, HasSubstr(bad));
}

TEST_F(TrainProgramTest, OptionsWithoutEffectAreRefused) {
  const std::string photos = scene_ + "/low";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--frames", "20"}, "--frames is for videos"},
      {{"--depth-model", "net.onnx"}, "--depth-model would not be used"},
      {{"--depth", photos, "--depth-source", "stereo"}, "--depth would not be used"},
      {{"--depth", photos, "--method", "3dgs"}, "--depth would not be used"},
      {{"--depth-source", "stereo", "--method", "3dgs"}, "--depth-source would not be used"},
      {{"--white-balance", "camera", "--method", "3dgs"}, "--white-balance would not be used"},
      {{"--white-balance", "camera", "--tone", "paper"}, "--white-balance would not be used"},
      {{"--truth", scene_ + "/high"}, "--truth is for test views"}};
  for (auto [arguments, words] : cases) {
    arguments.insert(arguments.begin(), photos);
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << words;
    EXPECT_THAT(outcome.text, HasSubstr(words));
    EXPECT_THAT(outcome.text, HasSubstr("OPTION_UNUSED"));
  }
  const Outcome held_out = Run({scene_, "--light", "low", "--holdout-every", "4"});
  EXPECT_EQ(held_out.exit_code, 2);
  EXPECT_THAT(held_out.text, HasSubstr("--holdout-every would not be used"));
  EXPECT_FALSE(fs::exists(out_));
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

  // Cameras are found in the folder of a capture, too.
  WriteTrainingCameras(scene_, dir_ / "given/sparse/0");
  const Outcome scored = Run({scene_ + "/low", "--cameras", dir_ / "given", "--render-poses", poses,
                              "--truth", scene_ + "/high"});
  ASSERT_EQ(scored.exit_code, 0) << scored.text;
  EXPECT_THAT(scored.text, HasSubstr("renders, mean of 2 test views: PSNR"));
}

// They may be of another world than the cameras, and were trained on.
TEST_F(TrainProgramTest, WithoutALightTestViewsBesideThePhotosAreNotScored) {
  const std::string photos = scene_ + "/low";
  fs::copy_file(scene_ + "/transforms_test.json", photos + "/transforms_test.json");
  fs::copy(scene_ + "/high", photos + "/high");
  const Outcome outcome = Run({photos, "--cameras", scene_ + "/sparse"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, Not(HasSubstr("test views")));
  EXPECT_FALSE(fs::exists(out_ + "/test") || fs::exists(out_ + "/evaluation.json"));
  const Outcome truth = Run({photos, "--cameras", scene_ + "/sparse", "--truth", scene_ + "/high"});
  EXPECT_EQ(truth.exit_code, 2);
  EXPECT_THAT(truth.text, HasSubstr("--truth is for test views, and there are none"));
}

TEST_F(TrainProgramTest, PosesWithoutCamerasAreRefused) {
  const std::string poses = scene_ + "/transforms_test.json";
  const Outcome outcome = Run({scene_ + "/low", "--render-poses", poses});
  EXPECT_EQ(outcome.exit_code, 2);
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
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("high, low, over_exp; name one with --light"));
}

TEST_F(TrainProgramTest, AFolderOfFoldersIsAnsweredWithThem) {
  fs::create_directory(dir_ / "DCIM");
  fs::rename(scene_ + "/low", dir_ / "DCIM/b");
  fs::rename(scene_ + "/high", dir_ / "DCIM/a");
  const Outcome outcome = Run({dir_ / "DCIM"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text,
              HasSubstr("did you mean " + dir_ / "DCIM/a" + ", " + dir_ / "DCIM/b" + "?"));
}

TEST_F(TrainProgramTest, AFolderOfADatasetIsUsedWithItsCameras) {
  const std::string dataset = dir_ / "dataset";
  fs::create_directories(dataset + "/sparse");
  fs::rename(scene_ + "/low", dataset + "/images");
  fs::rename(scene_ + "/high", dataset + "/images_2");
  fs::rename(scene_ + "/sparse", dataset + "/sparse/0");
  const Outcome outcome = Run({dataset, "--inspect"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("cameras: " + dataset + "/sparse/0"));
  EXPECT_THAT(outcome.text, HasSubstr("not used: images_2/"));
  const Outcome sfm = Run({dataset, "--inspect", "--sfm"});
  EXPECT_THAT(sfm.text, HasSubstr("cameras would be searched for"));
}

TEST_F(TrainProgramTest, TooFewPhotosAreBadInput) {
  fs::create_directory(dir_ / "one");
  fs::rename(scene_ + "/low/0001.JPG", dir_ / "one/0001.JPG");
  for (const Outcome& outcome : {Run({dir_ / "one"}), Run({dir_ / "one", "--inspect"})}) {
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.text, HasSubstr("images: 1 photo; a scene needs at least 3"));
    EXPECT_THAT(outcome.text, HasSubstr("reason TOO_FEW_PHOTOS"));
  }
}

// Pictures of both runs lay in views/, with the scores of the first.
TEST_F(TrainProgramTest, ASecondRunReplacesWhatTheFirstWrote) {
  WriteTrainingCameras(scene_, dir_ / "cameras");
  const Outcome first = Run({scene_, "--light", "low", "--cameras", dir_ / "cameras"});
  ASSERT_EQ(first.exit_code, 0) << first.text;
  EXPECT_THAT(first.text, Not(HasSubstr("earlier run")));
  ASSERT_TRUE(WriteFileAtomically(out_ + "/views/mine.txt", "x").ok());
  for (const char* folder : {"/views/", "/test/"}) {
    ASSERT_TRUE(WriteFileAtomically(out_ + folder + "mine.png", "x").ok());
  }
  ASSERT_TRUE(fs::exists(out_ + "/evaluation.json") && fs::exists(out_ + "/views/0001.png"));

  fs::remove(scene_ + "/low/0001.JPG");
  const Outcome second = Run({scene_ + "/low", "--cameras", scene_ + "/sparse"});
  ASSERT_EQ(second.exit_code, 0) << second.text;
  EXPECT_THAT(second.text, HasSubstr("note: " + out_ + " holds the scene of an earlier run"));
  EXPECT_FALSE(fs::exists(out_ + "/views/0001.png"));
  EXPECT_TRUE(fs::exists(out_ + "/views/0002.png"));
  EXPECT_TRUE(fs::exists(out_ + "/views/mine.txt"));
  EXPECT_TRUE(fs::exists(out_ + "/views/mine.png") && fs::exists(out_ + "/test/mine.png"));
  EXPECT_FALSE(fs::exists(out_ + "/test/0003.png"));
  EXPECT_FALSE(fs::exists(out_ + "/evaluation.json"));
}

// A picture of the user's was written over, and folders of the user's were deleted.
TEST_F(TrainProgramTest, FilesOfTheUsersInAFolderThatARunWritesIntoAreRefusedAndStay) {
  for (const char* folder : {"/views", "/test", "/photos"}) {
    const std::string mine = out_ + folder + "/0001.png";
    fs::create_directories(out_ + folder);
    ASSERT_TRUE(WriteFileAtomically(mine, "mine").ok());
    const Outcome outcome = Run({scene_ + "/low", "--cameras", scene_ + "/sparse"});
    EXPECT_EQ(outcome.exit_code, 2) << folder;
    EXPECT_THAT(outcome.text, HasSubstr("FOLDER_NOT_OURS"));
    EXPECT_THAT(outcome.text, HasSubstr(out_ + folder));
    EXPECT_EQ(ReadFile(mine, "", 9).value(), "mine");
    fs::remove_all(out_ + folder);
  }
  EXPECT_TRUE(fs::is_empty(out_));
}

// It was said after the training, and the program ended with 0.
TEST_F(TrainProgramTest, ATruthThatCannotScoreIsRefused) {
  WriteTrainingCameras(scene_, dir_ / "cameras");
  fs::create_directory(dir_ / "empty");
  fs::create_directory(dir_ / "other");
  fs::copy_file(scene_ + "/high/0001.JPG", dir_ / "other/0001.JPG");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"no_such", "NO_SUCH_FOLDER"}, {"empty", "NO_PHOTOS"}, {"other", "NO_TRUTH"}};
  for (const auto& [truth, reason] : cases) {
    const Outcome outcome =
        Run({scene_, "--light", "low", "--cameras", dir_ / "cameras", "--truth", dir_ / truth});
    EXPECT_EQ(outcome.exit_code, 2) << truth;
    EXPECT_THAT(outcome.text, HasSubstr(reason));
    EXPECT_THAT(outcome.text, HasSubstr("--truth"));
  }
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(TrainProgramTest, AnInterruptedRunSaysHowToGoOn) {
  // In the foreground, or timeout signals twice: a second signal ends the program without a word.
  const SubprocessResult result =
      RunProgram("timeout", {"--preserve-status", "--foreground", "--signal=INT", "3", LITAGS_TRAIN,
                             scene_ + "/low", "--cameras", scene_ + "/sparse", "-o", out_,
                             "--iterations", "900000", "--threads", "1"});
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.tail, HasSubstr("cancelled on request; run the same command to go on"));
}

TEST_F(TrainProgramTest, AnOutputFolderThatCannotBeMadeIsNamed) {
  ASSERT_TRUE(WriteFileAtomically(dir_ / "file", "x").ok());
  const Outcome outcome = RunAlone({scene_ + "/low", "--output", dir_ / "file/out"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.text, HasSubstr("cannot make " + dir_ / "file/out"));
  EXPECT_THAT(outcome.text, HasSubstr("; choose a folder that can be written"));
  EXPECT_THAT(outcome.text, HasSubstr("BAD_OUTPUT"));
}

}  // namespace
}  // namespace litags
