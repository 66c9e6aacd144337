#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"

namespace litags {
namespace {

TEST(Digest, KnownVectorOfSha256) {
  // FIPS 180-2, appendix B.1.
  EXPECT_EQ(Sha256::Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  Sha256 in_parts;
  in_parts.Update("a");
  in_parts.Update("bc");
  EXPECT_EQ(in_parts.HexDigest(), Sha256::Hex("abc"));
  EXPECT_EQ(RandomHex(8).size(), 16u);
  EXPECT_NE(RandomHex(8), RandomHex(8));
}

TEST(DataDirectory, IsMadePrivateAndItsTemporaryFilesAreRemoved) {
  TempDir dir;
  const auto data = DataDir::Open(dir.path() + "/a/b");
  ASSERT_TRUE(data.ok()) << data.status();
  struct stat info {};
  ASSERT_EQ(stat(data->root.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  std::ofstream(data->tmp() + "/left") << "x";
  const std::string of_a_worker = data->blobs() + "/tmp/put-1";  // which may be writing it
  std::filesystem::create_directories(data->blobs() + "/tmp");
  std::ofstream(of_a_worker) << "x";
  // Somebody may be writing it; a link to an old blob is new all the same.
  const auto days_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(48);
  std::filesystem::last_write_time(data->tmp() + "/left", days_ago);
  data->EmptyTmp(60);
  EXPECT_FALSE(std::filesystem::is_empty(data->tmp()));
  data->EmptyTmp(0);
  EXPECT_TRUE(std::filesystem::is_empty(data->tmp()));
  EXPECT_TRUE(std::filesystem::exists(of_a_worker));
  std::ofstream(data->tmp() + "/left") << "x";
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  data->EmptyTmp(0.01);
  EXPECT_TRUE(std::filesystem::is_empty(data->tmp()));
  EXPECT_FALSE(std::filesystem::exists(of_a_worker));
}

TEST(DataDirectory, OneThatIsThereKeepsItsPermissions) {
  TempDir dir;
  const std::string root = dir.path() + "/mine";
  ASSERT_EQ(mkdir(root.c_str(), 0700), 0);
  for (const mode_t mode : {0755u, 0770u, 0701u}) {
    ASSERT_EQ(chmod(root.c_str(), mode), 0);
    const auto data = DataDir::Open(root + "/");
    ASSERT_TRUE(data.ok()) << data.status();
    EXPECT_TRUE(data->OthersMayEnter());
    struct stat info {};
    ASSERT_EQ(stat(root.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, mode);
    for (const std::string& made : {data->tmp(), data->uploads(), data->scratch()}) {
      ASSERT_EQ(stat(made.c_str(), &info), 0);
      EXPECT_EQ(info.st_mode & 0777, 0700u) << made;
    }
  }
  ASSERT_EQ(chmod(root.c_str(), 0700), 0);
  EXPECT_FALSE(DataDir::Open(root)->OthersMayEnter());
}

TEST(DataDirectory, FileInItsPlaceIsAClearError) {
  TempDir dir;
  std::ofstream(dir.path() + "/file") << "x";
  const absl::Status status = DataDir::Open(dir.path() + "/file").status();
  EXPECT_EQ(Reason(status), "DATA_DIR_UNUSABLE");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("Not a directory"));
}

TEST(DataDirectory, NoneIsAskedFor) {
  const absl::Status status = DataDir::Open("").status();
  EXPECT_EQ(Reason(status), "DATA_DIR_UNUSABLE");
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("with --data"));
}

TEST(DataDirectory, OneThatCannotBeLockedIsNotInUse) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir.path() + "/data");
  ASSERT_EQ(mkdir((data.root + "/server.lock").c_str(), 0700), 0);  // what nobody can open to write
  EXPECT_EQ(Reason(DataDirLock::Take(data).status()), "DATA_DIR_UNUSABLE");
}

TEST(DataDirectory, ALockThatIsLetGoInAMomentIsWaitedFor) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir.path());
  auto held = *DataDirLock::Take(data);
  EXPECT_EQ(Reason(DataDirLock::Take(data).status()), "DATA_DIR_IN_USE");
  std::thread ending([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    held.reset();
  });
  EXPECT_TRUE(DataDirLock::Take(data).ok());
  ending.join();
}

}  // namespace
}  // namespace litags
