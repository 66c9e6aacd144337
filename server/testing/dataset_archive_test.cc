// Archives as nerfstudio, 3DGS and Mip-NeRF 360 lay them out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/colmap_io.h"
#include "engine/io/depth_io.h"
#include "server/store/digest.h"
#include "server/testing/api_fixture.h"
#include "server/testing/archives.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::MatchesRegex;
using ::testing::StartsWith;

std::string Transforms(const std::string& photo) {
  return R"({"w": 64, "h": 48, "fl_x": 60, "fl_y": 60, "cx": 32, "cy": 24, "frames": [{"file_path":
      "images/)" +
         photo + R"(", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})";
}

class DatasetArchive : public ApiTest {
 protected:
  using Files = std::vector<std::pair<std::string, std::string>>;

  // Three photos of this size, in a folder.
  static Files Photos(const std::string& folder, int width, int height) {
    Files files;
    for (int i = 0; i < 3; ++i) {
      files.emplace_back(folder + "/" + std::to_string(i) + ".png", TestPng(width, height, i));
    }
    return files;
  }

  // A COLMAP model of one camera, no file of which is as those in other folders.
  static Files Model(const std::string& folder) {
    const double some = static_cast<double>(std::hash<std::string>()(folder) % 1000);
    SparseModel model;
    View& view = model.views.emplace_back();
    view.name = "0.png";
    view.camera.width = 64;
    view.camera.height = 48;
    view.camera.fx = view.camera.fy = 50 + some;
    view.camera.cx = 32;
    view.camera.cy = 24;
    view.camera.t = {some, 0, 0};
    model.distortions.emplace_back();
    model.points.emplace_back().xyz = {some, 0, 1};
    const ColmapFiles files = EncodeColmapModel(model).value();
    return {{folder + "/cameras.bin", files.cameras},
            {folder + "/images.bin", files.images},
            {folder + "/points3D.bin", files.points}};
  }

  grpc::Status Send(const std::vector<Files>& parts, bool same_job = false) {
    std::string tar;
    contents_.clear();
    for (const Files& files : parts) {
      for (const auto& [path, bytes] : files) {
        tar += TarEntry(path, bytes);
        Sha256 sha;
        sha.Update(bytes);
        contents_[sha.HexDigest()] = path;
      }
    }
    if (!same_job) job_ = NewJob();
    return client_.Upload(job_, {{"a.tar", tar + std::string(1024, '\0'), v1::FILE_ROLE_ARCHIVE}},
                          &response_);
  }

  // What the job's files are, by name; photos have no word.
  std::vector<std::string> StoredNames() {
    const auto files = store_->Files(job_.substr(5));
    std::vector<std::string> names;
    for (const FileRecord& file : *files) {
      if (file.role == FileRole::kArchive) continue;
      const char* role = file.role == FileRole::kMask     ? "mask "
                         : file.role == FileRole::kDepth  ? "depth "
                         : file.role == FileRole::kColmap ? "colmap "
                                                          : "";
      names.push_back(role + file.name);
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  // Where the job's files were in the archive, in order.
  std::vector<std::string> Stored() {
    const auto files = store_->Files(job_.substr(5));  // of "jobs/ID"
    std::vector<std::string> paths;
    for (const FileRecord& file : *files) {
      if (file.role != FileRole::kArchive) paths.push_back(contents_[file.sha256]);
    }
    std::sort(paths.begin(), paths.end());
    return paths;
  }

  std::vector<std::string> Skipped() const {
    return {response_.skipped().begin(), response_.skipped().end()};
  }

  std::string job_;
  v1::UploadImagesResponse response_;
  std::map<std::string, std::string> contents_;  // path by digest
};

TEST_F(DatasetArchive, OfNerfstudio) {
  const grpc::Status sent =
      Send({Photos("r/images", 64, 48),
            Photos("r/images_2", 32, 24),
            {{"r/transforms.json", Transforms("0.png")}, {"r/sparse_pc.ply", "ply"}},
            Model("r/colmap/sparse/0")});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(Stored(), ElementsAre("r/images/0.png", "r/images/1.png", "r/images/2.png",
                                    "r/transforms.json"));
  EXPECT_THAT(Skipped(),
              ElementsAre("r/images_2/ (the photos are those in r/images/)",
                          "r/colmap/sparse/0 (the cameras are those in r/transforms.json)",
                          "r/sparse_pc.ply"));
}

TEST_F(DatasetArchive, OfMipNerf360) {
  const grpc::Status sent = Send({Model("g/sparse/0"),
                                  Photos("g/images", 64, 48),
                                  Photos("g/images_4", 16, 12),
                                  Photos("g/images_8", 8, 6),
                                  {{"g/poses_bounds.npy", "npy"}}});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(Stored(), ElementsAre("g/images/0.png", "g/images/1.png", "g/images/2.png",
                                    "g/sparse/0/cameras.bin", "g/sparse/0/images.bin",
                                    "g/sparse/0/points3D.bin"));
}

TEST_F(DatasetArchive, OfConvertPy) {
  const grpc::Status sent = Send({Model("distorted/sparse/0"),
                                  Photos("images", 60, 44),
                                  Photos("input", 64, 48),
                                  Model("sparse/0"),
                                  {{"stereo/fusion.cfg", "x"}, {"distorted/database.db", "x"}}});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(Stored(),
              ElementsAre("images/0.png", "images/1.png", "images/2.png", "sparse/0/cameras.bin",
                          "sparse/0/images.bin", "sparse/0/points3D.bin"));
  EXPECT_THAT(Skipped(), ElementsAre("distorted/ (the photos are those in images/)",
                                     "input/ (the photos are those in images/)",
                                     "stereo/ (the photos are those in images/)"));
}

// As COLMAP's recipe for known poses has it.
TEST_F(DatasetArchive, AModelMayHaveAnEmptyFileOfPoints) {
  const grpc::Status sent = Send({Photos("images", 64, 48),
                                  {{"sparse/cameras.txt", "1 PINHOLE 64 48 50 50 32 24\n"},
                                   {"sparse/images.txt", "1 1 0 0 0 0 0 0 1 0.png\n\n"},
                                   {"sparse/points3D.txt", ""}}});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(StoredNames(),
              ElementsAre("0.png", "1.png", "2.png", "colmap cameras.txt", "colmap images.txt"));
  EXPECT_THAT(Skipped(), IsEmpty());
  v1::Job job;
  EXPECT_TRUE(client_.Start(job_, &job).ok());
}

TEST_F(DatasetArchive, MasksAndDepthMapsMayLieInFolders) {
  Planes depth(1, 48, 64);
  std::fill(depth.data.begin(), depth.data.end(), 2.0f);
  const std::string mask = TestPng(64, 48, 7);
  const grpc::Status sent = Send({Photos("r/images/cam0", 64, 48),
                                  {{"r/masks/cam0/0.png", mask},
                                   {"r/images/cam0/masks/1.png", mask},
                                   {"r/depth/cam0/0.pfm", EncodePfm(depth)},
                                   {"r/depth/cam0/preview.jpg", TestJpeg()}}});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(StoredNames(),
              ElementsAre("0.png", "1.png", "2.png", "depth 0.pfm", "mask 0.png", "mask 1.png"));
  EXPECT_THAT(Skipped(), ElementsAre("r/depth/cam0/preview.jpg"));
}

TEST_F(DatasetArchive, FilesOfARigHaveTheirFoldersInTheirNames) {
  const std::string mask = TestPng(64, 48, 7);
  std::vector<Files> rig = {Photos("g/images/cam0", 64, 48),
                            Photos("g/images/cam1", 64, 48),
                            {{"g/masks/cam0/0.png", mask},
                             {"g/masks/cam1/0.png", mask},
                             {"g/images/cam1/9.png", "no photo"},
                             {"g/masks/cam1/9.png", mask}},
                            Model("g/sparse/0")};
  for (const bool again : {false, true}) {  // it may come again, packed anew
    if (again) rig.push_back({{"g/a.ini", "x"}});
    const grpc::Status sent = Send(rig, /*same_job=*/again);
    ASSERT_TRUE(sent.ok()) << sent.error_message();
    EXPECT_THAT(StoredNames(),
                ElementsAre("cam0_0.png", "cam0_1.png", "cam0_2.png", "cam1_0.png", "cam1_1.png",
                            "cam1_2.png", "colmap cameras.bin", "colmap images.bin",
                            "colmap points3D.bin", "mask cam0_0.png", "mask cam1_0.png"));
    std::vector<std::string> skipped = Skipped();
    skipped.resize(2);
    EXPECT_THAT(skipped, ElementsAre(StartsWith("g/images/cam1/9.png ("),
                                     "g/masks/cam1/9.png (its photo is left out)"));
  }
}

TEST_F(DatasetArchive, WithCamerasThatNoRuleTellsApartIsRefused) {
  EXPECT_REFUSED(Send({Photos("images", 64, 48),
                       {{"mine/transforms.json", Transforms("0.png")},
                        {"yours/transforms_new.json", Transforms("1.png")}}}),
                 INVALID_ARGUMENT, "CAMERAS_TWICE", "cameras[transforms_new.json]");
  EXPECT_REFUSED(Send({Photos("images", 64, 48), Model("mine"), Model("yours")}), INVALID_ARGUMENT,
                 "ARCHIVE_NAME_TWICE", "archives[a.tar]");
  EXPECT_REFUSED(Send({Photos("a/images", 64, 48), Photos("b/images", 64, 48)}), INVALID_ARGUMENT,
                 "ARCHIVE_NAME_TWICE", "archives[a.tar]");
}

TEST_F(DatasetArchive, APhotoThatCannotBeReadIsLeftOutByName) {
  const std::string cut = TestPng(64, 48, 9).substr(0, 100);
  const grpc::Status sent = Send(
      {{{"a/masks/cut.png.png", TestPng(64, 48, 7)}, {"a/masks/0.png.png", TestPng(64, 48, 7)}},
       {{"a/cut.png", cut},
        {"a/empty.jpg", ""},
        {"a/K\x81"
         "che.png",
         TestPng(64, 48, 8)}},
       Photos("a", 64, 48),
       {{"a/notes.txt", "x"}}});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(Stored(), ElementsAre("a/0.png", "a/1.png", "a/2.png", "a/masks/0.png.png"));
  EXPECT_THAT(Skipped(),
              ElementsAre(MatchesRegex("a/cut.png \\(.*send the whole file again\\)"),
                          StartsWith("a/empty.jpg (the file in archives[a.tar] has no bytes"),
                          StartsWith("a/K\uFFFDche.png (the file name is not valid UTF-8"),
                          "a/masks/cut.png.png (its photo is left out)", "a/notes.txt"));
  v1::Job job;
  EXPECT_TRUE(client_.Start(job_, &job).ok());
}

TEST_F(DatasetArchive, MasksOfPhotosThatAreThereStay) {
  const std::string mask = TestPng(64, 48, 7), cut = TestPng(64, 48, 9).substr(0, 100);
  const grpc::Status sent =
      Send({{{"a/IMG_1.jpg", TestJpeg()}, {"a/IMG_1.png", cut}, {"a/IMG_2.png", cut}},
            {{"a/masks/IMG_1.png", mask},
             {"a/masks/IMG_1.png.png", mask + "x"},
             {"a/masks/IMG_2.png", mask + "y"}},
            Photos("a", 64, 48)});
  ASSERT_TRUE(sent.ok()) << sent.error_message();
  EXPECT_THAT(Stored(),
              ElementsAre("a/0.png", "a/1.png", "a/2.png", "a/IMG_1.jpg", "a/masks/IMG_1.png"));
  EXPECT_THAT(Skipped(), ElementsAre(StartsWith("a/IMG_1.png ("), StartsWith("a/IMG_2.png ("),
                                     "a/masks/IMG_1.png.png (its photo is left out)",
                                     "a/masks/IMG_2.png (its photo is left out)"));
}

TEST_F(DatasetArchive, ThatIsDamagedLeavesNothingInTheJob) {
  std::string tar = TarEntry("images/0.png", TestPng(64, 48, 1)) + std::string(512, 'x');
  job_ = NewJob();
  EXPECT_EQ(client_.Upload(job_, {{"a.tar", tar, v1::FILE_ROLE_ARCHIVE}}).error_code(),
            grpc::INVALID_ARGUMENT);
  EXPECT_THAT(Stored(), IsEmpty());
}

}  // namespace
}  // namespace litags
