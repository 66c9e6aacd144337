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
