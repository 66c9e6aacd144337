#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/io/container_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/mask_io.h"
#include "engine/io/test_util.h"
#include "engine/onnx/onnx_writer.h"
#include "engine/pipeline/capture_test_util.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

ReconstructOptions WithSource(DepthOrigin source) {
  ReconstructOptions options = SmallOptions();
  options.depth_source = source;
  return options;
}

std::string Maps(const ReconstructInput& input) { return input.work_dir + "/depth.litags"; }

TEST(DepthMaps, StereoIsMadeOnceAndKept) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work"), again = photos.Input("again");
  const ReconstructOptions options = WithSource(DepthOrigin::kStereo);
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->depth_used);
  EXPECT_THAT(report->notes, Contains(HasSubstr("depth from stereo: ")));
  const std::string kept = Bytes(Maps(input));
  const auto time = std::filesystem::last_write_time(Maps(input));
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_EQ(std::filesystem::last_write_time(Maps(input)), time) << "made again";
  ASSERT_TRUE(Reconstruct(again, options).ok());
  EXPECT_TRUE(Bytes(Maps(again)) == kept) << "the same photos must give the same maps";
  EXPECT_TRUE(SceneBytes(again) == SceneBytes(input));
}

TEST(DepthMaps, KeptMapsOfAnOlderVersionAreMadeAgain) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  const ReconstructOptions options = WithSource(DepthOrigin::kStereo);
  ASSERT_TRUE(Reconstruct(input, options).ok());
  const std::string kept = Bytes(Maps(input));
  RewriteAsVersion(Maps(input), "depth maps", 1);
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_TRUE(Bytes(Maps(input)) == kept);
}

TEST(DepthMaps, DamagedOrForeignKeptMapsAreMadeAgain) {
  Photographs photos;
  const ReconstructInput input = photos.Input("work");
  const ReconstructOptions options = WithSource(DepthOrigin::kStereo);
  ASSERT_TRUE(Reconstruct(input, options).ok());
  const std::string kept = Bytes(Maps(input));
  ASSERT_TRUE(WriteFileAtomically(Maps(input), kept.substr(0, kept.size() / 2)).ok());
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_TRUE(Bytes(Maps(input)) == kept);
  for (SparsePoint& point : photos.model.points) point.xyz[1] += 0.1;
  photos.WriteModel();
  ASSERT_TRUE(Reconstruct(input, options).ok());
  EXPECT_FALSE(Bytes(Maps(input)) == kept) << "maps of other points were used";
}

TEST(DepthMaps, GivenMapsComeFirstUnlessAnotherSourceIsAskedFor) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  Planes ramp(1, kHeight, kWidth);
  const std::string map = input.depth_dir + "/" + Stem(photos.model.views[1].name) + ".pfm";
  ASSERT_TRUE(WritePfm(map, ramp).ok());
  EXPECT_EQ(Reason(Reconstruct(input, WithSource(DepthOrigin::kAuto)).status()), "DEPTH_MAP_EMPTY");
  for (size_t i = 0; i < ramp.data.size(); ++i) ramp.data[i] = 1 + i % kWidth;
  ASSERT_TRUE(WritePfm(map, ramp).ok());
  const auto given = Reconstruct(input, WithSource(DepthOrigin::kAuto));
  ASSERT_TRUE(given.ok()) << given.status();
  EXPECT_TRUE(given->depth_used);
  EXPECT_THAT(given->notes, Contains(HasSubstr("depth from uploaded maps: 1 of ")));
  EXPECT_FALSE(std::filesystem::exists(Maps(input)));
  const auto stereo = Reconstruct(input, WithSource(DepthOrigin::kStereo));
  ASSERT_TRUE(stereo.ok()) << stereo.status();
  EXPECT_THAT(stereo->notes, Contains(HasSubstr("the depth maps given are not used")));
}

// With nothing given and nothing asked for. Those of all photos are other maps.
TEST(DepthMaps, StereoOfSomePhotosIsTheDefault) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work"), all = photos.Input("all");
  const auto report = Reconstruct(input, WithSource(DepthOrigin::kAuto));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->depth_used);
  EXPECT_THAT(report->notes, Contains(HasSubstr("depth from stereo: 6 of 6 training photos")));
  const std::string kept = Bytes(Maps(input));
  ASSERT_TRUE(Reconstruct(all, WithSource(DepthOrigin::kStereo)).ok());
  EXPECT_FALSE(Bytes(Maps(all)) == kept) << "the key must tell them apart";
}

// Photos of one point that all of `views` see.
std::vector<int> PhotosOfFew(int views) {
  SparsePoint point;
  std::vector<int> point_views = {-1};  // the first photo is held out
  for (int i = 0; i <= views; ++i) point.track.push_back({i, 0, 0});
  for (int i = 0; i < views; ++i) point_views.push_back(i);
  std::vector<int> photos;
  for (const SparsePoint& few : PointsOfFew({point}, point_views, 32)) {
    for (const TrackElement& e : few.track) photos.push_back(e.view);
  }
  return photos;
}

TEST(PointsOfFew, AreSeenByPhotosSpreadOverAll) {
  for (const int views : {1, 32, 33, 64, 100}) {
    const std::vector<int> photos = PhotosOfFew(views);
    ASSERT_EQ(photos.size(), static_cast<size_t>(std::min(views, 32)));
    for (size_t i = 1; i < photos.size(); ++i) {
      EXPECT_GT(photos[i], photos[i - 1]);
      EXPECT_LE(photos[i] - photos[i - 1], std::max(1, 2 * views / 32)) << views;
    }
  }
  EXPECT_TRUE(PointsOfFew({}, {}, 32).empty());
}

TEST(PointsOfFew, AreSeenByEveryDirectionOfPanoramas) {
  std::array<int, 6> directions = {};
  for (const int photo : PhotosOfFew(6 * 32)) ++directions[photo % 6];
  for (const int photos : directions) EXPECT_GE(photos, 4);
}

TEST(DepthMaps, NoneAndTheDepthLossOffMakeNone) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ReconstructOptions off = WithSource(DepthOrigin::kStereo);
  off.recipe->use_depth = false;
  for (const ReconstructOptions& options : {WithSource(DepthOrigin::kNone), off}) {
    const auto report = Reconstruct(input, options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_FALSE(report->depth_used);
    EXPECT_THAT(report->notes, Not(Contains(HasSubstr("depth from"))));
    EXPECT_FALSE(std::filesystem::exists(Maps(input)));
  }
}

TEST(DepthMaps, ASourceWithNothingToWorkWithIsRefused) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  EXPECT_EQ(Reason(Reconstruct(input, WithSource(DepthOrigin::kMaps)).status()),
            "DEPTH_MAPS_MISSING");
  const absl::Status network = Reconstruct(input, WithSource(DepthOrigin::kNetwork)).status();
  EXPECT_EQ(Reason(network), "DEPTH_MODEL_MISSING");
  EXPECT_EQ(GetErrorDetail(network)->field, "options.depth_source");
  // Before the cameras are searched for, which this engine cannot.
  ReconstructInput no_cameras = input;
  no_cameras.cameras_path.clear();
  EXPECT_EQ(Reason(Reconstruct(no_cameras, WithSource(DepthOrigin::kMaps)).status()),
            "DEPTH_MAPS_MISSING");
}

TEST(DepthMaps, MapsOfNoPhotoAreRefusedBeforeCamerasAreSearchedFor) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.cameras_path.clear();
  input.depth_dir = input.work_dir + "/maps";
  for (const DepthOrigin source : {DepthOrigin::kMaps, DepthOrigin::kAuto}) {
    std::filesystem::remove_all(input.depth_dir);
    EXPECT_EQ(Reason(Reconstruct(input, WithSource(source)).status()), "DEPTH_FOLDER_MISSING");
    std::filesystem::create_directory(input.depth_dir);
    ASSERT_TRUE(WritePfm(input.depth_dir + "/another.pfm", Planes(1, kHeight, kWidth)).ok());
    const absl::Status foreign = Reconstruct(input, WithSource(source)).status();
    EXPECT_EQ(foreign.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(Reason(foreign), "DEPTH_MAP_WITHOUT_PHOTO");
  }
}

// As of fisheyes, which become views once their cameras are found: here of a photo held out.
TEST(DepthMaps, MapsOfNoTrainingPhotoAreRefusedOrStereoStandsIn) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  const std::string stem = Stem(photos.model.views[2].name);
  ASSERT_TRUE(WritePfm(input.depth_dir + "/" + stem + ".pfm", Planes(1, kHeight, kWidth)).ok());
  const absl::Status refused = Reconstruct(input, WithSource(DepthOrigin::kMaps)).status();
  EXPECT_EQ(Reason(refused), "DEPTH_MAP_WITHOUT_PHOTO");
  EXPECT_THAT(std::string(refused.message()), HasSubstr("none of the 6 training photos"));
  const auto report = Reconstruct(input, WithSource(DepthOrigin::kAuto));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->depth_used);
  EXPECT_THAT(report->notes, Contains(HasSubstr("depth comes from stereo")));
}

TEST(DepthMaps, MapsAreCheckedBeforeCamerasAreSearchedFor) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.cameras_path.clear();
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  const std::string map = Stem(photos.model.views[7].name) + ".pfm";
  ASSERT_TRUE(WritePfm(input.depth_dir + "/" + map, Planes(1, kWidth, kHeight)).ok());
  const absl::Status status = Reconstruct(input, WithSource(DepthOrigin::kAuto)).status();
  EXPECT_EQ(Reason(status), "DEPTH_MAP_SIZE");
  EXPECT_EQ(GetErrorDetail(status)->field, "depth/" + map);
}

// As colour pictures of depth, and what other programs write: COLMAP takes an hour.
TEST(CheckMapsFit, RefusesWhatCannotBeReadAsAMap) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  const std::string stem = Stem(photos.model.views[7].name);
  const auto reason = [&](const std::string& ending, const std::string& bytes) {
    const std::string path = input.depth_dir + "/" + stem + ending;
    EXPECT_TRUE(WriteFileAtomically(path, bytes).ok());
    const absl::Status status = CheckMapsFit(CutInput(input), nullptr);
    std::filesystem::remove(path);
    EXPECT_EQ(GetErrorDetail(status)->field, "depth/" + stem + ending);
    return Reason(status);
  };
  EXPECT_EQ(reason(".png", EncodeMask(PlaneU8(kWidth, kHeight)).value()), "DEPTH_BITS");
  EXPECT_EQ(reason(".npy", "PK"), "DEPTH_NOT_RECOGNIZED");
}

TEST(CheckMapsFit, RefusesAMapThatMayBeOfTwoPhotos) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.cameras_path.clear();
  input.depth_dir = input.work_dir + "/maps";
  const std::string photo = photos.model.views[2].name, stem = Stem(photo);
  std::filesystem::create_directory(input.depth_dir);
  std::filesystem::copy_file(input.images_dir + "/" + photos.model.views[3].name,
                             input.images_dir + "/" + stem + ".jpeg");
  const auto give = [&](const std::string& map) {
    ASSERT_TRUE(WritePfm(input.depth_dir + "/" + map, Planes(1, kHeight, kWidth)).ok());
  };
  give(photo + ".pfm");
  EXPECT_EQ(Reason(CheckMapsFit(CutInput(input), nullptr)), "");
  give(stem + ".pfm");
  const absl::Status status = Reconstruct(input, WithSource(DepthOrigin::kAuto)).status();
  EXPECT_EQ(Reason(status), "DEPTH_MAP_AMBIGUOUS");
  EXPECT_EQ(GetErrorDetail(status)->field, "depth/" + stem + ".pfm");
  EXPECT_THAT(std::string(status.message()), HasSubstr("as " + stem + ".jpeg.pfm"));
  give(stem + ".jpeg.pfm");
  EXPECT_EQ(Reason(CheckMapsFit(CutInput(input), nullptr)), "");
}

TEST(CheckMapsFit, AMaskAmongThePhotosHasNoMap) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  const std::string photo = photos.model.views[2].name;
  ASSERT_TRUE(WriteFileAtomically(input.images_dir + "/" + photo + ".png",
                                  EncodeMask(PlaneU8(kWidth, kHeight)).value())
                  .ok());
  ASSERT_TRUE(WritePfm(input.depth_dir + "/" + photo + ".pfm", Planes(1, kHeight, kWidth)).ok());
  EXPECT_EQ(Reason(CheckMapsFit(CutInput(input), nullptr)), "");
}

// Their maps may be of the sensor's picture.
TEST(CheckMapsFit, SaysThatMapsMustBeUprightWhereExifTurnsPhotos) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  input.depth_dir = input.work_dir + "/maps";
  input.images_dir = input.work_dir + "/turned";
  std::filesystem::create_directory(input.depth_dir);
  std::filesystem::create_directory(input.images_dir);
  ASSERT_TRUE(WritePfm(input.depth_dir + "/a.pfm", Planes(1, 24, 32)).ok());
  const std::string jpeg = EncodeJpeg(TestImage(32, 24)).value();
  for (const int orientation : {1, 3, 6}) {
    ASSERT_TRUE(WriteFileAtomically(input.images_dir + "/a.jpg",
                                    WithJpegExif(jpeg, ExifBlock(orientation, true)))
                    .ok());
    std::vector<std::string> notes;
    const absl::Status status = CheckMapsFit(CutInput(input), &notes);
    EXPECT_EQ(notes.size(), orientation == 3 ? 1u : 0u);
    if (orientation == 3) {
      EXPECT_THAT(notes,
                  Contains(HasSubstr("a.jpg (orientation 3): its map must be of the photo")));
    }
    EXPECT_EQ(status.ok(), orientation != 6) << status;
    if (orientation != 6) continue;
    EXPECT_EQ(Reason(status), "DEPTH_MAP_SIZE");
    EXPECT_THAT(std::string(status.message()), HasSubstr("upright: EXIF turns it (orientation 6)"));
  }
}

TEST(DepthMaps, OfPhotosThatAreLearntAsViewsAreRefusedByThePhotosName) {
  const Photographs photos;
  CutInput input(photos.Input("work"));
  input.depth_dir = input.work_dir + "/maps";
  std::filesystem::create_directory(input.depth_dir);
  for (const View& view : photos.model.views) input.rig_views[view.name].rig = "sphere.jpg";
  const ReconstructOptions options = WithSource(DepthOrigin::kAuto);
  const CancelToken never;
  ReconstructReport report;
  const absl::Status status = CheckDepthSource(Context(
      input, options, never, [](Stage, const std::string&) {}, &report));
  EXPECT_EQ(Reason(status), "DEPTH_MAP_WITHOUT_PHOTO");
  EXPECT_THAT(std::string(status.message()), HasSubstr("sphere.jpg is learnt as several views"));
}

TEST(DepthMaps, InverseDepthsAreRefused) {
  RoomCapture room(6);
  room.TrackPointsEverywhere();
  ReconstructInput input = room.Input("work");
  input.depth_dir = room.Path("maps");
  std::filesystem::create_directory(input.depth_dir);
  ReconstructOptions options = room.Options(1);
  for (const bool inverse : {true, false}) {
    for (int i = 0; i < 6; ++i) {
      Planes depth = room.Depth(i);
      for (float& d : depth.data) d = inverse ? 1 / d : 5 + 2 * d;
      ASSERT_TRUE(WritePfm(input.depth_dir + "/" + Stem(room.Name(i)) + ".pfm", depth).ok());
    }
    const absl::Status status = Train(input, options).status();
    if (inverse) {
      EXPECT_EQ(Reason(status), "DEPTH_MAP_INVERSE");
      EXPECT_THAT(std::string(status.message()), HasSubstr("give 1/x"));
    } else {
      EXPECT_TRUE(status.ok()) << status;
    }
  }
}

// As of a sensor that sees no farther: nearly all points have one depth, which tells no order.
TEST(DepthMaps, DepthsClippedAtTheSensorsRangeAreTaken) {
  RoomCapture room(6);
  room.TrackPointsEverywhere();
  std::vector<double> distances;
  for (const SparsePoint& point : room.model.points) {
    for (const TrackElement& e : point.track) {
      distances.push_back(room.model.views[e.view].camera.CamFromWorld(point.xyz)[2]);
    }
  }
  std::sort(distances.begin(), distances.end());
  const auto range = static_cast<float>(distances[distances.size() / 100]);
  ReconstructInput input = room.Input("work");
  input.depth_dir = room.Path("maps");
  std::filesystem::create_directory(input.depth_dir);
  for (int i = 0; i < 6; ++i) {
    Planes depth = room.Depth(i);
    for (float& d : depth.data) d = std::min(d, range);
    ASSERT_TRUE(WritePfm(input.depth_dir + "/" + Stem(room.Name(i)) + ".pfm", depth).ok());
  }
  const auto report = Train(input, room.Options(1));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_TRUE(report->depth_used);
}

TEST(DepthMaps, ANetworkGivesMapsOfEveryPhoto) {
  const Photographs photos;
  ReconstructInput input = photos.Input("work");
  OnnxWriter model;
  model.AddInput("x", {1, 3, 24, 32});
  model.AddConstant("w", {1, 3, 1, 1}, {1, 1, 1});
  model.AddConstant("b", {1}, {0});
  model.AddNode("Conv", {"x", "w", "b"}, "y", {{"kernel_shape", {1, 1}}});
  model.AddOutput("y", {1, 1, 24, 32});
  input.depth_network.path = input.work_dir + "/depth.onnx";
  input.depth_network.width = 32;
  input.depth_network.height = 24;
  ASSERT_TRUE(WriteFileAtomically(input.depth_network.path, model.Bytes()).ok());
  const auto report = Reconstruct(input, WithSource(DepthOrigin::kNetwork));
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("network: 6 of 6 training photos")));
  // Another setting of the network is another map.
  const std::string kept = Bytes(Maps(input));
  input.depth_network.inverse = false;
  ASSERT_TRUE(Reconstruct(input, WithSource(DepthOrigin::kNetwork)).ok());
  EXPECT_FALSE(Bytes(Maps(input)) == kept);
}

TEST(DepthMaps, HaveAnEdgeUnlessTheyAreDistances) {
  RoomCapture room(6);
  room.TrackPointsEverywhere();
  ReconstructInput input = room.Input("work");
  input.depth_dir = room.Path("maps");
  std::filesystem::create_directory(input.depth_dir);
  for (int i = 0; i < 6; ++i) {
    const std::string map = input.depth_dir + "/" + Stem(room.Name(i)) + ".pfm";
    ASSERT_TRUE(WritePfm(map, room.Depth(i)).ok());
  }
  input.depth_network.path = input.work_dir + "/depth.onnx";
  input.depth_network.width = 32;
  input.depth_network.height = 24;
  ASSERT_TRUE(
      WriteFileAtomically(input.depth_network.path, PointwiseModel(24, 32, {1, 1, 1}, {0})).ok());
  const auto have_edge = [&](DepthOrigin source, bool inverse) {
    input.depth_network.inverse = inverse;
    ReconstructOptions options = room.Options(1);
    options.depth_source = source;
    ReconstructReport report;
    const CancelToken never;
    const auto set =
        MakeTrainSet(Context(
                         input, options, never, [](Stage, const std::string&) {}, &report),
                     kNoColmap);
    EXPECT_TRUE(set.ok()) << set.status();
    EXPECT_TRUE(set->train[0].depth.has_value());
    return set->train[0].depth->edge.has_value();
  };
  EXPECT_TRUE(have_edge(DepthOrigin::kMaps, true));
  EXPECT_FALSE(have_edge(DepthOrigin::kStereo, true));
  EXPECT_FALSE(have_edge(DepthOrigin::kNetwork, true));
  EXPECT_TRUE(have_edge(DepthOrigin::kNetwork, false));
  EXPECT_TRUE(have_edge(DepthOrigin::kNetwork, false)) << "as they were kept";
}

}  // namespace
}  // namespace litags
