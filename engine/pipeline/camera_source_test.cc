#include "engine/pipeline/camera_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/io/transforms_io.h"
#include "engine/pipeline/local_origin.h"
#include "engine/sfm/fake_colmap.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using Json = nlohmann::json;

constexpr int kWidth = 128, kHeight = 96, kDark = 12;
constexpr int kFeatures = 60;

// Six dark photos p0.png .. p5.png, and a COLMAP that places them with 70 points, from features
// that are kFeatures points for known cameras.
class CameraSource : public ::testing::Test {
 protected:
  CameraSource() {
    input_.images_dir = colmap_.MakePhotos(6, kWidth, kHeight, kDark);
    input_.work_dir = colmap_.dir() + "/work";
    fs::create_directory(input_.work_dir);
    std::vector<std::string> names;
    for (const View& view : Copies(0).views) names.push_back(view.name);
    colmap_.SetDatabase(names, kFeatures, {{0, 1}, {1, 2}, {0, 2}, {3, 4}});
    colmap_.SeeWorldPoints(CamerasOf(Known(0.1)), kFeatures);
    colmap_.AddModel(0, 0, Copies(70));
    options_.threads = 1;
  }

  static SparseModel Copies(int points) {
    return CopiesModel(absl::StrCat(kWidth, "x", kHeight), kWidth, kHeight, {0, 1, 2, 3, 4, 5},
                       points);
  }

  // What a user would bring, without points: photo i was taken at height y + i / 3.
  static SparseModel Known(double y) {
    SparseModel known = Copies(0);
    for (int i = 0; i < 6; ++i) {
      known.views[i].name = absl::StrCat("p", i, ".png");
      known.views[i].camera.t[1] = y + i / 3.0;
    }
    return known;
  }

  static std::vector<Camera> CamerasOf(const SparseModel& model) {
    std::vector<Camera> cameras;
    for (const View& view : model.views) cameras.push_back(view.camera);
    return cameras;
  }

  absl::StatusOr<SparseModel> Obtain(const std::string& colmap) {
    report_ = ReconstructReport();
    const auto photos = ListPhotos(input_.images_dir, "images");
    if (!photos.ok()) return photos.status();
    const CancelToken never;
    const Context context(
        input_, options_, never, [](Stage, const std::string&) {}, &report_,
        [this](std::string_view line) { last_line_ = line; });
    return ObtainCameras(context, *photos, masks_, colmap);
  }
  absl::StatusOr<SparseModel> Obtain() { return Obtain(colmap_.program()); }
  absl::StatusOr<SparseModel> ObtainKept() { return Obtain("/nonexistent/colmap"); }

  std::string RegistrationPath() const { return input_.work_dir + "/cameras/registration.json"; }

  FakeColmap colmap_;
  MaskPaths masks_;
  ReconstructInput input_;
  ReconstructOptions options_;
  std::string last_line_;
  ReconstructReport report_;
};

void ExpectSame(const SparseModel& a, const SparseModel& b) {
  ASSERT_EQ(a.views.size(), b.views.size());
  for (size_t i = 0; i < a.views.size(); ++i) {
    EXPECT_EQ(a.views[i].name, b.views[i].name);
    EXPECT_EQ(a.views[i].camera.Viewmat(), b.views[i].camera.Viewmat());
    EXPECT_EQ(a.views[i].camera.fx, b.views[i].camera.fx);
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (size_t i = 0; i < a.points.size(); ++i) EXPECT_EQ(a.points[i].xyz, b.points[i].xyz);
}

TEST_F(CameraSource, CamerasThatColmapFoundAreKept) {
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_THAT(found->views, SizeIs(6));
  EXPECT_THAT(found->points, SizeIs(70));
  EXPECT_EQ(report_.registered, 6);
  EXPECT_EQ(report_.sfm_preparation, "gain + Gaussian 0.7 px");
  EXPECT_THAT(report_.camera_seconds, SizeIs(5));
  EXPECT_THAT(last_line_, AllOf(HasSubstr("cameras were found in "), HasSubstr("features ")));
  ReconstructReport first = report_;
  first.camera_seconds.clear();

  const auto kept = ObtainKept();
  ASSERT_TRUE(kept.ok()) << kept.status();
  ExpectSame(*found, *kept);
  EXPECT_EQ(report_.ToJson(), first.ToJson());
}

TEST_F(CameraSource, KeptCamerasOfOtherPhotosAreNotUsed) {
  ASSERT_TRUE(Obtain().ok());
  ASSERT_TRUE(WritePng(input_.images_dir + "/p2.png", TestImage(kWidth, kHeight)).ok());
  EXPECT_EQ(Reason(ObtainKept().status()), "COLMAP_NOT_FOUND");
}

// The same photos with another seed have other cameras, kept ones or not.
TEST_F(CameraSource, KeptCamerasOfAnotherSeedAreNotUsed) {
  ASSERT_TRUE(Obtain().ok());
  options_.seed = 7;
  EXPECT_EQ(Reason(ObtainKept().status()), "COLMAP_NOT_FOUND");
  ASSERT_TRUE(Obtain().ok());
  EXPECT_TRUE(ObtainKept().ok());
}

// The first run was content with fewer.
TEST_F(CameraSource, KeptCamerasOfTooFewPhotosAreRefused) {
  const SparseModel five =
      CopiesModel(absl::StrCat(kWidth, "x", kHeight), kWidth, kHeight, {0, 1, 2, 3, 4}, 70);
  for (int rung = 0; rung < 3; ++rung) colmap_.AddModel(rung, 0, five);
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  options_.min_registered = 1;
  const absl::Status refused = ObtainKept().status();
  EXPECT_EQ(Reason(refused), "SFM_TOO_FEW_REGISTERED");
  EXPECT_THAT(std::string(refused.message()),
              AllOf(HasSubstr("5 of 6 photos could be placed"), HasSubstr("6 are needed"),
                    HasSubstr("p5.png")));
  EXPECT_EQ(Reason(Obtain().status()), "SFM_TOO_FEW_REGISTERED");
  options_.min_registered = 0.8;
  const auto kept = ObtainKept();
  ASSERT_TRUE(kept.ok()) << kept.status();
  ExpectSame(*found, *kept);
}

// The API takes any seed, COLMAP 31 bits of it.
TEST_F(CameraSource, LargeSeedsAreTaken) {
  options_.seed = uint64_t{1} << 40;
  const auto found = Obtain();
  EXPECT_TRUE(found.ok()) << found.status();
}

// Such as the EXIF orientation: as many bytes as before.
TEST_F(CameraSource, KeptCamerasOfPhotosEditedInPlaceAreNotUsed) {
  const std::string path = input_.images_dir + "/p2.png";
  const std::string photo = ReadFile(path, "", 1 << 20).value();
  ASSERT_TRUE(WriteFileAtomically(path, photo + "a").ok());
  ASSERT_TRUE(Obtain().ok());
  ASSERT_TRUE(ObtainKept().ok());
  ASSERT_TRUE(WriteFileAtomically(path, photo + "b").ok());
  EXPECT_EQ(Reason(ObtainKept().status()), "COLMAP_NOT_FOUND");
}

TEST_F(CameraSource, KeptCamerasLeaveEarlierNotesAlone) {
  ASSERT_TRUE(Obtain().ok());
  const std::vector<std::string> found = report_.notes;
  ReconstructReport report;
  report.notes = {"p9.png is left out: it is blurred"};
  const CancelToken never;
  const Context context(
      input_, options_, never, [](Stage, const std::string&) {}, &report);
  const auto photos = ListPhotos(input_.images_dir, "images");
  ASSERT_TRUE(ObtainCameras(context, *photos, masks_, "/nonexistent/colmap").ok());
  ASSERT_EQ(report.notes.size(), found.size() + 1);
  EXPECT_EQ(report.notes[0], "p9.png is left out: it is blurred");
}

TEST_F(CameraSource, DamagedCamerasCostANoteAndAreFoundAgain) {
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  const auto good = ReadFile(RegistrationPath(), "", 1 << 20);
  ASSERT_TRUE(good.ok());
  Json wrong_type = Json::parse(*good);
  wrong_type["notes"] = 3;
  Json missing = Json::parse(*good);
  missing.erase("dropped");
  const auto expect_found_again = [&] {
    const auto again = Obtain();
    ASSERT_TRUE(again.ok()) << again.status();
    ExpectSame(*found, *again);
    EXPECT_EQ(report_.registered, 6);
    EXPECT_THAT(report_.notes, Contains(HasSubstr("could not be used")));
    ASSERT_TRUE(ObtainKept().ok());
    EXPECT_THAT(report_.notes, Not(Contains(HasSubstr("could not be used"))));
  };
  for (const std::string& bad : {good->substr(0, good->size() / 2), std::string(), missing.dump(),
                                 std::string("[]"), wrong_type.dump()}) {
    SCOPED_TRACE(bad);
    ASSERT_TRUE(WriteFileAtomically(RegistrationPath(), bad).ok());
    expect_found_again();
  }
  fs::resize_file(input_.work_dir + "/cameras/images.bin", 20);
  expect_found_again();
}

// A crash while cameras are written leaves no registration.json.
TEST_F(CameraSource, HalfWrittenCamerasAreFoundAgain) {
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  fs::remove(RegistrationPath());
  fs::resize_file(input_.work_dir + "/cameras/images.bin", 20);
  const auto again = Obtain();
  ASSERT_TRUE(again.ok()) << again.status();
  ExpectSame(*found, *again);
}

TEST_F(CameraSource, TransformsGetTriangulatedPoints) {
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, Known(0.1), "high").ok());
  const auto cameras = Obtain();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_THAT(cameras->views, SizeIs(6));
  EXPECT_THAT(cameras->points, SizeIs(kFeatures));
  EXPECT_EQ(report_.sfm_preparation, "given");
  EXPECT_THAT(report_.dropped, IsEmpty());
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(cameras->views[i].name, absl::StrCat("p", i, ".png"));
    // Through the other convention of axes and COLMAP's quaternions: double precision.
    EXPECT_NEAR(cameras->views[i].camera.t[1], 0.1 + i / 3.0, 1e-12);
  }
  const auto kept = ObtainKept();
  ASSERT_TRUE(kept.ok()) << kept.status();
  ExpectSame(*cameras, *kept);
}

// Points are found near the origin, wherever the cameras are; the user's coordinates come back.
TEST_F(CameraSource, PointsOfAMapsCoordinatesAreTriangulatedNearTheOrigin) {
  const std::array<double, 3> offset = {5e5, 4.6e6, 100};
  SparseModel known = Known(0.1);
  for (View& view : known.views) view.camera = view.camera.Moved(offset);
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, known, "high").ok());
  const auto cameras = Obtain();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_THAT(cameras->points, SizeIs(kFeatures));
  const std::array<double, 3> origin = LocalOrigin(known.views);
  EXPECT_NEAR(origin[0], offset[0], 5);
  EXPECT_EQ(origin[0], std::round(origin[0]));
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(cameras->points[7].xyz[k] - offset[k], FakeWorldPoint(7)[k], 0.01);
  }
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(cameras->views[i].camera.Center()[k], known.views[i].camera.Center()[k], 1e-6);
    }
  }
}

// Landscape photos and portrait ones, each with its own lens: per-frame keys in the file.
TEST_F(CameraSource, TransformsMayHoldTwoCameras) {
  const ImageU8 upright = TestImage(kHeight, kWidth);
  SparseModel known = Known(0.1), found = Copies(0);
  for (const int i : {1, 4}) {
    ASSERT_TRUE(WritePng(absl::StrCat(input_.images_dir, "/p", i, ".png"), upright).ok());
    for (SparseModel* model : {&known, &found}) {
      Camera& camera = model->views[i].camera;
      std::swap(camera.width, camera.height);
      std::swap(camera.cx, camera.cy);
      camera.fx = camera.fy = 77;
    }
    found.views[i].name = absl::StrCat(kHeight, "x", kWidth, "/00000", i, ".png");
  }
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, known, "").ok());
  std::vector<std::string> names;
  for (const View& view : found.views) names.push_back(view.name);
  colmap_.SetDatabase(names, kFeatures, {{0, 1}, {1, 2}, {0, 2}, {3, 4}});
  colmap_.SeeWorldPoints(CamerasOf(known), kFeatures);
  const auto cameras = Obtain();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_THAT(cameras->views, SizeIs(6));
  for (int i = 0; i < 6; ++i) {
    const Camera& camera = cameras->views[i].camera;
    const bool portrait = i == 1 || i == 4;
    EXPECT_EQ(camera.width, portrait ? kHeight : kWidth) << i;
    EXPECT_EQ(camera.height, portrait ? kWidth : kHeight) << i;
    EXPECT_EQ(camera.fx, portrait ? 77 : 50) << i;
  }
}

TEST_F(CameraSource, NamesMatchByStem) {
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directory(input_.cameras_path);
  SparseModel known = Known(0.1);
  known.points = Copies(5).points;
  for (int i = 0; i < 6; ++i) known.views[i].name = absl::StrCat("p", i, ".JPG");
  known.views[3].name = "elsewhere.JPG";
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known).ok());
  const auto cameras = ObtainKept();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  ASSERT_THAT(cameras->views, SizeIs(5));
  EXPECT_EQ(cameras->views[0].name, "p0.png");
  EXPECT_EQ(cameras->views[3].name, "p4.png");
  EXPECT_THAT(report_.dropped, ElementsAre("p3.png"));
  // Marks in the photo that is left out are gone, the others point at the right photos.
  ASSERT_THAT(cameras->points, SizeIs(5));
  EXPECT_EQ(cameras->points[0].track_length(), 5);
  for (const TrackElement& e : cameras->points[0].track) EXPECT_LT(e.view, 5);
}

// ' ' and '-' sort before the '.' of an extension that the file leaves out.
TEST_F(CameraSource, ACameraThatMayBeOfSeveralPhotosIsRefused) {
  SparseModel known = Known(0.1);
  for (View& view : known.views) view.name = Stem(view.name);
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, known, "").ok());
  fs::copy_file(input_.images_dir + "/p2.png", input_.images_dir + "/p2.jpg");
  const absl::Status status = Obtain().status();
  EXPECT_EQ(Reason(status), "CAMERA_AMBIGUOUS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("'p2' may be p2.jpg or p2.png"));
}

TEST_F(CameraSource, PointsWithoutTracksAreTriangulatedAnew) {
  SparseModel known = Known(0.1);
  SparsePoint loose;
  loose.xyz = {0, 0, 5};
  known.points.assign(40, loose);
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directories(input_.cameras_path + "/0");
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path + "/0", known).ok());
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_THAT(report_.notes, Contains(HasSubstr("few of the 40 points")));
  EXPECT_THAT(report_.notes, Contains(HasSubstr("the cameras are those in 0")));
  EXPECT_FALSE(found->points.empty());
  for (const SparsePoint& point : found->points) EXPECT_GE(point.track_length(), 2);
}

// A model of ten photos, of which six were sent: p0 .. p5 saw `points` points, p6 .. p9 saw 60,
// which are behind the others.
SparseModel ModelOfMorePhotos(SparseModel known, int points) {
  for (int i = 6; i < 10; ++i) {
    known.views.push_back(known.views[0]);
    known.views.back().name = absl::StrCat("p", i, ".png");
    known.distortions.emplace_back();
  }
  SparsePoint seen, unseen;
  seen.xyz = {0, 0, 5};
  for (int i = 0; i < 3; ++i) seen.track.push_back({i, 1, 1});
  unseen.xyz = {0, 0, -500};
  for (int i = 6; i < 10; ++i) unseen.track.push_back({i, 1, 1});
  known.points.assign(points, seen);
  known.points.resize(points + 60, unseen);
  return known;
}

TEST_F(CameraSource, PointsThatNoPhotoSentSawAreNotUsed) {
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directory(input_.cameras_path);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, ModelOfMorePhotos(Known(0.1), 60)).ok());
  const auto found = ObtainKept();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_THAT(found->points, SizeIs(60));
  for (const SparsePoint& point : found->points) EXPECT_GE(point.track_length(), 1);
  EXPECT_THAT(report_.notes, Contains(HasSubstr("60 of the 120 points")));
}

TEST_F(CameraSource, PointsAreTriangulatedWhereTheModelHasFewOfThePhotosSent) {
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directory(input_.cameras_path);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, ModelOfMorePhotos(Known(0.1), 59)).ok());
  // A missing COLMAP says nothing about the photos.
  EXPECT_EQ(Reason(ObtainKept().status()), "COLMAP_NOT_FOUND");
  EXPECT_FALSE(fs::exists(RegistrationPath()));
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_THAT(found->points, SizeIs(kFeatures));
  EXPECT_THAT(report_.notes, Contains(HasSubstr("few of the 119 points")));
}

TEST_F(CameraSource, TheFewPointsOfAModelAreUsedWhereNoOthersCanBeTriangulated) {
  SparseModel tripod = ModelOfMorePhotos(Known(0.1), 59);
  for (View& view : tripod.views) view.camera.t = {0, 0, 0};
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directory(input_.cameras_path);
  ASSERT_TRUE(WriteColmapModel(input_.cameras_path, tripod).ok());
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_THAT(found->points, SizeIs(59));
  EXPECT_THAT(report_.notes, Contains(HasSubstr("no others could be triangulated")));
}

TEST_F(CameraSource, GivenCamerasAreSortedByTheirPhotos) {
  const std::vector<std::string> stems = {"shot", "shot-2", "shot 3", "t", "u", "v"};
  SparseModel known = Known(0.1);
  for (int i = 0; i < 6; ++i) {
    const std::string photo = input_.images_dir + "/p" + std::to_string(i) + ".png";
    fs::rename(photo, input_.images_dir + "/" + stems[i] + ".JPG");
    known.views[i].name = stems[i];
  }
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, known, "photos").ok());
  const auto cameras = Obtain();
  ASSERT_TRUE(cameras.ok()) << cameras.status();
  const char* names[] = {"shot 3.JPG", "shot-2.JPG", "shot.JPG", "t.JPG", "u.JPG", "v.JPG"};
  const int before[] = {2, 1, 0, 3, 4, 5};
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(cameras->views[i].name, names[i]);
    EXPECT_NEAR(cameras->views[i].camera.t[1], 0.1 + before[i] / 3.0, 1e-12);
  }
}

TEST_F(CameraSource, KeptCamerasAreFoundWhereTheFoldersHaveMoved) {
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  ASSERT_TRUE(WriteTransforms(input_.cameras_path, Known(0.25), "").ok());
  const auto found = Obtain();
  ASSERT_TRUE(found.ok()) << found.status();
  const std::string moved = colmap_.dir() + "/moved";
  fs::create_directory(moved);
  for (std::string* path : {&input_.cameras_path, &input_.images_dir, &input_.work_dir}) {
    const std::string to = moved + "/" + fs::path(*path).filename().string();
    fs::rename(*path, to);
    *path = to;
  }
  const auto kept = ObtainKept();
  ASSERT_TRUE(kept.ok()) << kept.status();
  ExpectSame(*found, *kept);
}

TEST_F(CameraSource, EditedTransformsReplaceKeptCameras) {
  input_.cameras_path = colmap_.dir() + "/transforms.json";
  for (const double y : {0.25, 0.75}) {
    ASSERT_TRUE(WriteTransforms(input_.cameras_path, Known(y), "").ok());
    const auto cameras = Obtain();
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    EXPECT_NEAR(cameras->views[0].camera.t[1], y, 1e-12);
  }
}

TEST_F(CameraSource, AnEditedListOfBundlersPhotosReplacesKeptCameras) {
  std::string bundle = "# Bundle file v0.3\n6 0\n";
  for (const View& view : Known(0.1).views) {
    const auto& t = view.camera.t;
    absl::StrAppend(&bundle, view.camera.fx, " 0 0\n1 0 0\n0 -1 0\n0 0 -1\n", t[0], " ", -t[1], " ",
                    -t[2], "\n");
  }
  for (const char* name : {"bundle.out", "bundle"}) {  // its first line tells what it is
    SCOPED_TRACE(name);
    input_.cameras_path = absl::StrCat(colmap_.dir(), "/", name);
    ASSERT_TRUE(WriteFileAtomically(input_.cameras_path, bundle).ok());
    for (const auto& [list, place] :
         {std::pair("p0.png\np1.png\np2.png\np3.png\np4.png\np5.png\n", 4),
          std::pair("p0.png\np1.png\np2.png\np3.png\np5.png\np4.png\n", 5)}) {
      ASSERT_TRUE(WriteFileAtomically(colmap_.dir() + "/list.txt", list).ok());
      const auto cameras = Obtain();
      ASSERT_TRUE(cameras.ok()) << cameras.status();
      ASSERT_EQ(cameras->views[4].name, "p4.png");
      EXPECT_NEAR(cameras->views[4].camera.t[1], 0.1 + place / 3.0, 1e-4);
    }
    fs::remove_all(input_.work_dir + "/cameras");  // of the same bytes
  }
}

// Binary files, so that the edited model has the size of the old one.
TEST_F(CameraSource, AnEditedColmapModelReplacesKeptCameras) {
  input_.cameras_path = colmap_.dir() + "/sparse";
  fs::create_directory(input_.cameras_path);
  for (const double y : {0.25, 0.75}) {
    SparseModel known = Known(y);
    known.points = Copies(5).points;
    ASSERT_TRUE(WriteColmapModel(input_.cameras_path, known).ok());
    const auto cameras = ObtainKept();
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    EXPECT_EQ(cameras->views[0].camera.t[1], y);
    EXPECT_THAT(cameras->points, SizeIs(5));
  }
}

}  // namespace
}  // namespace litags
