#include "server/jobs/work_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/testing/job_store_kind.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

class WorkImport : public ::testing::Test {
 protected:
  void AddJob(const std::string& id) {
    ASSERT_TRUE(store_->Create(MakeJob(id, 1, JobState::kSucceeded), Nothing).ok());
  }

  void Write(const std::string& path, const std::string& bytes) {
    const fs::path full = fs::path(data_.work()) / path;
    fs::create_directories(full.parent_path());
    std::ofstream(full) << bytes;
  }

  absl::Status Import() { return ImportWorkFolders(store_.get(), blobs_.get(), data_); }

  std::string Kept(const std::string& id, const std::string& name) {
    const auto kept = Decode<KeptFiles>(store_->Get(id)->kept);
    if (!kept.ok() || !kept->contains(name)) return "";
    return *blobs_->Get(BlobKey(id, kept->at(name).blob));
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
};

TEST_F(WorkImport, FoldersOfEveryEarlierLayoutBecomeBlobs) {
  AddJob("old");
  Write("old/input/photos/a.png", "photo");
  Write("old/run/scene.litags", "scene of a job before there were lease folders");
  AddJob("new");
  Write("new/lease-3/run/scene.litags", "of a lease that was lost");
  Write("new/lease-12/input/photos/a.png", "photo");
  Write("new/lease-12/run/scene.litags", "scene");
  Write("new/lease-12/run/checkpoint.litags", "checkpoint");
  Write("new/lease-12/run/cameras/images.bin", "cameras");
  Write("new/lease-12/run/sfm/raw/log", "log");
  AddJob("none");
  Write("none/lease-2/input/photos/a.png", "never ran");
  ASSERT_TRUE(Import().ok());
  EXPECT_EQ(Kept("old", kSceneFile), "scene of a job before there were lease folders");
  EXPECT_EQ(Kept("new", kSceneFile), "scene");
  EXPECT_EQ(Kept("new", "checkpoint.litags"), "checkpoint");
  EXPECT_EQ(Kept("new", "cameras/images.bin"), "cameras");
  EXPECT_EQ(Decode<KeptFiles>(store_->Get("new")->kept)->size(), 3u);
  EXPECT_EQ((**Jobs::SceneOf(*store_->Get("new"))).bytes, 5);
  EXPECT_FALSE(fs::exists(data_.work()));
  EXPECT_TRUE(Import().ok()) << "there is nothing any more";
}

TEST_F(WorkImport, InterruptedOneGoesOnAndFoldersOfNobodyStay) {
  AddJob("half");
  ASSERT_TRUE(store_
                  ->Update("half",
                           [](JobTransaction& job) {
                             job.job.kept = Encode(KeptFiles{{kSceneFile, {"5/aa", 1}}});
                             return absl::OkStatus();
                           })
                  .ok());
  Write("half/lease-5/run/cameras/images.bin", "the scene's folder was being removed");
  Write("nobody/run/scene.litags", "a backup of the database may come back");
  ASSERT_TRUE(Import().ok());
  EXPECT_EQ(Decode<KeptFiles>(store_->Get("half")->kept)->at(kSceneFile).blob, "5/aa");
  EXPECT_FALSE(fs::exists(data_.work() + "/half"));
  EXPECT_TRUE(fs::exists(data_.work() + "/nobody/run/scene.litags"));
}

}  // namespace
}  // namespace litags
