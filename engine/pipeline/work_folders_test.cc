#include "engine/pipeline/work_folders.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/capture_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST(WorkFolders, AnInputInAFolderThatARunWritesIntoIsRefused) {
  const TempDir dir;
  const std::string work = dir.path() + "/capture";
  ASSERT_TRUE(MakeOwnFolder(work + "/photos").ok());
  fs::create_directories(work + "/photos/masks");
  fs::create_directories(dir.path() + "/elsewhere");
  fs::create_directory_symlink(work + "/photos", dir.path() + "/link");
  const auto reason = [&](const std::string& images) {
    ReconstructInput input;
    input.work_dir = work;
    input.images_dir = images;
    return Reason(CheckWorkDir(input));
  };
  EXPECT_EQ(reason(work + "/photos"), "INPUT_IN_WORK_DIR");
  EXPECT_EQ(reason(work + "/photos/"), "INPUT_IN_WORK_DIR");
  EXPECT_EQ(reason(work + "/../capture/photos/masks"), "INPUT_IN_WORK_DIR");
  EXPECT_EQ(reason(dir.path() + "/link"), "INPUT_IN_WORK_DIR");
  EXPECT_EQ(reason(dir.path() + "/elsewhere"), "");
  EXPECT_EQ(reason(work), "");
  EXPECT_EQ(reason(work + "/photos of a room"), "");
}

// As one whose parent may not be read: its path became empty, and every input lay in it.
TEST(WorkFolders, AnOutputFolderThatCannotBeResolvedHoldsNoInput) {
  const TempDir dir;
  fs::create_symlink("loop", dir.path() + "/loop");
  ReconstructInput input;
  input.work_dir = dir.path() + "/loop/out";
  input.images_dir = dir.path();
  EXPECT_EQ(Reason(CheckWorkDir(input)), "");
  input.images_dir = input.work_dir + "/photos";
  EXPECT_EQ(Reason(CheckWorkDir(input)), "INPUT_IN_WORK_DIR");
}

TEST(WorkFolders, TheFramesOfAnEarlierStepAreAnInput) {
  ReconstructInput input;
  input.work_dir = "/tmp/capture";
  input.images_dir = "/tmp/capture/frames";
  EXPECT_TRUE(CheckWorkDir(input).ok());
  input.images_dir.clear();
  input.video_path = "/tmp/capture/frames/night.mp4";
  EXPECT_EQ(Reason(CheckWorkDir(input)), "INPUT_IN_WORK_DIR");
}

// Files of the root folder were removed and written.
TEST(WorkFolders, AnEmptyNameIsNone) {
  const RoomCapture capture(6);
  ReconstructInput input = capture.Input("work");
  input.work_dir.clear();
  const absl::Status status = Train(input, capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "WORK_DIR_MISSING");
  EXPECT_EQ(GetErrorDetail(status)->field, "work_dir");
}

// One photo that is left out made a run clear work_dir/photos, and fill it with links.
TEST(WorkFolders, ARunLeavesThePhotosBesideItsOutputAlone) {
  const RoomCapture capture(6);
  fs::rename(capture.Path("images"), capture.Path("photos"));
  fs::copy_file(capture.Path("photos/v003.png"), capture.Path("photos/v003 (1).png"));
  ReconstructInput input = capture.Input("work");
  input.images_dir = capture.Path("photos");
  input.work_dir = fs::path(input.images_dir).parent_path();
  const absl::Status status = Train(input, capture.Options(10)).status();
  EXPECT_EQ(Reason(status), "INPUT_IN_WORK_DIR");
  EXPECT_THAT(std::string(status.message()), HasSubstr("/photos"));
  EXPECT_TRUE(fs::is_regular_file(capture.Path("photos/v003 (1).png")));
}

// They were deleted, or written over.
TEST(WorkFolders, FilesOfTheUsersInAFolderThatARunWritesIntoAreRefusedAndStay) {
  const RoomCapture capture(6);
  const ReconstructInput input = capture.Input("work");
  for (const char* name : {"photos", "found_masks", "sfm", "wide_views", "wide_views_2", "cameras",
                           "solved_fisheyes"}) {
    const fs::path folder = fs::path(input.work_dir) / name;
    fs::create_directories(folder);
    ASSERT_TRUE(WriteFileAtomically(folder / "mine.txt", "mine").ok());
    const absl::Status status = Train(input, capture.Options(10)).status();
    EXPECT_EQ(Reason(status), "FOLDER_NOT_OURS") << name;
    EXPECT_THAT(std::string(status.message()), HasSubstr(folder.string()));
    EXPECT_EQ(ReadFile(folder / "mine.txt", "", 9).value(), "mine");
    fs::remove_all(folder);
    EXPECT_TRUE(fs::is_empty(input.work_dir)) << name;
  }
}

TEST(WorkFolders, ARunGoesOnInTheFoldersOfTheRunBefore) {
  const RoomCapture capture(6);
  fs::copy_file(capture.Path("images/v003.png"), capture.Path("images/v003 (1).png"));
  const ReconstructInput input = capture.Input("work");
  ASSERT_TRUE(Train(input, capture.Options(10)).ok());
  ASSERT_TRUE(fs::exists(input.work_dir + "/photos") && fs::exists(input.work_dir + "/cameras"));
  fs::remove(capture.Path("images/v003 (1).png"));
  fs::copy_file(capture.Path("images/v004.png"), capture.Path("images/v004 (1).png"));
  const auto second = Train(input, capture.Options(20));
  EXPECT_TRUE(second.ok()) << second.status();
}

TEST(WorkFolders, WhatAKilledRunWasWritingIsDeleted) {
  const RoomCapture capture(6);
  ReconstructInput input = capture.Input("work");
  std::vector<std::string> halves;
  for (const char* folder : {".", "cameras", "found_masks", "solved_fisheyes"}) {
    fs::create_directory(fs::path(input.work_dir) / folder);
    halves.push_back(fs::path(input.work_dir) / folder / ".1-0.litags-tmp");
    ASSERT_TRUE(WriteFileAtomically(halves.back(), "half").ok());
  }
  input.memory_bytes = 1;  // ends it early
  EXPECT_EQ(Reason(Train(input, capture.Options(10)).status()), "MEMORY_EXCEEDED");
  for (const std::string& half : halves) EXPECT_FALSE(fs::exists(half)) << half;
}

}  // namespace
}  // namespace litags
