// The files of other programs. Every file is made from a formula here: where a point of the world
// is seen, by the other program's own rules.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/bundler_io.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/seen_point_test_util.h"
#include "engine/io/sparse_model.h"
#include "engine/io/test_util.h"

namespace litags {
namespace {

using testing::HasSubstr;

absl::StatusOr<SparseModel> Parse(const std::string& file, PanoramaNames* panoramas = nullptr) {
  return ParseCameras(
      file, "cameras", [](const std::string&) { return PhotoSize(); }, panoramas);
}

// OpenMVG: x_cam = R (X - C); pixels are counted from their centres.
std::string OpenMvg(const std::string& lens_type, const std::string& lens) {
  return absl::StrFormat(
      R"({"sfm_data_version": "0.3", "root_path": "/photos", "views": [
        {"key": 0, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649,
         "data": {"local_path": "", "filename": "low/a.jpg", "width": 160, "height": 120,
                  "id_view": 0, "id_intrinsic": 7, "id_pose": 3}}}},
        {"key": 1, "value": {"ptr_wrapper": {"id": 2147483650, "data": {"filename": "lost.jpg",
         "width": 160, "height": 120, "id_view": 1, "id_intrinsic": 7, "id_pose": 9}}}}],
       "intrinsics": [{"key": 7, "value": {"polymorphic_id": 2147483649,
         "polymorphic_name": "%s", "ptr_wrapper": {"id": 2147483651, "data": {"width": 160,
         "height": 120, "focal_length": 100.0, "principal_point": [77.5, 60.5]%s}}}}],
       "extrinsics": [{"key": 3, "value": {"rotation": [[%.17g, 0, %.17g], [0, 1, 0],
         [%.17g, 0, %.17g]], "center": [0.1, 0.4, -0.5]}}],
       "structure": [{"key": 0, "value": {"X": [1, 2, 3], "observations": []}}],
       "control_points": []})",
      lens_type, lens, kC, kS, -kS, kC);
}

// Its pixel, as we count.
std::array<double, 2> OpenMvgPixel(double x, double y) {
  return {100 * x + 77.5 + 0.5, 100 * y + 60.5 + 0.5};
}

void ExpectSeen(const std::string& file, const std::array<double, 2>& pixel) {
  const auto model = Parse(file);
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 1u);
  EXPECT_EQ(model->views[0].name, "a.jpg");
  EXPECT_NEAR(Seen(*model)[0], pixel[0], 1e-9);
  EXPECT_NEAR(Seen(*model)[1], pixel[1], 1e-9);
}

TEST(OpenMvgCameras, SeeThePointWhereOpenMvgDoes) {
  const auto [x, y] = OnPlane();
  const double r2 = x * x + y * y, r = std::sqrt(r2);
  ExpectSeen(OpenMvg("pinhole", ""), OpenMvgPixel(x, y));
  const double one = 1 + 0.1 * r2;
  ExpectSeen(OpenMvg("pinhole_radial_k1", R"(, "disto_k1": [0.1])"),
             OpenMvgPixel(x * one, y * one));
  const double three = 1 - 0.1 * r2 + 0.02 * r2 * r2 + 0.3 * r2 * r2 * r2;
  ExpectSeen(OpenMvg("pinhole_radial_k3", R"(, "disto_k3": [-0.1, 0.02, 0.3])"),
             OpenMvgPixel(x * three, y * three));
  // Its t1 and t2.
  const double tx = 0.004 * (r2 + 2 * x * x) + 2 * 0.003 * x * y;
  const double ty = 0.003 * (r2 + 2 * y * y) + 2 * 0.004 * x * y;
  ExpectSeen(OpenMvg("pinhole_brown_t2", R"(, "disto_t2": [-0.1, 0.02, 0.3, 0.003, 0.004])"),
             OpenMvgPixel(x * three + tx, y * three + ty));
  const double t = std::atan(r), at = t + 0.02 * std::pow(t, 3) - 0.01 * std::pow(t, 5);
  ExpectSeen(OpenMvg("fisheye", R"(, "fisheye": [0.02, -0.01, 0, 0])"),
             OpenMvgPixel(x / r * at, y / r * at));
}

TEST(OpenMvgCameras, OfFoldersAreNamedByThem) {
  std::string file = OpenMvg("pinhole", "");
  file.replace(file.find("\"local_path\": \"\""), 16, "\"local_path\": \"cam0\"");
  const auto model = Parse(file);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->paths[0], "cam0/low/a.jpg");
}

TEST(OpenMvgCameras, ValuesThatAreNotReadDoNotCount) {
  std::string file = OpenMvg("pinhole", "");
  const std::string none = R"("observations": [])";
  std::string many = R"("observations": [0)";
  for (int i = 0; i < 1 << 20; ++i) many += ",[1]";
  file.replace(file.find(none), none.size(), many + "]");
  const auto model = Parse(file);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].name, "a.jpg");
  // The same beside what is dropped is too much.
  file.replace(file.find("\"structure\""), 11, "\"others\"");
  EXPECT_EQ(Reason(Parse(file).status()), "BAD_JSON");
}

TEST(OpenMvgCameras, OtherLensesAreRefusedByName) {
  const absl::Status status = Parse(OpenMvg("pinhole_x", "")).status();
  EXPECT_EQ(Reason(status), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_THAT(std::string(status.message()), HasSubstr("'pinhole_x'"));
  EXPECT_EQ(Reason(Parse(OpenMvg("pinhole_radial_k1", "")).status()), "MISSING_KEY");
}

TEST(OpenMvgCameras, PanoramasAreForThoseWhoCutThem) {
  std::string file = OpenMvg("spherical", "");
  const std::string size = R"("width": 160,
         "height": 120, "focal_length": 100.0, "principal_point": [77.5, 60.5])";
  const size_t at = file.find(size);
  ASSERT_NE(at, std::string::npos);
  file.replace(at, size.size(), R"("value0": {"width": 160, "height": 80})");
  EXPECT_EQ(Reason(Parse(file).status()), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_TRUE(CheckCameras(file, "cameras").ok());
  PanoramaNames panoramas;
  const auto model = Parse(file, &panoramas);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(panoramas, PanoramaNames({"a.jpg"}));
  EXPECT_EQ(model->views[0].camera.height, 80);
  EXPECT_NEAR(model->views[0].camera.Center()[1], 0.4, 1e-12);
}

// AliceVision: rotations column by column, numbers as texts.
std::string Meshroom(const std::string& version, const std::string& lens) {
  return absl::StrFormat(
      R"({"version": [%s], "views": [
        {"viewId": "11", "poseId": "12", "intrinsicId": "13", "path": "/x/a.jpg", "width": "160",
         "height": "120", "metadata": {"Make": "Some"}},
        {"viewId": "14", "poseId": "99", "intrinsicId": "13", "path": "/x/lost.jpg"}],
       "intrinsics": [{"intrinsicId": "13", "width": "160", "height": "120", %s}],
       "poses": [{"poseId": "12", "pose": {"transform": {"rotation": ["%.17g", "0", "%.17g", "0",
         "1", "0", "%.17g", "0", "%.17g"], "center": ["0.1", "0.4", "-0.5"]}, "locked": "0"}}]})",
      version, lens, kC, -kS, kS, kC);
}

TEST(MeshroomCameras, SeeThePointWhereMeshroomDoesInEveryLayoutOfTheFile) {
  const auto [x, y] = OnPlane();
  const double r2 = x * x + y * y, k = 1 - 0.1 * r2 + 0.02 * r2 * r2 + 0.3 * r2 * r2 * r2;
  const std::string radial = R"("type": "radial3", "distortionParams": ["-0.1", "0.02", "0.3"])";
  const std::array<double, 2> square = {100 * x * k + 78, 100 * y * k + 61};
  ExpectSeen(Meshroom(R"("1", "0", "0")", R"("pxFocalLength": "100", "principalPoint":
                      ["77.5", "60.5"], )" + radial),
             square);
  ExpectSeen(Meshroom(R"("1", "2", "1")", R"("pxFocalLength": ["100", "100"], "principalPoint":
                      ["-2.5", "0.5"], )" + radial),
             square);
  // 22.5 mm of 36 mm.
  const std::string mm = R"("focalLength": "22.5", "sensorWidth": "36", "principalPoint":
                         ["-2.5", "0.5"], )";
  ExpectSeen(Meshroom(R"("1", "2", "2")", mm + radial), square);
  const std::array<double, 2> tall = {100 * x * k + 78, 125 * y * k + 61};
  ExpectSeen(Meshroom(R"("1", "2", "4")", mm + R"("pixelRatio": "0.8", )" + radial), tall);
  ExpectSeen(Meshroom(R"("1", "2", "6")", mm + R"("pixelRatio": "1.25", )" + radial), tall);
  ExpectSeen(Meshroom(R"("1", "2", "10")", mm + R"("type": "pinhole", "distortionType": "radialk3",
                      "distortionParams": ["-0.1", "0.02", "0.3"])"),
             square);
  ExpectSeen(Meshroom(R"("1", "2", "10")", mm + R"("type": "pinhole", "distortionType": "none",
                      "distortionParams": "")"),
             {100 * x + 78, 100 * y + 61});
}

TEST(MeshroomCameras, OtherLensesAreRefusedByName) {
  for (const char* type : {"fisheye4", "brown", "equidistant"}) {
    const absl::Status status =
        Parse(
            Meshroom(R"("1", "2", "4")", absl::StrCat(R"("focalLength": "22.5", "sensorWidth": "36",
                                       "principalPoint": ["0", "0"], "type": ")",
                                                      type, "\"")))
            .status();
    EXPECT_EQ(Reason(status), "UNSUPPORTED_CAMERA_MODEL");
    EXPECT_THAT(std::string(status.message()), HasSubstr(type));
  }
}

// Metashape: world_from_cam row by row, our axes; pixels are counted from the picture's corner, the
// principal point from its middle. `camera`: attributes of the camera that has a pose.
std::string Metashape(const std::string& type, const std::string& lens,
                      const std::string& camera = R"(id="0" sensor_id="2" component_id="0")",
                      const std::string& component = "", const std::string& chunk = "") {
  const std::string pose =
      absl::StrFormat("%.17g 0 %.17g 0.1 0 1 0 0.4 %.17g 0 %.17g -0.5 0 0 0 1", kC, -kS, kS, kC);
  return absl::StrFormat(
      R"(<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1" enabled="true">
 <sensors next_id="3">
  <sensor id="2" label="X, 20mm" type="%s"><resolution width="160" height="120"/>
   <property name="pixel_width" value="0.005"/><bands><band label="Red"/></bands>
   <calibration type="%s" class="initial"><resolution width="160" height="120"/><f>90</f>
    <k4>7</k4></calibration>
   <calibration type="%s" class="adjusted"><resolution width="160" height="120"/>%s</calibration>
   <covariance><params>f cx</params><coeffs>1 0 0 1</coeffs></covariance>
  </sensor>
 </sensors>
 <components next_id="1"><component id="0"><transform>%s</transform></component></components>
 <cameras next_id="4" next_group_id="1">
  <camera id="9" sensor_id="2" label="lost.jpg"><orientation>1</orientation></camera>
  <camera id="8" sensor_id="2" enabled="false" label="off.jpg"><transform>%s</transform></camera>
  <camera id="7" sensor_id="2" component_id="1" label="far.jpg"><transform>%s</transform></camera>
  <group id="0" label="G"><camera %s label="a.jpg"><transform>
   %s</transform><rotation_covariance>1 0 0 0 1 0 0 0 1</rotation_covariance></camera>
  <camera id="5" sensor_id="2" component_id="0" label="b"><transform>%s</transform></camera></group>
 </cameras>
 <transform>%s</transform>
</chunk></document>)",
      type, type, type, lens, component, pose, pose, camera, pose, pose, chunk);
}

TEST(MetashapeCameras, SeeThePointWhereMetashapeDoes) {
  const auto [x, y] = OnPlane();
  const double r2 = x * x + y * y, r = std::sqrt(r2);
  const auto seen = [&](const std::string& type, const std::string& lens) {
    const auto model = Parse(Metashape(type, lens));
    EXPECT_TRUE(model.ok()) << model.status();
    if (!model.ok()) return std::array<double, 2>{};
    // What is not aligned, not enabled or of a smaller component is left out.
    EXPECT_EQ(model->views.size(), 2u);
    EXPECT_EQ(model->views[0].name, "a.jpg");
    EXPECT_EQ(model->views[1].name, "b");
    return Seen(*model);
  };
  const auto plain = seen("frame", "<f>100</f><cx>-2</cx><cy>1</cy>");
  EXPECT_NEAR(plain[0], 80 - 2 + 100 * x, 1e-9);
  EXPECT_NEAR(plain[1], 60 + 1 + 100 * y, 1e-9);

  const double radial = 1 - 0.1 * r2 + 0.02 * r2 * r2 + 0.3 * r2 * r2 * r2;
  const double px = x * radial + 0.004 * (r2 + 2 * x * x) + 2 * 0.003 * x * y;
  const double py = y * radial + 0.003 * (r2 + 2 * y * y) + 2 * 0.004 * x * y;
  const auto frame = seen("frame",
                          "<f>100</f><cx>-2</cx><cy>1</cy><b1>5</b1><k1>-0.1</k1><k2>0.02</k2>"
                          "<k3>0.3</k3><p1>0.004</p1><p2>0.003</p2>");
  EXPECT_NEAR(frame[0], 80 - 2 + px * 100 + px * 5, 1e-9);
  EXPECT_NEAR(frame[1], 60 + 1 + py * 100, 1e-9);

  const double t = std::atan(r), t2 = t * t;
  const double at = t * (1 + 0.02 * t2 - 0.01 * t2 * t2 + 0.5 * t2 * t2 * t2 * t2);
  for (const char* type : {"fisheye", "equidistant_fisheye"}) {
    const auto fisheye =
        seen(type, "<f>100</f><k1>0.02</k1><k2>-0.01</k2><k4>0.5</k4><cx>3</cx><cy>0</cy>");
    EXPECT_NEAR(fisheye[0], 80 + 3 + x / r * at * 100, 1e-9);
    EXPECT_NEAR(fisheye[1], 60 + y / r * at * 100, 1e-9);
  }
}

// A world of other axes and another unit, far away.
TEST(MetashapeCameras, StandInTheWorldThatTheirComponentOrElseTheChunkHas) {
  const std::string camera = R"(id="0" sensor_id="2" component_id="0")", lens = "<f>100</f>";
  const std::string world =
      "<rotation locked=\"false\">0 1 0 0 0 1\n 1 0 0</rotation>"
      "<translation>5000000 -20 7</translation><scale locked=\"true\">2</scale>";
  const auto plain = Parse(Metashape("frame", lens));
  ASSERT_TRUE(plain.ok()) << plain.status();
  const Camera& own = plain->views[0].camera;
  const auto c = own.Center(), x = own.CamFromWorld({0.3, 1, 4});
  for (const std::string& file : {Metashape("frame", lens, camera, world, "<scale>9</scale>"),
                                  Metashape("frame", lens, camera, "", world)}) {
    const auto model = Parse(file);
    ASSERT_TRUE(model.ok()) << model.status();
    const Camera& placed = model->views[0].camera;
    const auto center = placed.Center();
    const auto seen = placed.CamFromWorld({5e6 + 2 * 1, -20 + 2 * 4, 7 + 2 * 0.3});
    EXPECT_NEAR(center[0], 5e6 + 2 * c[1], 1e-8);
    EXPECT_NEAR(center[2], 7 + 2 * c[0], 1e-8);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(seen[k], 2 * x[k], 1e-8);
  }
  for (const char* bad : {"<scale>0</scale>", "<translation>1 2</translation>",
                          "<rotation>1 0 0 0 1 0 0 0 nan</rotation>"}) {
    EXPECT_EQ(Reason(Parse(Metashape("frame", lens, camera, bad)).status()), "BAD_NUMBER");
  }
}

TEST(MetashapeCameras, ValuesMayBeLongAndStandOnLinesOfTheirOwn) {
  std::string file = Metashape("frame", "<f>\n 100\n</f><cx>-2</cx><cy>1</cy>");
  const std::string coefficients = "1 0 0 1";
  std::string long_ones;
  for (int i = 0; i < 1000; ++i) long_ones += "-1.2345678901234567e-05 ";
  file.replace(file.find(coefficients + "</coeffs>"), coefficients.size(), long_ones);
  for (size_t at = file.find("<transform>"); at != std::string::npos;
       at = file.find("<transform>", at + 1)) {
    const size_t end = file.find("</transform>", at);
    std::replace(file.begin() + static_cast<ptrdiff_t>(at),
                 file.begin() + static_cast<ptrdiff_t>(end), ' ', '\n');
  }
  const auto model = Parse(file);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views.size(), 2u);
  EXPECT_EQ(model->views[0].camera.cx, 78);
}

TEST(MetashapeCameras, TheAdjustedLensCountsAlsoBeforeTheInitialOne) {
  std::string file = Metashape("frame", "<f>100</f><cx>-2</cx>");
  const size_t at = file.find("<calibration");
  const std::string initial = file.substr(at, file.find("<calibration", at + 1) - at);
  file.erase(at, initial.size());
  file.insert(file.find("<covariance>"),
              absl::StrReplaceAll(initial, {{"160", "320"}, {"frame", "fisheye"}}));
  const auto model = Parse(file);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(model->views[0].camera.width, 160);
  EXPECT_EQ(model->views[0].camera.fx, 100);
  EXPECT_EQ(model->views[0].camera.cx, 78);
  EXPECT_FALSE(model->distortions[0].fisheye);
}

TEST(MetashapeCameras, PanoramasAreForThoseWhoCutThem) {
  const std::string file = Metashape("spherical", "");
  EXPECT_EQ(Reason(Parse(file).status()), "UNSUPPORTED_CAMERA_MODEL");
  EXPECT_TRUE(CheckCameras(file, "cameras").ok());
  PanoramaNames panoramas;
  const auto model = Parse(file, &panoramas);
  ASSERT_TRUE(model.ok()) << model.status();
  EXPECT_EQ(panoramas, PanoramaNames({"a.jpg", "b"}));
  EXPECT_NEAR(model->views[0].camera.Center()[1], 0.4, 1e-12);
}

TEST(MetashapeCameras, WhatCannotBeReadIsRefusedByName) {
  const auto expect = [](const std::string& file, const char* reason, const char* word) {
    const absl::Status status = Parse(file).status();
    EXPECT_EQ(Reason(status), reason) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(word));
  };
  const char* const kModel = "UNSUPPORTED_CAMERA_MODEL";
  expect(Metashape("frame", "<f>100</f><k4>0.1</k4>"), kModel, "k4");
  expect(Metashape("frame", "<f>100</f><b2>0.1</b2>"), kModel, "b2");
  expect(Metashape("fisheye", "<f>100</f><p1>0.1</p1>"), kModel, "p1");
  expect(Metashape("cylindrical", "<f>100</f>"), kModel, "'cylindrical'");
  expect(Metashape("frame", ""), "MISSING_KEY", "cameras.cameras[a.jpg]");
  expect(Metashape("frame", "<f>100</f>", R"(id="0" sensor_id="3" component_id="0")"),
         "MISSING_KEY", "sensor_id");
  std::string system = Metashape("frame", "<f>100</f>");
  system.replace(system.find("<sensor id=\"2\""), 14, "<sensor master_id=\"0\" id=\"2\"");
  expect(system, kModel, "system of several cameras");
  // As Metashape writes them: their poses are those of their masters.
  const auto with_slave = [](const char* more) {
    return absl::StrReplaceAll(
        Metashape("frame", "<f>100</f>"),
        {{"</cameras>", absl::StrCat("<camera id=\"6\" sensor_id=\"2\" master_id=\"0\"", more,
                                     " label=\"slave.jpg\"/></cameras>")}});
  };
  expect(with_slave(""), kModel, "cameras.cameras[slave.jpg]: Metashape's system of several");
  EXPECT_TRUE(Parse(with_slave(" enabled=\"false\"")).ok());

  std::string file = Metashape("frame", "<f>100</f>");
  expect(file.substr(0, file.size() / 2), "BAD_XML", "line ");
  expect("<html><body/></html>", "NO_CAMERAS", "0 chunks");
  expect("<!DOCTYPE document [<!ENTITY a 'b'>]>" + file.substr(file.find("<document")), "BAD_XML",
         "DOCTYPE");
  // The first pose is of a camera that is not enabled, and is not read.
  file.replace(file.find("-0.5 0 0 0 1", file.find("far.jpg")), 4, "nan ");
  expect(file, "BAD_NUMBER", "'far.jpg'");
  std::string deep = "<document>";
  for (int i = 0; i < 100; ++i) deep += "<chunk>";
  expect(deep, "BAD_XML", "nested");
  std::string many = "<document><chunk><sensors>";
  for (int i = 0; i < 200'000; ++i) absl::StrAppend(&many, "<sensor id=\"", i, "\"/>");
  expect(many, "BAD_XML", "too many");
  ForEachCorruption(Metashape("frame", "<f>100</f><k1>0.1</k1>"), 300,
                    [](const std::string& bytes) { (void)Parse(bytes).ok(); });
}

// Bundler: y up and z towards the viewer; pixels are counted from the picture's middle.
std::string Bundler(const std::string& lens) {
  return absl::StrFormat(
      "# Bundle file v0.3\n3 1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n%s\n%.17g 0 %.17g\n0 -1 0\n"
      "%.17g 0 %.17g\n%.17g %.17g %.17g\n100 0 0\n1 0 0\n0 -1 0\n0 0 -1\n0 0 0\n"
      "1 2 3\n255 0 9\n2 1 17 0.5 -3.5 2 4 1 1\n",
      lens, kC, kS, kS, -kC, -(kC * kCenter[0] + kS * kCenter[2]), kCenter[1],
      -kS * kCenter[0] + kC * kCenter[2]);
}

absl::StatusOr<SparseModel> ParseSized(const std::string& file) {
  return ParseCameras(file, "cameras", [](const std::string&) { return PhotoSize{160, 120}; });
}

TEST(BundlerCameras, SeeThePointWhereBundlerDoes) {
  const auto [x, y] = OnPlane();
  const double r2 = x * x + y * y, radial = 1 - 0.1 * r2 + 0.02 * r2 * r2;
  const auto model =
      ParseSized(Bundler("100 -0.1 0.02") + "\nlost.jpg\n./low/a.jpg 0 541.5\nwith blank.jpg\n");
  ASSERT_TRUE(model.ok()) << model.status();
  ASSERT_EQ(model->views.size(), 2u);  // the first one was not placed
  EXPECT_EQ(model->views[0].name, "a.jpg");
  EXPECT_EQ(model->views[1].name, "with blank.jpg");
  EXPECT_NEAR(Seen(*model)[0], 80 + 100 * x * radial, 1e-9);
  EXPECT_NEAR(Seen(*model)[1], 60 + 100 * y * radial, 1e-9);
  EXPECT_NEAR(model->views[0].camera.Center()[2], kCenter[2], 1e-12);
}

// How far from the middle points are seen tells what photo a camera is of, which Bundler does not.
TEST(BundlerCameras, SeePointsWithinTheirPhotos) {
  const auto parse = [](const std::string& place, PhotoSize size, std::set<std::string>* sure) {
    const std::string file = absl::StrReplaceAll(Bundler("100 0 0"), {{"0.5 -3.5", place}});
    const auto sizes = [size](const std::string&) { return size; };
    return ParseBundler(file + "\nlost\na.jpg\nb.jpg\n", "cameras", sizes, sure);
  };
  std::set<std::string> sure;
  const absl::Status larger = parse("130 0", {135, 90}, &sure).status();
  EXPECT_EQ(Reason(larger), "CAMERA_SIZE_MISMATCH");
  EXPECT_THAT(std::string(larger.message()), HasSubstr("cameras[a.jpg]: it sees points up to 130"));
  const auto either = parse("-40 40", {135, 90}, &sure);
  ASSERT_TRUE(either.ok()) << either.status();
  EXPECT_TRUE(sure.empty());
  // Of the photo before EXIF turned it.
  const auto turned = parse("60 -40", {90, 135}, &sure);
  ASSERT_TRUE(turned.ok()) << turned.status();
  EXPECT_EQ(turned->views[0].camera.width, 135);
  EXPECT_EQ(turned->views[0].camera.cy, 45);
  EXPECT_EQ(turned->views[1].camera.width, 90);  // which sees its point in the middle
  EXPECT_EQ(sure, std::set<std::string>{"a.jpg"});
  const auto upright = parse("60 -40", {135, 90}, &sure);
  ASSERT_TRUE(upright.ok()) << upright.status();
  EXPECT_EQ(upright->views[0].camera.width, 135);
  EXPECT_TRUE(CheckCameras(absl::StrReplaceAll(Bundler("100 0 0"), {{"0.5 -3.5", "3000 0"}}) +
                               "\nlost\na.jpg\nb.jpg\n",
                           "cameras")
                  .ok());
}

TEST(BundlerCameras, TheirListIsReadFromBesideThem) {
  TempDir dir;
  const std::string cameras = Bundler("100 0 0"), list = "lost.jpg\na.jpg\nb.jpg\n";
  for (const char* name : {"x", "y", "z"}) std::filesystem::create_directory(dir / name);
  for (const auto& [file, beside] :
       {std::pair("x/bundle.out", "x/list.txt"), std::pair("y/room.bundle.out", "y/room.list.txt"),
        std::pair("z/bundle.out", "z/export.lst")}) {
    ASSERT_TRUE(WriteFileAtomically(dir / file, cameras).ok());
    const absl::Status alone = ReadCameras(dir / file, "cameras", 160, 120).status();
    EXPECT_EQ(Reason(alone), "BAD_BUNDLE");
    EXPECT_THAT(std::string(alone.message()), HasSubstr("cat bundle.out list.txt"));
    ASSERT_TRUE(WriteFileAtomically(dir / beside, list).ok());
    const auto model = ReadCameras(dir / file, "cameras", 160, 120);
    ASSERT_TRUE(model.ok()) << model.status();
    EXPECT_EQ(model->views.size(), 2u);
    // At their own end, too.
    ASSERT_TRUE(WriteFileAtomically(dir / file, cameras + list).ok());
    const auto both = ReadCameras(dir / file, "cameras", 160, 120);
    ASSERT_TRUE(both.ok()) << both.status();
    EXPECT_EQ(both->views.size(), 2u);
    ASSERT_TRUE(WriteFileAtomically(dir / beside, "b.jpg\na.jpg\nlost.jpg\n").ok());
    EXPECT_EQ(Reason(ReadCameras(dir / file, "cameras", 160, 120).status()), "BAD_BUNDLE");
  }
}

TEST(BundlerCameras, WithTooManyPointsAreToBeExportedWithout) {
  TempDir dir;
  const std::string path = dir / "bundle.out";
  ASSERT_TRUE(WriteFileAtomically(path, Bundler("100 0 0") + std::string(16 << 20, ' ')).ok());
  const absl::Status status = ReadCameras(path, "cameras", 160, 120).status();
  EXPECT_EQ(Reason(status), "FILE_TOO_LARGE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("export the cameras without points"));
}

TEST(BundlerCameras, WhatIsCutShortIsRefused) {
  const std::string file = Bundler("100 0 0") + "\na\nb\nc\n";
  ASSERT_TRUE(ParseSized(file).ok());
  for (const size_t size : {size_t{22}, file.size() / 3, file.size() / 2, file.size() - 4}) {
    EXPECT_EQ(Reason(ParseSized(file.substr(0, size)).status()), "BAD_BUNDLE") << size;
  }
  EXPECT_EQ(Reason(ParseSized("# Bundle file v0.3\n999999 999999999\n").status()), "BAD_BUNDLE");
  EXPECT_EQ(Reason(ParseSized("# Bundle file v0.3\n0 0\n").status()), "NO_CAMERAS");
  ForEachCorruption(file, 300, [](const std::string& bytes) { (void)ParseSized(bytes).ok(); });
}

TEST(OtherCameras, FilesOfOtherProgramsAreRefusedByName) {
  for (const auto& [text, program] : std::vector<std::pair<std::string, std::string>>{
           {"NVM_V3\n\n2\n", "VisualSFM"},
           {"\xEF\xBB\xBF#name,x,y,alt,heading,pitch,roll,f,px,py\n", "RealityScan"}}) {
    const absl::Status status = Parse(text).status();
    EXPECT_EQ(Reason(status), "UNSUPPORTED_CAMERA_FILE") << program;
    EXPECT_THAT(std::string(status.message()), HasSubstr("cameras of " + program));
  }
}

TEST(OtherCameras, NumbersOfNoPictureAreRefused) {
  for (const auto& [file, reason] : std::vector<std::pair<std::string, std::string>>{
           {absl::StrReplaceAll(OpenMvg("pinhole", ""), {{"[77.5,", "[177.5,"}}),
            "BAD_PRINCIPAL_POINT"},
           {Meshroom(R"("1", "0", "0")", R"("pxFocalLength": "7", "principalPoint":
                     ["77.5", "60.5"], "type": "pinhole")"),
            "BAD_FOCAL_LENGTH"},
           {Metashape("frame", "<f>100</f><cx>-90</cx>"), "BAD_PRINCIPAL_POINT"}}) {
    const absl::Status status = Parse(file).status();
    EXPECT_EQ(Reason(status), reason) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr("cameras[a.jpg]"));
  }
}

TEST(OtherCameras, BoundlessFilesAreRefused) {
  std::string deep = R"({"sfm_data_version": "0.3", "views": )";
  for (int i = 0; i < 100; ++i) deep += "[";
  EXPECT_EQ(Reason(Parse(deep).status()), "BAD_JSON");
  std::string wide = R"({"sfm_data_version": "0.3", "views": [0)";
  for (int i = 0; i < 1'100'000; ++i) wide += ",0";
  EXPECT_EQ(Reason(Parse(wide + "]}").status()), "BAD_JSON");
  const std::string file = OpenMvg("pinhole_brown_t2", R"(, "disto_t2": [0, 0, 0, 0, 0])");
  ForEachCorruption(file, 300, [](const std::string& bytes) { (void)Parse(bytes).ok(); });
  ForEachCorruption(Meshroom(R"("1", "2", "4")", R"("focalLength": "22.5", "sensorWidth": "36",
                             "principalPoint": ["0", "0"], "type": "radial1")"),
                    300, [](const std::string& bytes) { (void)Parse(bytes).ok(); });
}

}  // namespace
}  // namespace litags
