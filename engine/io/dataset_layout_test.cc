#include "engine/io/dataset_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Kind = DatasetFile::Kind;

// By name; the number of bytes is the one behind '='.
DatasetFile File(std::string path) {
  DatasetFile file;
  if (const size_t mark = path.find('='); mark != std::string::npos) {
    file.bytes = std::stoi(path.substr(mark + 1));
    path.resize(mark);
  }
  const size_t slash = path.rfind('/');
  if (slash != std::string::npos) file.folder = path.substr(0, slash);
  file.name = slash == std::string::npos ? path : path.substr(slash + 1);
  if (file.name.ends_with(".jpg") || file.name.ends_with(".png")) file.kind = Kind::kPhoto;
  if (file.name.ends_with(".bin")) file.kind = Kind::kModel;
  if (file.name.ends_with(".json") || file.name.ends_with(".xml")) file.kind = Kind::kCameras;
  return file;
}

struct Used {
  std::vector<std::string> paths, notes;
  std::string photos;
  std::optional<std::string> cameras;
};

Used Use(const std::vector<std::string>& paths) {
  std::vector<DatasetFile> files;
  for (const std::string& path : paths) files.push_back(File(path));
  const DatasetLayout layout(files);
  Used used{{}, layout.Notes(), layout.photos(), layout.cameras()};
  for (const DatasetFile& file : files) {
    if (layout.Uses(file)) used.paths.push_back(file.Path());
  }
  return used;
}

TEST(DatasetLayout, OfNerfstudio) {
  const Used used =
      Use({"room/transforms.json", "room/images/1.jpg", "room/images/2.jpg", "room/images_2/1.jpg",
           "room/images_4/1.jpg", "room/images_8/1.jpg", "room/sparse_pc.ply",
           "room/colmap/sparse/0/cameras.bin", "room/colmap/sparse/0/images.bin"});
  EXPECT_THAT(used.paths, ElementsAre("room/transforms.json", "room/images/1.jpg",
                                      "room/images/2.jpg", "room/sparse_pc.ply"));
  EXPECT_EQ(used.photos, "room/images");
  EXPECT_EQ(used.cameras, "room/transforms.json");
  EXPECT_THAT(used.notes,
              ElementsAre("room/images_2/ (the photos are those in room/images/)",
                          "room/images_4/ (the photos are those in room/images/)",
                          "room/images_8/ (the photos are those in room/images/)",
                          "room/colmap/sparse/0 (the cameras are those in room/transforms.json)"));
}

TEST(DatasetLayout, OfMipNerf360) {
  const Used used = Use({"images/1.jpg", "images_2/1.jpg", "images_8/1.jpg", "poses_bounds.npy",
                         "sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin"});
  EXPECT_THAT(used.paths, ElementsAre("images/1.jpg", "poses_bounds.npy", "sparse/0/cameras.bin",
                                      "sparse/0/images.bin", "sparse/0/points3D.bin"));
  EXPECT_EQ(used.photos, "images");
  EXPECT_EQ(used.cameras, "sparse/0");
}

TEST(DatasetLayout, OfConvertPy) {
  const Used used = Use({"a/input/1.jpg", "a/distorted/database.db",
                         "a/distorted/sparse/0/cameras.bin", "a/distorted/sparse/0/images.bin=900",
                         "a/images/1.jpg", "a/sparse/0/cameras.bin", "a/sparse/0/images.bin=800",
                         "a/stereo/fusion.cfg", "a/stereo/depth_maps/1.jpg.geometric.png"});
  EXPECT_THAT(used.paths,
              ElementsAre("a/images/1.jpg", "a/sparse/0/cameras.bin", "a/sparse/0/images.bin"));
  EXPECT_EQ(used.cameras, "a/sparse/0");
  EXPECT_THAT(used.notes, ElementsAre("a/distorted/ (the photos are those in a/images/)",
                                      "a/input/ (the photos are those in a/images/)",
                                      "a/stereo/ (the photos are those in a/images/)"));
}

TEST(DatasetLayout, SmallerCopiesAloneStandForThePhotos) {
  const Used used = Use({"images_8/1.jpg", "images_4/1.jpg"});
  EXPECT_EQ(used.photos, "images_4");
  EXPECT_THAT(used.paths, ElementsAre("images_4/1.jpg"));
}

TEST(DatasetLayout, SmallerCopiesOfMasksAreLeftOut) {
  EXPECT_THAT(Use({"images/1.jpg", "masks/1.png", "masks_2/1.png", "depth_2/1.png"}).paths,
              ElementsAre("images/1.jpg", "masks/1.png", "depth_2/1.png"));
}

TEST(DatasetLayout, OfSeveralModelsTheLargestIsUsed) {
  const Used used = Use({"x/1.jpg", "sparse/0/images.bin=10", "sparse/1/images.bin=90"});
  EXPECT_EQ(used.cameras, "sparse/1");
  EXPECT_THAT(used.notes, ElementsAre("sparse/0 (the cameras are those in sparse/1)"));
}

TEST(DatasetLayout, AModelInSparseGoesBeforeOtherCameras) {
  EXPECT_EQ(Use({"1.jpg", "transforms.json", "sparse/0/images.bin"}).cameras, "sparse/0");
  EXPECT_EQ(Use({"1.jpg", "transforms.json", "images.bin"}).cameras, "");  // at the top
  EXPECT_EQ(Use({"a/1.jpg", "a/transforms.json", "a/elsewhere/cameras.xml"}).cameras,
            "a/transforms.json");
}

TEST(DatasetLayout, CamerasOfEqualRankAreAllLeftToTheUser) {
  for (const std::vector<std::string>& paths : std::vector<std::vector<std::string>>{
           {"images/1.jpg", "cameras.xml", "sfm_data.json"},
           {"images/1.jpg", "mine/transforms.json", "yours/transforms.json"},
           {"cam0/1.jpg", "cam1/2.jpg", "transforms.json", "sparse/0/images.bin"}}) {
    const Used used = Use(paths);
    EXPECT_EQ(used.paths, paths);
    EXPECT_EQ(used.cameras, std::nullopt);
    EXPECT_THAT(used.notes, IsEmpty());
  }
}

// By the names that files get, masks and depth maps by their folders.
std::vector<std::string> NamesOf(const std::vector<std::string>& paths) {
  std::vector<DatasetFile> files;
  for (const std::string& path : paths) {
    DatasetFile& file = files.emplace_back(File(path));
    if (path.find("masks/") != std::string::npos) file.kind = Kind::kMask;
    if (path.find("depth/") != std::string::npos) file.kind = Kind::kDepth;
  }
  const DatasetLayout layout(files);
  std::vector<std::string> names;
  for (const DatasetFile& file : files) names.push_back(layout.NameOf(file));
  return names;
}

TEST(DatasetLayout, FilesOfARigHaveTheirFoldersInTheirNames) {
  EXPECT_THAT(NamesOf({"r/images/cam0/1.jpg", "r/images/cam1/1.jpg", "r/images/2.jpg",
                       "r/masks/cam0/1.png", "r/images/cam1/masks/1.png", "r/depth/cam1/1.png",
                       "r/sparse/0/images.bin", "1.jpg"}),
              ElementsAre("cam0_1.jpg", "cam1_1.jpg", "2.jpg", "cam0_1.png", "cam1_1.png",
                          "cam1_1.png", "images.bin", "1.jpg"));
  EXPECT_THAT(NamesOf({"images/rig1/cam0/1.jpg", "images/rig1/cam1/1.jpg"}),
              ElementsAre("rig1_cam0_1.jpg", "rig1_cam1_1.jpg"));
  // Names that differ stay.
  EXPECT_THAT(NamesOf({"images/cam0/1.jpg", "images/cam1/2.jpg", "masks/cam0/1.png"}),
              ElementsAre("1.jpg", "2.jpg", "1.png"));
  EXPECT_THAT(NamesOf({"images/1.jpg", "images/thumbnails/1.jpg"}), ElementsAre("1.jpg", "1.jpg"));
  EXPECT_THAT(NamesOf({"a/images/1.jpg", "b/images/1.jpg"}), ElementsAre("1.jpg", "1.jpg"));
}

TEST(DatasetLayout, OfARigCopiesAreLeftOutAndCamerasFound) {
  const Used used = Use({"images/cam0/1.jpg", "images/cam1/1.jpg", "images_2/cam0/1.jpg",
                         "images_2/cam1/1.jpg", "transforms.json", "sparse/0/images.bin"});
  EXPECT_THAT(used.paths,
              ElementsAre("images/cam0/1.jpg", "images/cam1/1.jpg", "sparse/0/images.bin"));
  EXPECT_EQ(used.photos, "images");
  // The only folder of photos is a place, too.
  EXPECT_EQ(Use({"images/room/1.jpg", "images/room/transforms.json", "old/images.bin"}).cameras,
            "images/room/transforms.json");
}

TEST(DatasetLayout, CapturesSideBySideAreNoDataset) {
  const std::vector<std::string> paths = {"a/images/1.jpg", "b/images/1.jpg", "b/images_2/1.jpg"};
  EXPECT_EQ(Use(paths).paths, paths);
  EXPECT_EQ(Use(paths).photos, "");
}

TEST(DatasetLayout, OtherFoldersStay) {
  const std::vector<std::string> paths = {"images/1.jpg", "images_left/2.jpg", "images_1/3.jpg",
                                          "more/input/4.jpg", "inputs/5.jpg"};
  EXPECT_EQ(Use(paths).paths, paths);
}

}  // namespace
}  // namespace litags
