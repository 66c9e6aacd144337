#include "server/jobs/start_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/jobs/placement.h"
#include "server/reader/file_findings.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

constexpr int64_t kGiB = int64_t{1} << 30;

FileRecord File(FileRole role, const std::string& name, int width = 0, int height = 0) {
  return {name, role, 1, name, width, height};
}

// One that shows something of its own.
PhotoFindings Found(const std::string& pixels) {
  PhotoFindings found;
  found.mean_code = 50;
  found.light = 0.1;
  found.structure = 1;
  found.pixels = pixels;
  return found;
}

FileRecord Photo(const std::string& name, const PhotoFindings& found, int width = 640,
                 int height = 480) {
  FileRecord photo = File(FileRole::kPhoto, name, width, height);
  photo.about = Encode(found);
  return photo;
}

std::string Pixels(int i) { return absl::StrCat(absl::Hex(i, absl::kZeroPad16)); }

// "0.jpg", "1.jpg", ...
std::vector<FileRecord> Photos(int count, int width = 640, int height = 480) {
  std::vector<FileRecord> photos;
  for (int i = 0; i < count; ++i) {
    photos.push_back(Photo(absl::StrCat(i, ".jpg"), Found(Pixels(i)), width, height));
  }
  return photos;
}

std::vector<FileRecord> With(std::vector<FileRecord> files, const std::vector<FileRecord>& more) {
  files.insert(files.end(), more.begin(), more.end());
  return files;
}

absl::Status Check(const std::vector<FileRecord>& files, const ReconstructOptions& options = {}) {
  return CheckFiles(files, options, 0).status();
}

// Frames are chosen, and named, as the job runs.
TEST(StartChecks, NothingThatIsOfPhotosByNameComesWithAVideo) {
  const FileRecord video = File(FileRole::kVideo, "night.mov", 640, 480);
  EXPECT_TRUE(Check({video}).ok());
  for (const FileRecord& other :
       {File(FileRole::kMask, "frame_0001.png", 640, 480), File(FileRole::kDepth, "a.npy"),
        File(FileRole::kCameras, "transforms.json"), File(FileRole::kColmap, "cameras.bin")}) {
    const absl::Status status = Check({video, other});
    EXPECT_EQ(Reason(status), "VIDEO_NOT_ALONE") << other.name;
    EXPECT_THAT(std::string(status.message()), HasSubstr("cut frames out")) << other.name;
  }
}

TEST(StartChecks, TwoPanoramasAreEnoughAndTwoPhotosAreNot) {
  PhotoFindings panorama = Found(Pixels(7));
  panorama.has_views = 1;
  const FileRecord cameras = File(FileRole::kCameras, "cameras.xml");
  EXPECT_TRUE(
      Check({Photo("a.jpg", panorama, 1000, 500), Photo("b.jpg", panorama, 1000, 500)}).ok());
  EXPECT_TRUE(Check(With(Photos(2, 1000, 500), {cameras})).ok());
  EXPECT_EQ(Reason(Check(Photos(2, 1000, 500))), "TOO_FEW_PHOTOS");
  EXPECT_EQ(Reason(Check(With(Photos(2), {cameras}))), "TOO_FEW_PHOTOS");
}

TEST(StartChecks, OfAColmapModelTheFormOfTheCamerasThatTheEngineReadsMustBeWhole) {
  const auto check = [](const std::vector<std::string>& names) {
    std::vector<FileRecord> files = Photos(3);
    for (const std::string& name : names) files.push_back(File(FileRole::kColmap, name));
    return Reason(Check(files));
  };
  EXPECT_EQ(check({"cameras.bin", "images.bin"}), "");
  EXPECT_EQ(check({"cameras.txt", "images.txt", "images.bin"}), "");
  EXPECT_EQ(check({"cameras.bin", "cameras.txt", "images.txt"}), "COLMAP_INCOMPLETE");
  EXPECT_EQ(check({"images.bin"}), "COLMAP_INCOMPLETE");
}

TEST(StartChecks, OneCameraAtLeastIsOfAPhoto) {
  const auto with = [](FileRole role, const std::string& name,
                       const std::vector<std::string>& paths) {
    FileRecord cameras = File(role, name);
    cameras.about = Encode(CameraFindings::Of(paths));
    return cameras;
  };
  const auto json = [&](const std::vector<std::string>& paths) {
    return with(FileRole::kCameras, "transforms.json", paths);
  };
  const absl::Status none = Check(With(Photos(3), {json({"./images/frame_1.png", "x.jpg"})}));
  EXPECT_EQ(Reason(none), "NO_MATCHING_CAMERAS");
  EXPECT_THAT(std::string(none.message()), HasSubstr("'0.jpg', and one is './images/frame_1.png'"));
  EXPECT_TRUE(Check(With(Photos(3), {json({"x.jpg", "./images/2.PNG"})})).ok());
  const FileRecord unknown = File(FileRole::kCameras, "transforms.json");
  EXPECT_TRUE(Check(With(Photos(3), {unknown})).ok()) << "stored by an earlier version";
  // Of two forms of a model the engine reads the binary one.
  const FileRecord binary = File(FileRole::kColmap, "cameras.bin");
  const std::vector<FileRecord> images = {with(FileRole::kColmap, "images.bin", {"x.jpg"}),
                                          with(FileRole::kColmap, "images.txt", {"0.jpg"})};
  EXPECT_EQ(Reason(Check(With(With(Photos(3), images), {binary}))), "NO_MATCHING_CAMERAS");
  const FileRecord text = File(FileRole::kColmap, "cameras.txt");
  EXPECT_TRUE(Check(With(With(Photos(3), images), {text})).ok());
}

TEST(StartChecks, AMaskThatOnlyATransformsJsonTellsHidesNoOther) {
  const FileRecord json = File(FileRole::kCameras, "transforms.json"),
                   xml = File(FileRole::kCameras, "cameras.xml"),
                   orphan = File(FileRole::kMask, "of_7.png", 640, 480),
                   wrong = File(FileRole::kMask, "1.png", 9, 9);
  EXPECT_EQ(Reason(Check(With(Photos(3), {orphan}))), "MASK_WITHOUT_PHOTO");
  EXPECT_EQ(Reason(Check(With(Photos(3), {orphan, xml}))), "MASK_WITHOUT_PHOTO");
  EXPECT_TRUE(Check(With(Photos(3), {orphan, json})).ok());
  EXPECT_EQ(Reason(Check(With(Photos(3), {orphan, wrong, json}))), "MASK_SIZE");
}

TEST(StartChecks, ADepthMapHasTheNameOfItsPhotoOrOfAViewOfIt) {
  const auto check = [](const std::string& map) {
    return Reason(Check(With(Photos(3), {File(FileRole::kDepth, map)})));
  };
  EXPECT_EQ(check("0.pfm"), "");
  EXPECT_EQ(check("0_front.png"), "");
  EXPECT_EQ(check("0.jpg.png"), "");
  EXPECT_EQ(check("0.jpg_up.npy"), "");
  EXPECT_EQ(check("0_front.png.npy"), "");
  for (const char* other : {"0_depth.pfm", "00.png", "10.npy", "0.png.png"}) {
    EXPECT_EQ(check(other), "DEPTH_MAP_WITHOUT_PHOTO") << other;
  }
  // Of a panorama views alone have maps.
  PhotoFindings panorama = Found(Pixels(7));
  panorama.has_views = 1;
  const std::vector<FileRecord> panoramas = {Photo("a.jpg", panorama, 1000, 500)};
  EXPECT_EQ(Reason(Check(With(panoramas, {File(FileRole::kDepth, "a.npy")}))),
            "DEPTH_MAP_WITHOUT_PHOTO");
  EXPECT_TRUE(Check(With(panoramas, {File(FileRole::kDepth, "a_left.npy")})).ok());
  ReconstructOptions without;
  without.method = Method::k3dgs;
  EXPECT_TRUE(Check(With(Photos(3), {File(FileRole::kDepth, "other.npy")}), without).ok());
}

TEST(StartChecks, ADepthMapIsOfOnePhoto) {
  const auto check = [](const std::vector<std::string>& maps) {
    std::vector<FileRecord> files = With(Photos(3), {Photo("0.jpeg", Found(Pixels(7)))});
    for (const std::string& map : maps) files.push_back(File(FileRole::kDepth, map, 320, 240));
    return Check(files);
  };
  const absl::Status status = check({"0.npy"});
  EXPECT_EQ(Reason(status), "DEPTH_MAP_AMBIGUOUS");
  EXPECT_EQ(GetErrorDetail(status)->field, "depths[0.npy]");
  EXPECT_EQ(Reason(check({"0.npy", "0.jpg.npy"})), "DEPTH_MAP_AMBIGUOUS");
  EXPECT_EQ(Reason(check({"0.jpg.npy", "0.jpeg.npy", "0.npy"})), "");
  EXPECT_EQ(Reason(check({"0.jpg.npy", "1.npy"})), "");
}

TEST(StartChecks, ADepthMapHasTheShapeOfItsPhoto) {
  const auto check = [](const std::vector<FileRecord>& maps) {
    return Reason(Check(With(Photos(3), maps)));
  };
  EXPECT_EQ(check({File(FileRole::kDepth, "0.pfm", 320, 240)}), "");
  EXPECT_EQ(check({File(FileRole::kDepth, "0.pfm", 240, 320)}), "DEPTH_MAP_SIZE");
  EXPECT_EQ(check({File(FileRole::kDepth, "0.pfm")}), "") << "its size is not known";
  // A picture of the map, which the engine does not read.
  EXPECT_EQ(
      check({File(FileRole::kDepth, "0.npy", 320, 240), File(FileRole::kDepth, "0.png", 900, 100)}),
      "");
}

TEST(StartChecks, PhotosThatWouldBeLeftOutDoNotCount) {
  const auto many = [](const PhotoFindings& found) {
    std::vector<FileRecord> photos;
    for (int i = 0; i < 8; ++i) photos.push_back(Photo(absl::StrCat(i, ".jpg"), found));
    return photos;
  };
  const std::vector<FileRecord> black = many(Found("")), copies = many(Found(Pixels(9)));
  const absl::Status status = Check(copies);
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("1 of 8 photos"));
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("left out: 1.jpg: is the same photo as 0.jpg"));
  EXPECT_THAT(std::string(Check(black).message()), HasSubstr("0.jpg: is of one colour"));
  EXPECT_TRUE(Check(With(Photos(3), {Photo("3.jpg", Found(""))})).ok());
  // Where the engine may see others.
  EXPECT_TRUE(Check(With(black, {File(FileRole::kMask, "0.png", 640, 480)})).ok());
  EXPECT_TRUE(Check(With(black, {File(FileRole::kCameras, "transforms.json")})).ok());
  EXPECT_TRUE(Check(With(black, {File(FileRole::kPhoto, "of_an_old_server.jpg", 4, 3)})).ok());
  std::vector<FileRecord> wide = copies;
  for (FileRecord& photo : wide) photo.width = 960;
  EXPECT_TRUE(Check(wide).ok());
}

TEST(StartChecks, PhotosNeedMemory) {
  ReconstructOptions options;
  const auto photos = Photos(300, 4000, 3000);
  const int64_t least = *CheckFiles(photos, options, 0);
  EXPECT_GT(least, 8 * kGiB);
  EXPECT_LT(least, 16 * kGiB);
  const absl::Status status = CheckFiles(photos, options, 2 * kGiB).status();
  EXPECT_EQ(Reason(status), "MEMORY_EXCEEDED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("max_image_side"));
  EXPECT_EQ(*CheckFiles(photos, options, 16 * kGiB), least);
  // Photos that are left out take none; of cameras that are given, some photos may have none.
  EXPECT_EQ(
      *CheckFiles(With(photos, {Photo("copy of 0.jpg", Found(Pixels(0)), 4000, 3000)}), options, 0),
      least);
  EXPECT_EQ(*CheckFiles(With(photos, {File(FileRole::kCameras, "transforms.json")}), options, kGiB),
            0);
  EXPECT_EQ(*CheckFiles({File(FileRole::kVideo, "a.mov", 4000, 3000)}, options, kGiB), 0);
}

TEST(StartChecks, AWorkerThatIsTooSmallForThePhotosDoesNotFit) {
  const auto fits = [](const JobPolicy& policy, int64_t least, int64_t has) {
    return Fits(NeedsOf(policy, {}, least), Resources{1, has, {}});
  };
  EXPECT_TRUE(fits({}, 7 * kGiB, 8 * kGiB));
  EXPECT_FALSE(fits({}, 7 * kGiB, 7 * kGiB));
  EXPECT_TRUE(fits({}, kGiB / 8, 1)) << "no more than any worker has";
  JobPolicy policy;
  policy.max_memory_bytes = 8 * kGiB;
  policy.min_memory_bytes = kGiB;
  EXPECT_FALSE(fits(policy, 7 * kGiB, 6 * kGiB));
  EXPECT_TRUE(fits(policy, 7 * kGiB, 7 * kGiB)) << "its limit is its own";
}

}  // namespace
}  // namespace litags
