#include "engine/sfm/sfm.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/mask.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/transforms_io.h"
#include "engine/sfm/sfm_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST_F(SfmTest, ViewsAndTracksAreThoseOfThePhotosNotOfTheirCopies) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->exposure, Exposure::kLow);
  EXPECT_EQ(result->preparation, "gain + Gaussian 0.7 px");
  ASSERT_THAT(result->model.views, SizeIs(6));
  const View& view = result->model.views[2];
  EXPECT_EQ(view.name, "p2.png");
  EXPECT_EQ(view.camera.width, 128);
  EXPECT_DOUBLE_EQ(view.camera.fx, 100);
  EXPECT_DOUBLE_EQ(view.camera.cx, 64);
  EXPECT_DOUBLE_EQ(view.camera.t[0], 2);
  ASSERT_THAT(result->model.points, SizeIs(7));
  const TrackElement& seen = result->model.points[0].track[3];
  EXPECT_EQ(seen.view, 3);
  EXPECT_DOUBLE_EQ(seen.x, 20);
  EXPECT_DOUBLE_EQ(seen.y, 40);
  EXPECT_THAT(result->rungs, SizeIs(1));  // all placed: no further rung
  EXPECT_TRUE(result->notes.empty());
  EXPECT_THAT(result->model.paths, SizeIs(0));  // where the copies lie
}

// Same size, two lenses: every other photo says another focal length.
TEST_F(SfmTest, PhotosOfOneSizeAndFocalLengthShareACamera) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  for (const int i : {1, 3, 5}) {
    const std::string path = absl::StrCat(photos, "/p", i, ".png");
    const std::string jpeg = EncodeJpeg(ReadImage(path, "").value()).value();
    ASSERT_TRUE(WriteFileAtomically(path, WithJpegExif(jpeg, FocalBlock(52, 425, 100))).ok());
  }
  colmap_.On("mapper", "cp -r \"$room/images\" \"$room/images.log\"");
  const auto result = FindCameras(photos, colmap_.dir() + "/work", options_, cancel_);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->notes, Contains("2 cameras: 3 photos of 128x96, 3 photos of 128x96_52mm"));
  const std::string images = colmap_.dir() + "/work/sfm/0/images.log";
  EXPECT_TRUE(std::filesystem::exists(images + "/128x96/000002.png"));
  EXPECT_TRUE(std::filesystem::exists(images + "/128x96_52mm/000003.png"));
}

TEST_F(SfmTest, LensDistortionIsKeptWhereItShows) {
  SparseModel model = Model({0, 1, 2, 3, 4, 5}, 7);
  for (Distortion& distortion : model.distortions) distortion.k1 = -0.1;
  model.distortions[2].k1 = 1e-3;
  colmap_.AddModel(0, 0, model);
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->model.distortions[1].k1, -0.1);
  EXPECT_TRUE(result->model.distortions[2].IsZero());
  // At a corner, 80 px from the middle: f = 100 px, so 0.8 0.1 0.64 100.
  EXPECT_THAT(result->notes,
              ElementsAre("lens distortion of up to 5.1 px was found and is taken out of the "
                          "photos"));
}

TEST_F(SfmTest, ColmapGetsMasksOfTheCopies) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  ASSERT_TRUE(Find().ok());
  EXPECT_THAT(colmap_.Calls()[0], Not(HasSubstr("mask_path")));
  PlaneU8 mask(128, 96);
  std::fill(mask.data.begin() + 128 * 10, mask.data.end(), kCounts);
  options_.masks["p2.png"] = colmap_.dir() + "/mask.png";
  ASSERT_TRUE(WriteFileAtomically(options_.masks["p2.png"], EncodeMask(mask).value()).ok());
  colmap_.On("mapper", "cp -r \"$room/masks\" \"$room/masks.log\"");
  ASSERT_TRUE(Find().ok());
  EXPECT_THAT(colmap_.Calls(), Contains(HasSubstr("--ImageReader.mask_path " + colmap_.dir() +
                                                  "/work/sfm/0/masks")));
  const std::string masks = colmap_.dir() + "/work/sfm/0/masks.log";
  EXPECT_FALSE(std::filesystem::exists(masks + "/128x96/000001.png.png"))
      << "a photo without a mask has one";
  const auto copy = ReadImage(masks + "/128x96/000002.png.png", "mask");
  ASSERT_TRUE(copy.ok()) << copy.status();
  ASSERT_EQ(copy->width, 64);
  EXPECT_EQ(copy->pixel(30, 4)[0], 0);
  EXPECT_EQ(copy->pixel(30, 5)[0], 255);
}

TEST_F(SfmTest, ColmapIsCalledOnTheCpuWithinItsBounds) {
  options_.threads = 3;
  options_.seed = 11;
  options_.max_features = 500;
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  colmap_.On("mapper", "note $QT_QPA_PLATFORM $OMP_NUM_THREADS");
  ASSERT_TRUE(Find().ok());
  const std::vector<std::string> calls = colmap_.Calls();
  ASSERT_THAT(calls, SizeIs(4));
  EXPECT_THAT(calls[0],
              AllOf(StartsWith("feature_extractor"), HasSubstr("use_gpu 0"),
                    HasSubstr("camera_model SIMPLE_RADIAL"),
                    HasSubstr("single_camera_per_folder 1"), HasSubstr("max_num_features 500"),
                    HasSubstr("num_threads 3"), HasSubstr("--random_seed 11")));
  EXPECT_THAT(calls[1], AllOf(StartsWith("matches_importer"), HasSubstr("match_type pairs"),
                              HasSubstr("use_gpu 0"), HasSubstr("num_threads 1")));
  EXPECT_THAT(calls[2],
              AllOf(StartsWith("mapper"), HasSubstr("Mapper.num_threads 1"),
                    HasSubstr("ba_refine_focal_length 1"), HasSubstr("ba_refine_extra_params 1"),
                    HasSubstr("ba_refine_principal_point 0")));
  EXPECT_EQ(calls[3], "offscreen 1");
}

TEST_F(SfmTest, KnownLensesStayAsTheyAre) {
  for (int i = 0; i < 6; ++i) {
    options_.rig_views[absl::StrCat("p", i, ".png")] = {.rig = "r", .focal_length = 32};
  }
  colmap_.SetDatabase({"64x48_32px/000000.png", "64x48_32px/000001.png"}, 0, {});
  EXPECT_FALSE(Find().ok());  // no model
  const std::vector<std::string> calls = colmap_.Calls();
  EXPECT_THAT(calls, Contains(AllOf(StartsWith("mapper"), HasSubstr("ba_refine_focal_length 0"),
                                    HasSubstr("ba_refine_extra_params 0"))));
}

TEST_F(SfmTest, OfManyPhotosTheMostSimilarAreMatched) {
  options_.match_all_up_to = 5;
  options_.similar_photos = 1;
  colmap_.On("matches_importer", "cp \"$db.pairs.txt\" \"$room/pairs.log\"");
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  ASSERT_TRUE(Find().ok());
  // All look the same, so that each pair has the first photos or neighbours: not all of the 15.
  std::ifstream pairs(colmap_.dir() + "/work/sfm/0/pairs.log");
  int lines = 0;
  for (std::string line; std::getline(pairs, line);) ++lines;
  EXPECT_LT(lines, 15);
  EXPECT_GE(lines, 5 + 4);
}

TEST_F(SfmTest, OnlyOfManyPhotosAllCamerasAreAdjustedSeldom) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  ASSERT_TRUE(Find().ok());
  EXPECT_THAT(colmap_.Calls(), Not(Contains(HasSubstr("ba_global_images_ratio"))));
  options_.match_all_up_to = 5;
  ASSERT_TRUE(Find().ok());
  EXPECT_THAT(colmap_.Calls(),
              Contains(AllOf(StartsWith("mapper"), HasSubstr("ba_global_images_ratio 1.5"))));
}

TEST_F(SfmTest, ClimbsTheLadderAndKeepsTheModelWithMostPhotos) {
  colmap_.AddModel(0, 0, Model({0, 1, 2}, 90));
  colmap_.AddModel(1, 0, Model({0, 1, 2, 3, 4}, 5));  // most photos, though fewest points
  colmap_.AddModel(2, 0, Model({0, 1, 2, 3}, 40));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_THAT(result->rungs, SizeIs(3));
  EXPECT_EQ(result->rungs[0].registered, 3);
  EXPECT_EQ(result->rungs[2].points, 40);
  EXPECT_EQ(result->preparation, "gain + Gaussian 1.2 px");
  EXPECT_THAT(result->model.views, SizeIs(5));
  ASSERT_THAT(result->photos, SizeIs(6));
  EXPECT_TRUE(result->photos[4].registered());
  EXPECT_EQ(result->photos[5].drop, DropCause::kNoMatches);
  EXPECT_EQ(result->photos[0].features, 900);
  EXPECT_EQ(result->photos[0].matched_photos, 2);
  EXPECT_THAT(result->notes, ElementsAre(HasSubstr("1 matches no other photo (p5.png)")));
}

TEST_F(SfmTest, ASmallSecondGroupIsLeftOutAndNamed) {
  colmap_.SetDatabase({}, 0, {});
  colmap_.AddModel(0, 0, Model({5}, 3));  // the mapper's order is not by size
  colmap_.AddModel(0, 1, Model({0, 1, 2, 3, 4}, 30));
  options_.enough_registered = 0.8;
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->rungs[0].groups, ElementsAre(5, 1));
  EXPECT_EQ(result->photos[5].drop, DropCause::kOtherGroup);
  EXPECT_THAT(result->notes, ElementsAre(HasSubstr("p5.png"), HasSubstr("groups of 5, 1")));
}

TEST_F(SfmTest, PhotosOfDifferentPlacesAreRefused) {
  for (int rung = 0; rung < 3; ++rung) {
    colmap_.AddModel(rung, 0, Model({0, 1, 2}, 30));
    colmap_.AddModel(rung, 1, Model({3, 4, 5}, 20));
  }
  const auto result = Find();
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(result.status()), "SFM_SPLIT");
  EXPECT_THAT(std::string(result.status().message()),
              AllOf(HasSubstr("2 groups"), HasSubstr("p3.png, p4.png, p5.png"),
                    HasSubstr("one place per job")));
}

TEST_F(SfmTest, TooFewPlacedPhotosAreAnErrorThatNamesTheRest) {
  for (int rung = 0; rung < 3; ++rung) colmap_.AddModel(rung, 0, Model({0, 1}, 30));
  const auto result = Find();
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(result.status()), "SFM_TOO_FEW_REGISTERED");
  EXPECT_THAT(std::string(result.status().message()),
              AllOf(HasSubstr("2 of 6 photos could be placed, 3 are needed"),
                    HasSubstr("1 matches no other photo (p5.png)"),
                    HasSubstr("3 match others too weakly to be placed (p2.png, p3.png, p4.png)"),
                    HasSubstr("try")));
}

TEST_F(SfmTest, NoModelAtAllIsAnAnswerOfItsOwn) {
  colmap_.On("mapper", "echo 'ERROR: failed to create sparse model'; exit 1");
  const auto result = Find(kWellLit);
  EXPECT_EQ(Reason(result.status()), "SFM_NO_MODEL");
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("none of 6 photos"));
  EXPECT_THAT(colmap_.Calls(), SizeIs(6));  // both rungs of well lit photos were tried
}

TEST_F(SfmTest, AFailingStepShowsColmapsLastWords) {
  colmap_.On("matches_importer", "echo 'F1120 database is sour'; exit 3");
  const auto result = Find();
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(result.status()), "COLMAP_FAILED");
  EXPECT_THAT(std::string(result.status().message()),
              AllOf(HasSubstr("matches_importer"), HasSubstr("database is sour"),
                    HasSubstr("exit code 3")));
  EXPECT_TRUE(std::filesystem::exists(colmap_.dir() + "/work/sfm/0/matches_importer_0.log"));
}

TEST_F(SfmTest, ACrashOfColmapIsReportedNotSkipped) {
  colmap_.On("feature_extractor", "kill -6 $$");
  EXPECT_EQ(Reason(Find().status()), "COLMAP_FAILED");
  EXPECT_THAT(colmap_.Calls(), SizeIs(1));  // it would crash again
}

TEST_F(SfmTest, AStepThatIsAlwaysKilledIsGivenUp) {
  colmap_.On("feature_extractor", "kill -9 $$");
  EXPECT_EQ(Reason(Find().status()), "COLMAP_KILLED");
  EXPECT_THAT(colmap_.Calls(), SizeIs(3));
}

TEST_F(SfmTest, AKilledStepStartsItsRungAfreshAndChangesNothing) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  const auto undisturbed = Find();
  ASSERT_TRUE(undisturbed.ok()) << undisturbed.status();
  const size_t calls = colmap_.Calls().size();
  const std::string kill = colmap_.dir() + "/kill";
  options_.on_line = [&](std::string_view line) {
    colmap_.Hear(line);
    if (line == "dying") std::filesystem::remove(kill);
  };
  for (const char* command : {"feature_extractor", "matches_importer", "mapper"}) {
    colmap_.On(command,
               "if [ -e \"$fake/kill\" ]; then touch \"$room/stray\"; echo dying; kill -9 $$; fi");
    std::ofstream(kill) << "once";
    const auto result = Find();
    ASSERT_TRUE(result.ok()) << command << ": " << result.status();
    EXPECT_EQ(result->rungs.size(), 1u);
    EXPECT_EQ(FormatTransforms(result->model, ""), FormatTransforms(undisturbed->model, ""));
    EXPECT_FALSE(std::filesystem::exists(colmap_.dir() + "/work/sfm/0/stray"));
    colmap_.On(command, ":");
  }
  EXPECT_EQ(colmap_.Calls().size(), 4 * calls + 1 + 2 + 3);
}

TEST_F(SfmTest, MissingColmapSaysHowToGetIt) {
  options_.colmap = colmap_.dir() + "/none";
  const auto result = Find();
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(result.status()), "COLMAP_NOT_FOUND");
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("install"));
}

// Later versions have other names for options.
TEST_F(SfmTest, AnotherColmapIsRefusedBeforeItsFirstStep) {
  for (const char* version : {"3.7", "3.9.1", "3.13.0", "4.0"}) {
    colmap_.SetVersion(version);
    const absl::Status status = Find().status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(Reason(status), "COLMAP_UNSUPPORTED") << version;
    EXPECT_THAT(std::string(status.message()),
                HasSubstr(absl::StrCat("is version ", version, ",")));
  }
  EXPECT_TRUE(colmap_.Calls().empty());
  colmap_.SetVersion("3.8.1");
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  EXPECT_TRUE(Find().ok());
}

TEST_F(SfmTest, AHangingStepTimesOut) {
  colmap_.On("feature_extractor", "sleep 300");
  options_.step_timeout_seconds = 0.3;
  const auto result = Find();
  EXPECT_EQ(result.status().code(), absl::StatusCode::kDeadlineExceeded);
}

TEST_F(SfmTest, CancellationEndsAHangingStep) {
  colmap_.On("mapper", "touch \"$room/hanging\"; trap '' TERM; while :; do sleep 0.1; done");
  absl::Status status;
  std::atomic<bool> done = false;
  std::thread runner([&] {
    status = Find().status();
    done = true;
  });
  while (!std::filesystem::exists(colmap_.dir() + "/work/sfm/0/hanging") && !done) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const auto start = std::chrono::steady_clock::now();
  cancel_.Cancel();
  runner.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
}

TEST_F(SfmTest, ProgressIsReportedOncePerSecondAtMost) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  colmap_.On("mapper", "for i in 1 2 3 4 5 6; do echo \"Registering image #$i ($i)\"; done");
  std::vector<std::string> steps;
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  options_.report_seconds = 3600;
  ASSERT_TRUE(
      FindCameras(photos, colmap_.dir() + "/work", options_, cancel_, [&](const SfmProgress& p) {
        steps.push_back(p.step);
      }).ok());
  EXPECT_THAT(steps, ElementsAre("prepare", "features", "match", "verify", "map"));
}

TEST_F(SfmTest, PhotosThatMatchNothingAreNotVerified) {
  colmap_.SetDatabase(CopyNames({0, 1, 2, 3, 4, 5}), 14, {});
  colmap_.On("mapper", "echo 'ERROR: failed to create sparse model'; exit 1");
  EXPECT_EQ(Reason(Find(kWellLit).status()), "SFM_NO_MODEL");
  EXPECT_THAT(colmap_.Calls(), Contains(StartsWith("mapper")));
  EXPECT_THAT(colmap_.Calls(), Not(Contains(StartsWith("matches_importer"))));
}

TEST_F(SfmTest, ProgressNamesRungStepAndFraction) {
  options_.report_seconds = 0;
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  colmap_.On("feature_extractor", "echo 'Processed file [3/6]'");
  colmap_.On("mapper", "echo 'Registering image #3 (2)'");
  std::vector<std::string> seen;
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  ASSERT_TRUE(
      FindCameras(photos, colmap_.dir() + "/work", options_, cancel_, [&](const SfmProgress& p) {
        char text[64];
        std::snprintf(text, sizeof(text), "%d/%d %s %.2f", p.rung, p.rungs, p.step.c_str(),
                      p.fraction);
        seen.push_back(text);
      }).ok());
  EXPECT_THAT(seen, ::testing::IsSupersetOf({"0/3 prepare 1.00", "0/3 features 0.50",
                                             "0/3 match 1.00", "0/3 verify 1.00", "0/3 map 0.33"}));
}

TEST_F(SfmTest, OnlyTheLogsStay) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  ASSERT_TRUE(Find().ok());
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(colmap_.dir() + "/work/sfm/0")) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names, Contains("mapper.log"));
  EXPECT_THAT(names, Each(EndsWith(".log")));
}

TEST_F(SfmTest, TwoPhotosAndBrokenPhotosAreRefused) {
  const std::string photos = colmap_.MakePhotos(2, 128, 96, kDark);
  const std::string work = colmap_.dir() + "/work";
  const absl::Status two = FindCameras(photos, work, options_, cancel_).status();
  EXPECT_EQ(two.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(two), "TOO_FEW_PHOTOS");
  std::ofstream(photos + "/broken.jpg") << "this is no picture";
  const absl::Status broken = FindCameras(photos, work, options_, cancel_).status();
  EXPECT_EQ(broken.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(broken.message()), HasSubstr("broken.jpg"));
  EXPECT_TRUE(colmap_.Calls().empty());
}

TEST_F(SfmTest, TriangulationKeepsTheGivenCamerasExactly) {
  const std::string photos = colmap_.MakePhotos(7, 128, 96, kDark);  // p6 has no camera
  // COLMAP's ids need not follow the names: several threads write the database.
  const std::vector<int> order = {4, 0, 1, 2, 3, 5};
  colmap_.SetDatabase(CopyNames(order), kFeatures, {});
  const SparseModel known = KnownCameras();
  SeeWorldPoints(known, order);
  const auto result = TriangulatePoints(photos, known, colmap_.dir() + "/work", options_, cancel_);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_THAT(result->model.views, SizeIs(6));
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(result->model.views[i].camera.t, known.views[i].camera.t);
    EXPECT_EQ(result->model.views[i].camera.fx, known.views[i].camera.fx);
  }
  ASSERT_THAT(result->model.points, SizeIs(kFeatures));
  for (int i = 0; i < kFeatures; ++i) {
    const SparsePoint& point = result->model.points[i];
    const auto truth = FakeWorldPoint(i);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(point.xyz[c], truth[c], 0.01);
    ASSERT_THAT(point.track, SizeIs(6));
    for (const TrackElement& seen : point.track) {
      const Camera& camera = known.views[seen.view].camera;
      const auto p = camera.CamFromWorld(truth);
      EXPECT_NEAR(seen.x, camera.fx * p[0] / p[2] + camera.cx, 1e-4);
      EXPECT_NEAR(seen.y, camera.fy * p[1] / p[2] + camera.cy, 1e-4);
    }
    // The prepared photos are grey with some texture, at a mean of .45.
    EXPECT_NEAR(point.rgb[1], 0.45 * 255, 40);
  }
  ASSERT_THAT(result->photos, SizeIs(7));
  EXPECT_EQ(result->photos[0].matched_photos, 5);
  EXPECT_EQ(result->photos[6].drop, DropCause::kNoCamera);
}

TEST_F(SfmTest, TriangulationRefusesCamerasThatDoNotFitThePhotos) {
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  const std::string work = colmap_.dir() + "/work";
  SparseModel missing = KnownCameras();
  missing.views[5].name = "p9.png";
  const absl::Status not_found =
      TriangulatePoints(photos, missing, work, options_, cancel_).status();
  EXPECT_EQ(not_found.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Reason(not_found), "VIEW_WITHOUT_PHOTO");
  SparseModel small = KnownCameras();
  small.views[1].camera = small.views[1].camera.Scaled(64, 48);
  EXPECT_EQ(Reason(TriangulatePoints(photos, small, work, options_, cancel_).status()),
            "CAMERA_SIZE_MISMATCH");
  SparseModel one = KnownCameras();
  one.views.resize(1);
  one.distortions.resize(1);
  EXPECT_EQ(Reason(TriangulatePoints(photos, one, work, options_, cancel_).status()),
            "TOO_FEW_CAMERAS");
  SparseModel nan = KnownCameras();
  nan.views[1].camera.t[0] = std::nan("");
  EXPECT_EQ(TriangulatePoints(photos, nan, work, options_, cancel_).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(colmap_.Calls().empty());
}

TEST_F(SfmTest, GivenCamerasInOnePlaceAreRefusedBeforeAnyWork) {
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  SparseModel tripod = KnownCameras();
  for (View& view : tripod.views) {
    // x_cam = R (x_world - place)
    const std::array<double, 3> place = {1, -2, 0.3};
    for (int i = 0; i < 3; ++i) {
      view.camera.t[i] = 0;
      for (int k = 0; k < 3; ++k) view.camera.t[i] -= view.camera.R[3 * i + k] * place[k];
    }
  }
  const absl::Status status =
      TriangulatePoints(photos, tripod, colmap_.dir() + "/work", options_, cancel_).status();
  EXPECT_EQ(Reason(status), "SFM_NO_PARALLAX");
  EXPECT_THAT(std::string(status.message()), HasSubstr("given cameras all stand in one place"));
  EXPECT_TRUE(colmap_.Calls().empty());
}

TEST_F(SfmTest, CamerasThatSeeNothingAlikeAreAnError) {
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  const auto result =
      TriangulatePoints(photos, KnownCameras(), colmap_.dir() + "/work", options_, cancel_);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(result.status()), "SFM_NO_POINTS");
}

TEST_F(SfmTest, PointsOfALaterPreparationAreTakenWhereTheFirstHasNone) {
  const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
  std::filesystem::copy(colmap_.database(), colmap_.dir() + "/empty.db");
  SeeWorldPoints(KnownCameras(), {0, 1, 2, 3, 4, 5});
  std::filesystem::copy(colmap_.database(), colmap_.dir() + "/good.db");
  colmap_.On("feature_extractor",
             "if [ $rung = 0 ]; then found=\"$fake/empty.db\"; else found=\"$fake/good.db\"; fi");
  const auto result =
      TriangulatePoints(photos, KnownCameras(), colmap_.dir() + "/work", options_, cancel_);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.points, SizeIs(kFeatures));
  ASSERT_THAT(result->rungs, SizeIs(2));
  EXPECT_EQ(result->rungs[0].points, 0);
}

TEST(SfmOptions, DefaultsAreValidAndErrorsNameTheField) {
  EXPECT_TRUE(SfmOptions().Validate().ok());
  SfmOptions options;
  options.step_timeout_seconds = std::nan("");
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "step_timeout_seconds");
  options = {};
  options.colmap = "";
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "colmap");
}

}  // namespace
}  // namespace litags
