#include "engine/io/transforms_io.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error_test_util.h"
#include "engine/io/cameras_io.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr char kIdentity[] = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
constexpr char kTop[] = R"("fl_x": 50, "fl_y": 51, "cx": 20, "cy": 15, "w": 40, "h": 30)";

std::string Frame(const std::string& path, const std::string& matrix,
                  const std::string& more = "") {
  return absl::StrCat("{\"file_path\": \"", path, "\", \"transform_matrix\": ", matrix, more, "}");
}

std::string File(const std::string& top, const std::string& frames) {
  return absl::StrCat("{", top, top.empty() ? "" : ", ", "\"frames\": [", frames, "]}");
}

absl::Status ParseStatus(const std::string& json, int width = 0, int height = 0) {
  return ParseTransforms(json, "cameras", width, height).status();
}

TEST(ParseTransforms, ConvertsOpenGlToOpenCv) {
  // At (1,2,3), turned 90 degrees about y: looks along -x of the world, right is -z, up is y.
  const auto model = ParseTransforms(
      File(kTop, Frame("./low/b.jpg", "[[0,0,1,1],[0,1,0,2],[-1,0,0,3],[0,0,0,1]]")), "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 1u);
  EXPECT_EQ(model->views[0].name, "b.jpg");
  const Camera& camera = model->views[0].camera;
  const auto center = camera.Center();
  EXPECT_NEAR(center[0], 1, 1e-12);
  EXPECT_NEAR(center[1], 2, 1e-12);
  EXPECT_NEAR(center[2], 3, 1e-12);
  const auto front = camera.CamFromWorld({1 - 5, 2, 3});  // five units ahead
  EXPECT_NEAR(front[0], 0, 1e-12);
  EXPECT_NEAR(front[1], 0, 1e-12);
  EXPECT_NEAR(front[2], 5, 1e-12);
  EXPECT_NEAR(camera.CamFromWorld({1, 3, 3})[1], -1, 1e-12);  // up in the world, -y in the picture
  EXPECT_NEAR(camera.CamFromWorld({1, 2, 2})[0], 1, 1e-12);
  EXPECT_EQ(camera.fx, 50);
  EXPECT_EQ(camera.fy, 51);
  EXPECT_EQ(camera.cx, 20);
  EXPECT_EQ(camera.height, 30);
}

TEST(ParseTransforms, SortsByNameAndLetsFramesOverride) {
  const auto model = ParseTransforms(
      File(kTop, Frame("b.jpg", kIdentity, ", \"fl_x\": 70, \"k1\": 0.1, \"w\": 44.0") + "," +
                     Frame("a.jpg", kIdentity)),
      "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 2u);
  EXPECT_EQ(model->views[0].name, "a.jpg");
  EXPECT_EQ(model->views[0].camera.fx, 50);
  EXPECT_TRUE(model->distortions[0].IsZero());
  EXPECT_EQ(model->views[1].camera.fx, 70);
  EXPECT_EQ(model->views[1].camera.width, 44);
  EXPECT_EQ(model->distortions[1].k1, 0.1);
}

TEST(ParseTransforms, TakesTheFocalLengthFromTheFieldOfView) {
  const std::string json = File("\"camera_angle_x\": 1.5707963267948966", Frame("r_0", kIdentity));
  const auto model = ParseTransforms(json, "cameras", 800, 600);
  ASSERT_TRUE(model.ok()) << model.status();
  const Camera& camera = model->views[0].camera;
  EXPECT_EQ(model->views[0].name, "r_0");
  EXPECT_NEAR(camera.fx, 400, 1e-9);
  EXPECT_NEAR(camera.fy, 400, 1e-9);  // square pixels
  EXPECT_EQ(camera.cx, 400);
  EXPECT_EQ(camera.cy, 300);
  const absl::Status no_size = ParseTransforms(json, "cameras").status();
  EXPECT_EQ(Reason(no_size), "MISSING_KEY");
  EXPECT_THAT(std::string(no_size.message()), HasSubstr("'w'"));
}

TEST(ParseTransforms, EachFrameWithoutASizeHasThatOfItsPhoto) {
  const std::string json =
      File("\"camera_angle_x\": 1.5707963267948966",
           Frame("train/r.a", kIdentity) + "," + Frame("train/r.b", kIdentity));
  const auto sizes = [](const std::string& name) {
    return name == "train/r.a" ? PhotoSize{800, 600} : PhotoSize{600, 800};
  };
  const auto model = ParseTransforms(json, "cameras", sizes);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].camera.width, 800);
  EXPECT_NEAR(model->views[0].camera.fx, 400, 1e-9);
  EXPECT_EQ(model->views[1].camera.height, 800);
  EXPECT_NEAR(model->views[1].camera.fx, 300, 1e-9);
  EXPECT_EQ(Reason(ParseStatus(json)), "MISSING_KEY");
  EXPECT_TRUE(CheckCameras(json, "cameras").ok());
  EXPECT_EQ(Reason(CheckCameras("{}", "cameras").status()), "MISSING_KEY");
}

// Cameras may be of larger photos than those that are sent, as of mosaics.
TEST(ParseTransforms, TakesSizesThatNoPhotoMayHave) {
  const auto model = ParseTransforms(
      File(R"("fl_x": 30000, "w": 40000, "h": 30000)", Frame("a.jpg", kIdentity)), "c");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].camera.width, 40000);
}

TEST(ParseTransforms, TakesSixteenNumbersAndFramesThatComeTwice) {
  const std::string flat = "[0,0,1,1, 0,1,0,2, -1,0,0,3, 0,0,0,1]";
  const std::string nested = "[[0,0,1,1],[0,1,0,2],[-1,0,0,3],[0,0,0,1]]";
  const auto a =
      ParseTransforms(File(kTop, Frame("a.jpg", flat) + "," + Frame("a.jpg", flat)), "c");
  const auto b = ParseTransforms(File(kTop, Frame("a.jpg", nested)), "c");
  ASSERT_TRUE(a.ok() && b.ok()) << a.status();
  ASSERT_EQ(a->views.size(), 1u);
  EXPECT_EQ(a->views[0].camera.Viewmat(), b->views[0].camera.Viewmat());
}

// A file of 16 MiB may name one photo of 100 MB 200,000 times.
TEST(ParseTransforms, FramesThatComeAgainCostNoLookAtTheirPhoto) {
  std::string frames = Frame("a.jpg", kIdentity);
  for (int i = 1; i < 1000; ++i) absl::StrAppend(&frames, ",", Frame("a.jpg", kIdentity));
  int looks = 0;
  const auto sizes = [&](const std::string&) {
    ++looks;
    return PhotoSize{40, 30};
  };
  const auto model = ParseTransforms(File("\"fl_x\": 50", frames), "c", sizes);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views.size(), 1u);
  EXPECT_EQ(looks, 1);
}

TEST(ParseTransforms, RefusesMatricesThatWereWrittenColumnByColumn) {
  for (const char* matrix :
       {"[0,0,-1,0, 0,1,0,0, 1,0,0,0, 1,2,3,1]", "[[0,0,-1,0],[0,1,0,0],[1,0,0,0],[1,2,3,1]]"}) {
    const absl::Status status = ParseStatus(File(kTop, Frame("a.jpg", matrix)));
    EXPECT_EQ(Reason(status), "BAD_POSE");
    EXPECT_THAT(std::string(status.message()), HasSubstr("column by column"));
  }
  EXPECT_TRUE(ParseStatus(File(kTop, Frame("a.jpg", "[[0,0,1,1],[0,1,0,2],[-1,0,0,3]]"))).ok());
}

TEST(ParseTransforms, RefusesIntrinsicsOfAnotherSizeOrUnit) {
  const auto status = [](const std::string& lens) {
    return ParseStatus(File(lens + R"(, "w": 400, "h": 300)", Frame("a.jpg", kIdentity)));
  };
  const absl::Status larger = status(R"("fl_x": 1600, "cx": 800, "cy": 600)");
  EXPECT_EQ(Reason(larger), "BAD_PRINCIPAL_POINT");
  EXPECT_THAT(std::string(larger.message()), HasSubstr("cx 800 and cy 600 px, lies outside a "
                                                       "picture of 400x300 px"));
  EXPECT_EQ(Reason(status(R"("fl_x": 0.9, "fl_y": 1.2, "cx": 0.5, "cy": 0.5)")),
            "BAD_FOCAL_LENGTH");
  EXPECT_TRUE(status(R"("fl_x": 20, "cx": 0, "cy": 300)").ok());
}

TEST(MaskPathsOfTransforms, AreThoseOfTheFrames) {
  const auto paths = MaskPathsOfTransforms(
      File(kTop, Frame("low/a.jpg", kIdentity, R"(, "mask_path": "m/a.png")") + "," +
                     Frame("b.jpg", kIdentity)));
  ASSERT_EQ(paths.size(), 2u);
  EXPECT_EQ(paths.at("low/a.jpg"), "m/a.png");
  EXPECT_EQ(paths.at("b.jpg"), "");
  EXPECT_TRUE(MaskPathsOfTransforms("no JSON").empty());
}

TEST(ParseTransforms, DividesOutAUniformScale) {
  const auto model = ParseTransforms(
      File(kTop, Frame("a.jpg", "[[2,0,0,1],[0,2,0,2],[0,0,2,3],[0,0,0,1]]")), "cameras");
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_NEAR(model->views[0].camera.R[0], 1, 1e-12);
  EXPECT_NEAR(model->views[0].camera.Center()[2], 3, 1e-12);
}

TEST(ParseTransforms, NamesWhatIsWrong) {
  const std::string good = File(kTop, Frame("a.jpg", kIdentity));
  ASSERT_TRUE(ParseStatus(good).ok());
  const auto changed = [&](const std::string& from, const std::string& to) {
    EXPECT_THAT(good, HasSubstr(from));
    return ParseStatus(absl::StrReplaceAll(good, {{from, to}}));
  };
  const auto expect = [](const absl::Status& status, const std::string& reason,
                         const std::string& text) {
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(Reason(status), reason) << status;
    EXPECT_THAT(std::string(status.message()), StartsWith("cameras"));
    EXPECT_THAT(std::string(status.message()), HasSubstr(text));
  };
  expect(changed("\"fl_x\": 50, ", ""), "MISSING_KEY", "fl_x");
  expect(changed("\"fl_x\": 50", "\"fl_x\": NaN"), "BAD_JSON", "NaN");
  expect(changed("\"fl_x\": 50", "\"fl_x\": 1e999"), "BAD_JSON", "1e999");
  expect(changed("\"fl_x\": 50", "\"fl_x\": \"50\""), "BAD_NUMBER", "'fl_x' is \"50\"");
  expect(changed("\"fl_x\": 50", "\"fl_x\": null"), "BAD_NUMBER", "null");
  expect(changed("\"fl_x\": 50", "\"fl_x\": -50"), "BAD_FOCAL_LENGTH", "-50");
  expect(changed("\"w\": 40", "\"w\": 40.5"), "BAD_CAMERA_SIZE", "40.5");
  expect(changed("\"w\": 40", "\"w\": 0"), "BAD_CAMERA_SIZE", "'w' is 0");
  expect(changed("\"w\": 40", "\"w\": 2e7"), "BAD_CAMERA_SIZE", "'w' is 2e+07");
  expect(changed("\"w\": 40", "\"w\": 40, \"is_fisheye\": true, \"p2\": 0.1"),
         "UNSUPPORTED_CAMERA_MODEL", "fisheye");
  for (const char* neither : {"null", "\"false\"", "[]"}) {
    expect(changed("\"w\": 40", absl::StrCat("\"w\": 40, \"is_fisheye\": ", neither)), "BAD_NUMBER",
           "'is_fisheye' is ");
  }
  for (const char* no : {"false", "0", "0.0"}) {  // p2 is none of a fisheye
    EXPECT_TRUE(
        changed("\"w\": 40", absl::StrCat("\"w\": 40, \"p2\": 0.1, \"is_fisheye\": ", no)).ok());
  }
  expect(changed("\"w\": 40", "\"w\": 40, \"is_fisheye\": 1, \"p2\": 0.1"),
         "UNSUPPORTED_CAMERA_MODEL", "fisheye");
  expect(changed("\"w\": 40", "\"w\": 40, \"k4\": 0.1"), "UNSUPPORTED_CAMERA_MODEL", "k4");
  expect(changed("\"w\": 40", "\"w\": 40, \"camera_model\": \"EQUIRECTANGULAR\""),
         "UNSUPPORTED_CAMERA_MODEL", "EQUIRECTANGULAR");
  expect(changed("\"file_path\"", "\"path\""), "MISSING_KEY", "cameras.frames[0]");
  expect(changed("a.jpg", ""), "BAD_FILE_NAME", "empty");
  expect(changed("a.jpg", "low/.."), "BAD_FILE_NAME", "dot");
  expect(changed("transform_matrix", "matrix"), "MISSING_KEY", "transform_matrix");
  expect(changed("[1,0,0,0]", "[1,0,0]"), "BAD_POSE", "4x4");
  expect(changed("[1,0,0,0]", "[\"x\",0,0,0]"), "BAD_POSE", "4x4");
  expect(changed("[1,0,0,0]", "[0,0,0,0]"), "SINGULAR_POSE", "inverted");
  expect(changed("[1,0,0,0]", "[-1,0,0,0]"), "NOT_A_ROTATION", "mirrors");
  expect(changed("[1,0,0,0]", "[1,0.3,0,0]"), "NOT_A_ROTATION", "shears");
  expect(changed("[{", "[7,{"), "BAD_JSON", "frames[0]");
  expect(ParseStatus(File(kTop, "")), "NO_CAMERAS", "empty");
  expect(ParseStatus("[]"), "MISSING_KEY", "frames");
  expect(ParseStatus(""), "BAD_JSON", "JSON");
  expect(ParseStatus(File(kTop, Frame("x/a.jpg", kIdentity) + "," +
                                    Frame("x/a.jpg", kIdentity, ", \"k1\": 0.1"))),
         "DUPLICATE_NAME", "a.jpg");
  expect(ParseStatus(File("\"camera_angle_x\": 4, \"w\": 4, \"h\": 4", Frame("a", kIdentity))),
         "BAD_FOCAL_LENGTH", "camera_angle_x");
}

// Photos lie in one folder, so those of one name have in theirs the folders in which they differ.
TEST(ParseTransforms, PhotosOfSeveralFoldersHaveThemInTheirNames) {
  const auto model = ParseTransforms(File(kTop, Frame("/home/rig/cam1/a.jpg", kIdentity) + "," +
                                                    Frame("/home/rig/cam0/a.jpg", kIdentity) + "," +
                                                    Frame("/home/rig/cam0/b.jpg", kIdentity)),
                                     "f");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 3u);
  EXPECT_EQ(model->views[0].name, "b.jpg");
  EXPECT_EQ(model->views[1].name, "cam0_a.jpg");
  EXPECT_EQ(model->views[2].name, "cam1_a.jpg");
  EXPECT_EQ(model->paths[2], "/home/rig/cam1/a.jpg");
}

TEST(ParseTransforms, SurvivesTruncationNestingAndCorruption) {
  const std::string good = File(kTop, Frame("a.jpg", kIdentity, ", \"k1\": 0.1"));
  for (size_t n = 0; n < good.size(); ++n) ASSERT_FALSE(ParseStatus(good.substr(0, n)).ok()) << n;
  EXPECT_FALSE(ParseStatus(std::string(200000, '[')).ok());
  const std::string deep = std::string(200000, '[') + std::string(200000, ']');
  EXPECT_EQ(Reason(ParseStatus(File("\"fl_x\": " + deep, Frame("a", kIdentity)))), "BAD_JSON");
  EXPECT_EQ(Reason(ParseStatus(File("\"fl_x\": [[7]]", Frame("a", kIdentity)), 4, 3)),
            "BAD_NUMBER");
  std::string many = "[0";
  for (int i = 0; i < 100'000; ++i) many += ",0";
  many += "]";
  const auto refusal = [](const std::string& json) { return ParseStatus(json).ToString(); };
  EXPECT_THAT(refusal(File("\"fl_x\": " + many, Frame("a", kIdentity))), HasSubstr("far too many"));
  EXPECT_THAT(refusal(File(kTop, Frame("a", many))), HasSubstr("far too many"));
  // What nobody reads may be as it likes.
  EXPECT_EQ(refusal(File(absl::StrCat(kTop, ", \"notes\": ", many),
                         Frame("a.jpg", kIdentity, ", \"points\": [" + many + "]"))),
            "OK");
  int refused = 0;
  ForEachCorruption(good, 3000,
                    [&](const std::string& json) { refused += !ParseStatus(json).ok(); });
  EXPECT_GT(refused, 100);
}

// Two cameras at general poses.
SparseModel TwoViews(bool same_intrinsics) {
  SparseModel model;
  for (int i = 0; i < 2; ++i) {
    View view{absl::StrCat("img", i, ".png"), {}};
    view.camera.width = 64;
    view.camera.height = 48;
    view.camera.fx = same_intrinsics ? 70.25 : 70.25 + i;
    view.camera.fy = 71;
    view.camera.cx = 32.5;
    view.camera.cy = 24;
    EXPECT_TRUE(view.camera.LookAt({1.0 + i, 2, 3}, {0.1, 0.2, 0.3 * i}, {0, 1, 0.2}).ok());
    model.views.push_back(view);
    model.distortions.push_back({.k1 = 0.01, .k2 = 0, .p1 = -0.002, .p2 = 0});
  }
  return model;
}

TEST(FormatTransforms, IsReadBackTheSame) {
  for (bool same : {true, false}) {
    const SparseModel model = TwoViews(same);
    const std::string json = FormatTransforms(model, "low");
    EXPECT_THAT(json, HasSubstr("\"low/img0.png\""));
    const auto back = ParseTransforms(json, "cameras");
    ASSERT_TRUE(back.ok()) << back.status();
    ASSERT_EQ(back->views.size(), 2u);
    for (int v = 0; v < 2; ++v) {
      const Camera &a = model.views[v].camera, &b = back->views[v].camera;
      EXPECT_EQ(back->views[v].name, model.views[v].name);
      EXPECT_EQ(a.fx, b.fx);
      EXPECT_EQ(a.cx, b.cx);
      EXPECT_EQ(a.width, b.width);
      // Rounding of the inverse and of the nearest rotation, in double.
      for (int i = 0; i < 9; ++i) EXPECT_NEAR(a.R[i], b.R[i], 1e-12);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.t[i], b.t[i], 1e-12);
      EXPECT_EQ(back->distortions[v].p1, -0.002);
    }
  }
}

TEST(ReadCameras, ReadsRealTransforms) {
  const std::string scenes = SharedScenes();
  if (scenes.empty()) GTEST_SKIP() << "no shared/scenes beside the source tree";
  for (const char* split : {"train", "test", "val"}) {
    const auto model = ReadCameras(scenes + "/castle/transforms_" + split + ".json", "cameras");
    ASSERT_TRUE(model.ok()) << model.status();
    EXPECT_EQ(model->views.size(), std::string(split) == "train" ? 9u : 2u);
    EXPECT_EQ(model->views[0].camera.width, 480);
    EXPECT_EQ(model->views[0].camera.cx, 240);
  }
}

TEST(ParseTransforms, PanoramasAreForThoseWhoCutThem) {
  const char json[] = R"({"camera_model": "EQUIRECTANGULAR", "w": 400, "h": 200, "fl_x": 200,
      "frames": [{"file_path": "a.jpg",
                  "transform_matrix": [[1,0,0,5],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})";
  EXPECT_EQ(Reason(ParseTransforms(json, "cameras").status()), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_TRUE(CheckCameras(json, "cameras").ok());
  PanoramaNames panoramas;
  const auto model = ParseTransforms(
      json, "cameras", [](const std::string&) { return PhotoSize(); }, &panoramas);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(panoramas, PanoramaNames({"a.jpg"}));
  EXPECT_EQ(model->views[0].camera.Center()[0], 5);
}

}  // namespace
}  // namespace litags
