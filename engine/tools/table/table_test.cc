// The table as its user sees it: the program on a capture in LOM's layout.
#include "engine/tools/table/table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/image.h"
#include "engine/core/mask.h"
#include "engine/core/run_program_test_util.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/onnx/onnx_writer.h"
#include "engine/tools/table/lom_test_util.h"

namespace litags {
namespace {

using Json = nlohmann::json;

// A network that gives `channels` channels of three times its input.
std::string Times3(int channels) { return ScalingModel(48, 64, channels, 3, 0); }

// How the cameras in `dir` are said to have been found; true if it was `name` already.
bool ReplacePreparation(const std::string& dir, const std::string& name) {
  const std::string path = dir + "/registration.json";
  const auto text = ReadFile(path, path, 1 << 20);
  EXPECT_TRUE(text.ok()) << text.status();
  Json json = Json::parse(text.value_or("{}"));
  const bool same = json["preparation"] == name;
  json["preparation"] = name;
  EXPECT_TRUE(WriteFileAtomically(path, json.dump()).ok());
  return same;
}

class TableTest : public testing::Test {
 protected:
  // The folder that a download of LOM leaves.
  static void SetUpTestSuite() {
    lom_ = new TempDir;
    std::filesystem::create_directories(*lom_ / "LOM_full");
    WriteLomScene(*lom_ / "LOM_full/room");
  }
  static void TearDownTestSuite() { delete lom_; }

  struct Outcome {
    int exit_code = 0;
    std::string text;
    Json rows;
  };
  Outcome Run(const std::vector<std::string>& more) { return Run(more, *lom_ / "LOM_full"); }
  Outcome Run(const std::vector<std::string>& more, const std::string& scenes) {
    std::vector<std::string> arguments = {"table", "--iterations", "30",    "--threads",
                                          "1",     "--sparse",     "sparse"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    // Scenes may stand behind options.
    arguments.insert(arguments.end(), {scenes, "-o", out_ / "out"});
    const SubprocessResult result = RunProgram(LITAGS_BENCH, arguments);
    const auto json = ReadFile(out_ / "out/table.json", "table", 1 << 20);
    return {result.exit_code, result.tail, json.ok() ? Json::parse(*json) : Json::array()};
  }
  static Json Row(const Outcome& outcome, const std::string& light, const std::string& method) {
    for (const Json& row : outcome.rows) {
      if (row["light"] == light && row["method"] == method) return row;
    }
    ADD_FAILURE() << "no row " << light << " " << method << "\n" << outcome.text;
    return {};
  }
  bool Exists(const std::string& path) { return std::filesystem::exists(out_ / ("out/" + path)); }

  static TempDir* lom_;
  TempDir out_;
};
TempDir* TableTest::lom_ = nullptr;

TEST_F(TableTest, EveryMethodGetsARowAndPicturesUnderEveryLight) {
  ASSERT_TRUE(WriteFileAtomically(out_ / "mine.onnx", Times3(3)).ok());
  ASSERT_TRUE(WriteFileAtomically(out_ / "lpips.onnx", SquaredDifferenceModel(48, 64)).ok());
  const std::vector<std::string> arguments = {
      "--light",    "low,over_exp",
      "--methods",  "3dgs-normal,3dgs,3dgs+mine,light-gain+3dgs,litags",
      "--enhancer", "mine=" + (out_ / "mine.onnx"),
      "--lpips",    out_ / "lpips.onnx",
      "--flicker",  "5"};
  const Outcome outcome = Run(arguments);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  ASSERT_EQ(outcome.rows.size(), 10u);
  for (const Json& row : outcome.rows) {
    SCOPED_TRACE(row.dump());
    EXPECT_EQ(row["scene"], "room");
    EXPECT_GT(row["psnr"].get<double>(), 3);
    EXPECT_GE(row["psnr_affine"].get<double>(), row["psnr"].get<double>() - 1e-6);
    EXPECT_GT(row["ssim"].get<double>(), -1);
    EXPECT_GT(row["lpips"].get<double>(), 0);
    EXPECT_GT(row["flicker"].get<double>(), 0);
    EXPECT_LT(row["flicker"].get<double>(), 0.3);
    // Depth is rough after 30 iterations, and pixels count only where surfaces are smooth: few do.
    EXPECT_GT(row["flicker_share"].get<double>(), 0);
    EXPECT_GT(row["path_contrast"].get<double>(), 0.001);
    EXPECT_GT(row["seconds"].get<double>(), 0);
    EXPECT_EQ(row["iterations"], 30);
    EXPECT_GT(row["gaussians"].get<int>(), 100);
    EXPECT_GT(row["peak_rss_bytes"].get<int64_t>(), int64_t{10} << 20);
    EXPECT_EQ(row["views"], 2);
    EXPECT_TRUE(row["error"].is_null());
  }
  // 3dgs-normal does not depend on the light; in the dark it is far above plain 3DGS, whose renders
  // are dark, and an enhancer helps.
  const Json normal = Row(outcome, "low", "3dgs-normal"), dark = Row(outcome, "low", "3dgs");
  EXPECT_EQ(normal["psnr"], Row(outcome, "over_exp", "3dgs-normal")["psnr"]);
  EXPECT_GT(normal["psnr"].get<double>(), dark["psnr"].get<double>() + 3);
  EXPECT_GT(Row(outcome, "low", "3dgs+mine")["psnr"].get<double>(), dark["psnr"].get<double>());
  EXPECT_EQ(Row(outcome, "low", "3dgs+mine")["gaussians"], dark["gaussians"]);
  // The same path, with every frame three times as bright.
  EXPECT_GT(Row(outcome, "low", "3dgs+mine")["flicker"].get<double>(),
            2 * dark["flicker"].get<double>());
  EXPECT_GT(Row(outcome, "low", "light-gain+3dgs")["psnr"].get<double>(),
            dark["psnr"].get<double>() + 3);

  for (const char* file : {"table.md", "table.csv", "room_low.png", "room_over_exp.png",
                           "runs/room/low/litags/scene.litags", "runs/room/low/litags/log.txt"}) {
    EXPECT_TRUE(Exists(file)) << file;
  }
  const std::string csv = ReadFile(out_ / "out/table.csv", "", 1 << 20).value();
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 11);
  const auto sheet = ReadImage(out_ / "out/room_low.png", "sheet");
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_GT(sheet->height, 7 * 200);  // input, five methods, truth

  // Again: nothing is trained, the rows are the same.
  const Outcome again = Run(arguments);
  EXPECT_EQ(again.rows, outcome.rows);
  size_t kept = 0;
  for (size_t at = again.text.find(": kept"); at != std::string::npos;
       at = again.text.find(": kept", at + 1)) {
    ++kept;
  }
  EXPECT_EQ(kept, 10u) << again.text;
}

// As in scenes of realx3d: the test views have no dark photo, and few scenes a truth.
TEST_F(TableTest, ScenesFromRealDarknessAreRenderedAndScoredWhereThereIsATruth) {
  WriteLomScene(out_ / "dark/blind");
  LeaveInTheDark(out_ / "dark/blind", /*truth=*/false);
  WriteLomScene(out_ / "dark/lit");
  LeaveInTheDark(out_ / "dark/lit", /*truth=*/true);
  ASSERT_TRUE(WriteFileAtomically(out_ / "mine.onnx", Times3(3)).ok());
  const std::vector<std::string> arguments = {
      "--light",    "low",
      "--methods",  "3dgs-normal,3dgs,3dgs+mine,mine+3dgs,litags",
      "--enhancer", "mine=" + (out_ / "mine.onnx")};
  const Outcome outcome = Run(arguments, out_ / "dark");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  ASSERT_EQ(outcome.rows.size(), 8u) << outcome.text;
  EXPECT_NE(outcome.text.find("lit/low/3dgs-normal: left out"), std::string::npos) << outcome.text;
  for (const Json& row : outcome.rows) {
    SCOPED_TRACE(row.dump());
    EXPECT_TRUE(row["error"].is_null());
    EXPECT_GT(row["gaussians"].get<int>(), 100);
    const bool lit = row["scene"] == "lit";
    EXPECT_EQ(row["views"], lit ? 2 : 0);
    for (const char* figure : {"psnr", "ssim", "psnr_affine"}) {
      EXPECT_EQ(row[figure].is_number(), lit) << figure;
    }
    const std::string run = "runs/" + row["scene"].get<std::string>() + "/low/" +
                            row["method"].get<std::string>() + "/";
    for (const char* view : {"0003.png", "0007.png"}) {
      EXPECT_TRUE(Exists(run + "test/" + view)) << run;
      EXPECT_EQ(Exists(run + "error/" + view), lit) << run;
    }
  }
  const std::string markdown = ReadFile(out_ / "out/table.md", "", 1 << 20).value();
  EXPECT_NE(markdown.find("no figures: blind."), std::string::npos) << markdown;
  EXPECT_TRUE(Exists("blind_low.png"));
  const Outcome again = Run(arguments, out_ / "dark");
  EXPECT_EQ(again.rows, outcome.rows);
}

TEST_F(TableTest, PicturesAreOfTheSizeThatIsTrained) {
  WriteLomScene(out_ / "large/room", 128, 96);
  const Outcome outcome =
      Run({"--light", "low", "--methods", "3dgs", "--max-image-side", "64"}, out_ / "large");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_TRUE(Row(outcome, "low", "3dgs")["psnr"].is_number());
  for (const char* folder : {"test", "error"}) {
    const auto picture =
        ReadImage(out_ / ("out/runs/room/low/3dgs/" + std::string(folder) + "/0003.png"), "test");
    ASSERT_TRUE(picture.ok()) << picture.status();
    EXPECT_EQ(picture->width, 64);
    EXPECT_EQ(picture->height, 48);
  }
}

TEST_F(TableTest, EveryAblationMovesThePicture) {
  const std::vector<std::string> changes = {"litags-no-noise-filter", "litags-no-depth",
                                            "litags-no-noise-filter-depth", "litags-with-pdm",
                                            "litags-prior-geometry"};
  const std::vector<std::string> paper = {"litags-paper-no-pdm", "litags-paper-no-depth",
                                          "litags-paper-no-prior", "litags-paper-none"};
  std::string methods = "litags,litags-paper";
  for (const auto& list : {changes, paper}) {
    for (const std::string& name : list) methods += "," + name;
  }
  const Outcome outcome = Run({"--light", "low", "--methods", methods});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const auto psnr = [&](const std::string& name) {
    return Row(outcome, "low", name)["psnr"].get<double>();
  };
  for (const std::string& name : changes) EXPECT_NE(psnr(name), psnr("litags")) << name;
  for (const std::string& name : paper) EXPECT_NE(psnr(name), psnr("litags-paper")) << name;
}

TEST_F(TableTest, WhatFailsIsARowThatSaysWhyAndIsTriedAgain) {
  ASSERT_TRUE(WriteFileAtomically(out_ / "bad.onnx", Times3(1)).ok());
  const std::vector<std::string> arguments = {
      "--light", "low", "--methods", "3dgs,bad+3dgs", "--enhancer", "bad=" + (out_ / "bad.onnx")};
  const Outcome outcome = Run(arguments);
  EXPECT_EQ(outcome.exit_code, 1);
  ASSERT_EQ(outcome.rows.size(), 2u) << outcome.text;
  EXPECT_TRUE(Row(outcome, "low", "3dgs")["error"].is_null());
  const Json bad = Row(outcome, "low", "bad+3dgs");
  EXPECT_NE(bad["error"].get<std::string>().find("1 channels"), std::string::npos) << bad.dump();
  EXPECT_TRUE(bad["psnr"].is_null());
  const std::string markdown = ReadFile(out_ / "out/table.md", "", 1 << 20).value();
  EXPECT_NE(markdown.find("no network given"), std::string::npos);
  EXPECT_NE(markdown.find("## Failed"), std::string::npos);

  ASSERT_TRUE(WriteFileAtomically(out_ / "bad.onnx", Times3(3)).ok());
  const Outcome mended = Run(arguments);
  EXPECT_TRUE(Row(mended, "low", "bad+3dgs")["error"].is_null()) << mended.text;
  EXPECT_NE(mended.text.find("room/low/3dgs: kept"), std::string::npos) << mended.text;
}

TEST_F(TableTest, AChangedPhotoOfTheSameSizeIsTrainedAnew) {
  const std::string scenes = out_ / "changed";
  WriteLomScene(scenes + "/room");
  const std::vector<std::string> arguments = {"--light", "low", "--methods", "3dgs"};
  ASSERT_EQ(Run(arguments, scenes).exit_code, 0);
  // A training photo, then the truth of a test view: their density, which nobody reads.
  for (const char* name : {"/room/low/0001.JPG", "/room/high/0003.JPG"}) {
    std::string bytes = ReadFile(scenes + name, name, 1 << 20).value();
    bytes[15] ^= 1;
    ASSERT_TRUE(WriteFileAtomically(scenes + name, bytes).ok());
    const Outcome changed = Run(arguments, scenes);
    ASSERT_EQ(changed.exit_code, 0) << changed.text;
    EXPECT_EQ(changed.text.find(": kept"), std::string::npos) << name << changed.text;
  }
  EXPECT_NE(Run(arguments, scenes).text.find("room/low/3dgs: kept"), std::string::npos);
  // A truth whose name has another ending than in transforms_test.json.
  const std::string truth = scenes + "/room/high/0003.";
  ASSERT_TRUE(WritePng(truth + "png", ReadImage(truth + "JPG", "truth").value()).ok());
  std::filesystem::remove(truth + "JPG");
  ASSERT_EQ(Run(arguments, scenes).text.find(": kept"), std::string::npos);
  ASSERT_TRUE(WritePng(truth + "png", ImageU8(64, 48)).ok());
  const Outcome black = Run(arguments, scenes);
  EXPECT_EQ(black.text.find(": kept"), std::string::npos) << black.text;
}

TEST_F(TableTest, ATestCameraThatMovedIsScoredAnew) {
  const std::string scenes = out_ / "moved", sparse = scenes + "/room/sparse";
  WriteLomScene(scenes + "/room");
  const std::vector<std::string> arguments = {"--light", "low", "--methods", "3dgs"};
  // Written again before the first run, so that the test camera alone differs in the second.
  SparseModel model = ReadColmapModel(sparse, "sparse").value();
  ASSERT_TRUE(WriteColmapModel(sparse, model).ok());
  const Outcome first = Run(arguments, scenes);
  ASSERT_EQ(first.exit_code, 0) << first.text;
  for (View& view : model.views) {
    if (view.name == "0003.JPG") view.camera.t[0] += 0.3;
  }
  ASSERT_TRUE(WriteColmapModel(sparse, model).ok());
  const Outcome moved = Run(arguments, scenes);
  EXPECT_EQ(moved.text.find(": kept"), std::string::npos) << moved.text;
  EXPECT_NE(Row(moved, "low", "3dgs")["psnr"], Row(first, "low", "3dgs")["psnr"]);
  EXPECT_NE(Run(arguments, scenes).text.find("room/low/3dgs: kept"), std::string::npos);
}

// Its CPU seconds are those of a whole run, and another program may have made what was kept.
TEST_F(TableTest, ARowDoneAnewUsesNothingThatAnEarlierRunKept) {
  const std::vector<std::string> kept = {"depth.litags", "start.litags"};
  const auto file = [&](const std::string& name) {
    return std::filesystem::path(out_ / ("out/runs/room/low/litags/" + name));
  };
  ASSERT_EQ(Run({"--light", "low", "--methods", "litags"}).exit_code, 0);
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(24);
  for (const std::string& name : kept) {
    ASSERT_TRUE(std::filesystem::exists(file(name))) << name;
    std::filesystem::last_write_time(file(name), long_ago);
  }
  const Outcome anew = Run({"--light", "low", "--methods", "litags", "--set", "lr_scales=0.011"});
  ASSERT_EQ(anew.exit_code, 0) << anew.text;
  for (const std::string& name : kept) {
    ASSERT_TRUE(std::filesystem::exists(file(name))) << name;
    EXPECT_GT(std::filesystem::last_write_time(file(name)), long_ago + std::chrono::hours(1))
        << name;
  }
}

// As litags-train does, and photos keep theirs when they are enhanced.
TEST_F(TableTest, MasksBesideThePhotosAreUsedByEveryMethod) {
  const std::string room = out_ / "masked/room";
  WriteLomScene(room);
  WriteTrainingCameras(room, out_ / "cameras");
  std::filesystem::create_directory(room + "/low/masks");
  PlaneU8 mask(64, 48);
  std::fill_n(mask.data.begin(), mask.data.size() / 2, kCounts);
  const std::string png = EncodeMask(mask).value();
  ASSERT_TRUE(WriteFileAtomically(room + "/low/masks/0001.JPG.png", png).ok());
  ASSERT_TRUE(WriteFileAtomically(room + "/low/0002_mask.png", png).ok());
  const std::vector<std::string> arguments = {"--light", "low", "--methods",
                                              "3dgs,light-gain+3dgs"};
  const Outcome outcome = Run(arguments, out_ / "masked");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  for (const char* method : {"3dgs", "light-gain+3dgs"}) {
    const std::string log = out_ / ("out/runs/room/low/" + std::string(method) + "/log.txt");
    EXPECT_NE(ReadFile(log, log, 1 << 20)->find("2 of 6 photos have a mask"), std::string::npos)
        << method << outcome.text;
  }
  // A mask that changes, or goes, makes another scene.
  std::filesystem::remove(room + "/low/0002_mask.png");
  EXPECT_EQ(Run(arguments, out_ / "masked").text.find(": kept"), std::string::npos);

  const SubprocessResult trained = RunProgram(
      LITAGS_BENCH,
      {"train", room, "-o", out_ / "run", "--iterations", "2", "--cameras", out_ / "cameras"});
  EXPECT_EQ(trained.exit_code, 0) << trained.tail;
  EXPECT_NE(trained.tail.find("masks: those in"), std::string::npos) << trained.tail;
}

// Cameras of a phone write a RAW's preview, or an edited photo, beside the photo.
TEST_F(TableTest, PhotosOfOneStemAreAllEnhancedAndShown) {
  const std::string room = out_ / "twice/room";
  WriteLomScene(room);
  // A training photo and a test view.
  const std::map<std::string, std::string> renamed = {{"0002.JPG", "0001.png"},
                                                      {"0007.JPG", "0003.png"}};
  const auto rename = [&](std::vector<View>& views) {
    for (View& view : views) {
      if (const auto to = renamed.find(view.name); to != renamed.end()) view.name = to->second;
    }
  };
  SparseModel sparse = ReadColmapModel(room + "/sparse", "sparse").value();
  rename(sparse.views);
  ASSERT_TRUE(WriteColmapModel(room + "/sparse", sparse).ok());
  const std::string path = room + "/transforms_test.json";
  SparseModel test = ReadCameras(path, "test").value();
  rename(test.views);
  ASSERT_TRUE(WriteTransforms(path, test, "low").ok());
  for (const std::string light : {"/low/", "/high/"}) {
    for (const auto& [from, to] : renamed) {
      const ImageU8 photo = ReadImage(room + light + from, from).value();
      ASSERT_TRUE(WritePng(room + light + to, photo).ok());
      std::filesystem::remove(room + light + from);
    }
  }
  const Outcome outcome = Run({"--light", "low", "--methods", "light-gain+3dgs"}, out_ / "twice");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.text;
  const std::string enhanced = out_ / "out/runs/room/low/light-gain+3dgs/enhanced";
  EXPECT_EQ(ListPhotos(enhanced, "enhanced")->size(), 6u);
  for (const char* folder :
       {"runs/room/low/light-gain+3dgs/test/", "runs/room/low/light-gain+3dgs/error/",
        "photos/room/low/", "photos/room/truth/"}) {
    for (const char* name : {"0003.JPG.png", "0003.png.png"}) {
      EXPECT_TRUE(Exists(absl::StrCat(folder, name))) << folder << name;
    }
  }
}

TEST_F(TableTest, ANetworkThatIsNotThereIsRefusedBeforeAnythingIsTrained) {
  for (const std::vector<std::string>& typo :
       {std::vector<std::string>{"--lpips", out_ / "typo.onnx"},
        std::vector<std::string>{"--enhancer", "mine=" + (out_ / "typo.onnx")}}) {
    std::vector<std::string> arguments = {"--light", "low", "--methods", "3dgs"};
    arguments.insert(arguments.end(), typo.begin(), typo.end());
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_NE(outcome.text.find("typo.onnx"), std::string::npos) << outcome.text;
    EXPECT_FALSE(Exists("runs"));
  }
}

TEST_F(TableTest, AMissingLightIsRefusedBeforeAnythingIsTrained) {
  const Outcome outcome = Run({"--light", "low,dark", "--methods", "3dgs"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.text.find("room/dark"), std::string::npos) << outcome.text;
  EXPECT_FALSE(Exists("runs"));
}

TEST_F(TableTest, AMeasuredRunBeginsAtTheBeginning) {
  std::vector<std::string> arguments = {"train",        *lom_ / "LOM_full/room",
                                        "-o",           out_ / "run",
                                        "--iterations", "20",
                                        "--threads",    "1",
                                        "--cameras",    out_ / "cameras"};
  WriteTrainingCameras(*lom_ / "LOM_full/room", out_ / "cameras");
  for (int run = 0; run < 2; ++run) {
    const SubprocessResult result = RunProgram(LITAGS_BENCH, arguments);
    EXPECT_EQ(result.exit_code, 0) << result.tail;
    EXPECT_EQ(result.tail.find("nan"), std::string::npos) << result.tail;
    EXPECT_FALSE(ReplacePreparation(out_ / "run/cameras", "kept"));
  }
  // Not even where the new cameras would be written.
  arguments.back() = out_ / "run/cameras";
  const SubprocessResult refused = RunProgram(LITAGS_BENCH, arguments);
  EXPECT_EQ(refused.exit_code, 2) << refused.tail;
  EXPECT_TRUE(std::filesystem::exists(out_ / "run/cameras/registration.json"));
}

TEST_F(TableTest, FreshCamerasAreMadeAnew) {
  const std::string cameras = out_ / "out/cameras/room/low/cameras";
  ASSERT_EQ(Run({"--light", "low", "--methods", "3dgs"}).exit_code, 0);
  EXPECT_FALSE(ReplacePreparation(cameras, "kept"));
  ASSERT_EQ(Run({"--light", "low", "--methods", "3dgs"}).exit_code, 0);
  EXPECT_TRUE(ReplacePreparation(cameras, "kept"));
  ASSERT_EQ(Run({"--light", "low", "--methods", "3dgs", "--fresh"}).exit_code, 0);
  EXPECT_FALSE(ReplacePreparation(cameras, "kept"));
}

TEST_F(TableTest, AnUnknownMethodIsRefusedWithAListOfThoseThatExist) {
  const Outcome outcome = Run({"--methods", "litags,4dgs"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_NE(outcome.text.find("4dgs"), std::string::npos);
  EXPECT_NE(outcome.text.find("clahe+3dgs"), std::string::npos);
}

}  // namespace
}  // namespace litags
