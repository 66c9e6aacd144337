#include "server/worker/work_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/work_folder.h"
#include "server/jobs/codec.h"
#include "server/store/digest.h"
#include "server/testing/faulty_blob_store.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

class WorkFolderTest : public ::testing::Test {
 protected:
  WorkFolderTest() { fs::create_directory(Scratch()); }

  std::string Scratch() const { return dir_.path() + "/scratch"; }

  std::unique_ptr<WorkFolder> Take(int64_t number, const KeptFiles& kept = {},
                                   BlobStore* blobs = nullptr) {
    leases_.push_back(std::make_unique<Lease>());
    leases_.back()->job.id = "a1";
    leases_.back()->job.last_event = number;
    if (!kept.empty()) leases_.back()->job.kept = Encode(kept);
    return *WorkFolder::Make(*leases_.back(), blobs ? blobs : blobs_.get(), Scratch());
  }

  void Write(const WorkFolder& folder, const std::string& name, const std::string& bytes) {
    const fs::path path = fs::path(folder.run()) / name;
    fs::create_directories(path.parent_path());
    ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  }

  // Keys of all blobs, relative to the job's.
  std::vector<std::string> Blobs() const {
    std::vector<std::string> names;
    const fs::path root = dir_.path() + "/blobs/jobs/a1";
    if (!fs::exists(root)) return names;
    for (const auto& entry : fs::recursive_directory_iterator(root)) {
      if (entry.is_regular_file()) names.push_back(fs::relative(entry.path(), root));
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  static std::string Blob(int64_t lease, const std::string& bytes) {
    return LeaseBlob(lease, Sha256::Hex(bytes));
  }

  TempDir dir_;
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(dir_.path() + "/blobs");
  std::vector<std::unique_ptr<Lease>> leases_;
};

TEST_F(WorkFolderTest, AFinishedSceneThatWasSetAsideStaysAndIsNotTheEngines) {
  const auto first = Take(3);
  Write(*first, kSceneFile, "finished");
  EXPECT_TRUE(*first->Store());
  KeptFiles kept = first->kept();
  kept[kFinishedScene] = kept[kSceneFile];
  const auto second = Take(9, kept);
  ASSERT_TRUE(second->Fetch().ok());
  EXPECT_FALSE(fs::exists(second->run() + "/" + kFinishedScene));
  Write(*second, kSceneFile, "half way");
  EXPECT_TRUE(*second->Store());
  second->RemoveReplaced();
  EXPECT_EQ(second->kept().at(kFinishedScene), kept[kSceneFile]);
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "finished"), Blob(9, "half way")));
}

TEST_F(WorkFolderTest, NextLeaseFindsWhatTheEngineLeft) {
  const auto first = Take(3);
  Write(*first, "checkpoint", "c1");
  Write(*first, "cameras/images.bin", "i");
  Write(*first, "sfm/database.db", "of no use later");
  Write(*first, "wide_views/0_front.png", "cut anew by every run");
  Write(*first, "half.litags-tmp", "being written");
  EXPECT_TRUE(*first->Store());
  EXPECT_FALSE(*first->Store());
  EXPECT_THAT(first->kept(), ElementsAre(Pair("cameras/images.bin", KeptFile{Blob(3, "i"), 1}),
                                         Pair("checkpoint", KeptFile{Blob(3, "c1"), 2})));
  EXPECT_EQ(first->stored_bytes(), 3);
  const auto second = Take(9, first->kept());
  ASSERT_TRUE(second->Fetch().ok());
  ASSERT_TRUE(second->Fetch().ok()) << "again, as after an interruption";
  EXPECT_EQ(*ReadFile(second->run() + "/checkpoint", "", 9), "c1");
  EXPECT_EQ(*ReadFile(second->run() + "/cameras/images.bin", "", 9), "i");
  EXPECT_FALSE(*second->Store()) << "nothing has changed";
  EXPECT_EQ(second->stored_bytes(), 0);
}

// It would be refused as if it were of somebody else.
TEST_F(WorkFolderTest, FoldersThatComeBackAreTheEngines) {
  const auto first = Take(3);
  const std::string cameras = first->run() + "/cameras";
  ASSERT_TRUE(MakeOwnFolder(cameras).ok());
  Write(*first, "cameras/images.bin", "i");
  ASSERT_TRUE(*first->Store());
  EXPECT_THAT(first->kept(), ElementsAre(Pair("cameras/images.bin", KeptFile{Blob(3, "i"), 1})));
  const auto second = Take(9, first->kept());
  ASSERT_TRUE(second->Fetch().ok());
  EXPECT_TRUE(CheckOwnFolder(second->run() + "/cameras").ok());
  EXPECT_FALSE(fs::exists(second->run() + "/" + kOwnFolderMarker));
  EXPECT_FALSE(*second->Store()) << "nothing has changed";
}

// A photo that is left out makes a folder of links to the others, which the run before stored.
TEST_F(WorkFolderTest, LinksToFilesAreNotKeptInTheirPlace) {
  const auto folder = Take(3);
  Write(*folder, "frames/a.png", "frame");
  for (const char* name : {"photos", "views", "found_masks", "wide_views_2"}) {
    fs::create_directory(folder->run() + "/" + name);
    fs::create_symlink("../frames/a.png", folder->run() + "/" + name + "/a.png");
  }
  fs::create_directory_symlink("frames", folder->run() + "/frames_again");
  Write(*folder, "found_masks/b.png", "mask");
  Write(*folder, "photos/b.png", "photo");
  Write(*folder, "wide_views_2/b.png", "view");
  EXPECT_TRUE(*folder->Store());
  EXPECT_THAT(folder->kept(), ElementsAre(Pair("frames/a.png", KeptFile{Blob(3, "frame"), 5})));
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "frame")));
  const std::string link = folder->run() + "/views/a.png", staging = Scratch() + "/staged";
  EXPECT_EQ(Reason(StoreFile(blobs_.get(), "a1", 3, link, staging, {}).status()), "STORE_FAILED");
  EXPECT_FALSE(fs::exists(fs::symlink_status(staging)));
  EXPECT_TRUE(
      fs::is_regular_file(fs::symlink_status(dir_.path() + "/blobs/jobs/a1/" + Blob(3, "frame"))));
}

TEST_F(WorkFolderTest, ReplacedFilesGoOnceTheirSuccessorsAreNamed) {
  const auto first = Take(3);
  Write(*first, "checkpoint", "c1");
  Write(*first, "cameras/images.bin", "i");
  ASSERT_TRUE(*first->Store());
  const auto second = Take(9, first->kept());
  ASSERT_TRUE(second->Fetch().ok());
  Write(*second, "checkpoint", "c2");
  Write(*second, "cameras/images.bin", "i");  // written again, the same bytes
  ASSERT_TRUE(*second->Store());
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "c1"), Blob(3, "i"), Blob(9, "c2")));
  second->RemoveReplaced();
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "i"), Blob(9, "c2")));
  fs::remove(second->run() + "/checkpoint");  // the job is done
  ASSERT_TRUE(*second->Store());
  second->RemoveReplaced();
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "i")));
}

TEST_F(WorkFolderTest, FileThatComesBackIsNotRemoved) {
  const auto folder = Take(3);
  for (const char* bytes : {"one", "two", "one"}) {
    Write(*folder, "checkpoint", bytes);
    ASSERT_TRUE(*folder->Store());
  }
  folder->RemoveReplaced();
  EXPECT_THAT(Blobs(), ElementsAre(Blob(3, "one")));
}

TEST_F(WorkFolderTest, SceneIsStoredWhenItsTurnComes) {
  const auto folder = Take(3);
  Write(*folder, kSceneFile, "s");
  EXPECT_FALSE(*folder->Store({kSceneFile}));
  EXPECT_TRUE(*folder->Store());
  EXPECT_FALSE(*folder->Store({kSceneFile}));
  EXPECT_EQ(folder->kept().size(), 1u) << "still there";
}

TEST_F(WorkFolderTest, StoreInTheSameFileSystemTakesNoMoreRoom) {
  const auto folder = Take(3);
  Write(*folder, "checkpoint", "c");
  ASSERT_TRUE(*folder->Store());
  struct stat ours, stored;
  ASSERT_EQ(stat((folder->run() + "/checkpoint").c_str(), &ours), 0);
  ASSERT_EQ(stat((dir_.path() + "/blobs/jobs/a1/" + Blob(3, "c")).c_str(), &stored), 0);
  EXPECT_EQ(ours.st_ino, stored.st_ino);
}

TEST_F(WorkFolderTest, KeptFileThatIsGoneIsLeftOut) {
  const auto folder = Take(9, {{"checkpoint", {Blob(3, "lost"), 4}}});
  EXPECT_TRUE(folder->Fetch().ok());
  EXPECT_FALSE(fs::exists(folder->run() + "/checkpoint"));
  EXPECT_TRUE(*folder->Store());
  EXPECT_THAT(folder->kept(), IsEmpty());
}

TEST_F(WorkFolderTest, FileThatTheBlobStoreDoesNotTakeIsAnErrorNotAFileThatIsGone) {
  FaultyBlobStore blobs(blobs_.get());
  blobs.on_write = [](std::string_view) {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "", "404 to a write");
  };
  const auto folder = Take(3, {}, &blobs);
  Write(*folder, kSceneFile, "scene");
  EXPECT_EQ(Reason(folder->Store().status()), "BLOB_NOT_FOUND");
  EXPECT_THAT(folder->kept(), IsEmpty());
}

TEST_F(WorkFolderTest, WhatIsStoredBeforeAnErrorIsTheNextCallsChange) {
  FaultyBlobStore blobs(blobs_.get());
  const auto folder = Take(3, {}, &blobs);
  for (const char* name : {"a", "b"}) Write(*folder, name, name);
  int writes = 0;
  blobs.on_write = [&](std::string_view) {
    return ++writes == 2 ? absl::UnavailableError("away") : absl::OkStatus();
  };
  EXPECT_FALSE(folder->Store().ok());
  ASSERT_EQ(folder->kept().size(), 1u);
  fs::remove(folder->run() + (folder->kept().contains("a") ? "/b" : "/a"));
  EXPECT_TRUE(*folder->Store());
  EXPECT_FALSE(*folder->Store());
}

TEST_F(WorkFolderTest, FolderThatCannotBeListedCostsNoKeptFile) {
  const auto folder = Take(3);
  Write(*folder, "checkpoint", "c");
  ASSERT_TRUE(*folder->Store());
  rlimit limit = {};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  rlimit none = limit;
  none.rlim_cur = 0;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const auto stored = folder->Store();
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_EQ(Reason(stored.status()), "STORE_FAILED");
  EXPECT_EQ(folder->kept().size(), 1u);
  EXPECT_FALSE(*folder->Store()) << "nothing has changed";
}

TEST_F(WorkFolderTest, ScratchGoesWithItsOwnerAndIsTakenForAbandonedOnlyThen) {
  auto first = Take(3);
  const std::string path = first->run();
  fs::create_directories(Scratch() + "/of-a-killed-worker/run");
  const auto second = Take(4);
  EXPECT_TRUE(fs::exists(path));
  EXPECT_FALSE(fs::exists(Scratch() + "/of-a-killed-worker"));
  first.reset();
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(fs::exists(second->run()));
}

}  // namespace
}  // namespace litags
