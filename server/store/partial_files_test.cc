#include "server/store/partial_files.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kBytes = 10;  // of the file

class PartialFilesTest : public ::testing::Test {
 protected:
  std::unique_ptr<PartialFile> Open(int64_t offset) {
    auto file = files_.Open("job", "aa", kBytes, offset);
    EXPECT_TRUE(file.ok()) << file.status();
    return file.ok() ? *std::move(file) : nullptr;
  }
  int64_t Size() { return *files_.Size("job", "aa", kBytes); }
  int64_t FilesOnDisk() {
    return std::distance(fs::directory_iterator(dir_.path() + "/job"), fs::directory_iterator());
  }

  static std::string Content(const std::string& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TempDir dir_;
  PartialFiles files_{dir_.path()};
};

TEST_F(PartialFilesTest, WhatHasComeStaysWhereDescriptorsHaveRunOut) {
  ASSERT_TRUE(Open(0)->Append("0123").ok());
  rlimit limit = {};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit none = {0, limit.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const absl::Status refused = files_.Open("job", "aa", kBytes, 4).status();
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_FALSE(refused.ok());
  EXPECT_EQ(Size(), 4);
}

TEST_F(PartialFilesTest, NoStreamWritesToAFileThatIsSetAside) {
  const auto whole = Open(0);
  ASSERT_TRUE(whole->Append("0123456789").ok());
  ASSERT_TRUE(whole->SetAside().ok());
  EXPECT_EQ(files_.UsageOf("job").bytes, kBytes);  // counted once
  EXPECT_EQ(Reason(files_.Open("job", "aa", kBytes, kBytes).status()), "OFFSET_INVALID");
  const auto other = Open(0);
  ASSERT_TRUE(other->Append("xxxx").ok());
  EXPECT_EQ(Content(whole->path()), "0123456789");
  EXPECT_EQ(Content(other->path()), "xxxx");
}

TEST_F(PartialFilesTest, FileThatWasSetAsideComesBackUnlessItIsTakenOver) {
  auto whole = Open(0);
  ASSERT_TRUE(whole->Append("0123456789").ok());
  ASSERT_TRUE(whole->SetAside().ok());
  whole.reset();
  EXPECT_EQ(Size(), kBytes);

  whole = Open(kBytes);
  ASSERT_TRUE(whole->SetAside().ok());
  auto other = Open(0);
  ASSERT_TRUE(other->Append("01").ok());
  whole.reset();
  EXPECT_EQ(Size(), 2);
  EXPECT_EQ(FilesOnDisk(), 1);

  whole = Open(2);
  EXPECT_EQ(Reason(other->SetAside()), "UPLOAD_TAKEN_OVER");
  ASSERT_TRUE(whole->SetAside().ok());
  whole->Discard();
  whole.reset();
  EXPECT_EQ(FilesOnDisk(), 0);
}

TEST_F(PartialFilesTest, FileThatWasSetAsideInACrashIsThereAfterIt) {
  fs::create_directory(dir_.path() + "/job");
  fs::create_directory(dir_.path() + "/lost+found");
  std::ofstream(dir_.path() + "/job/aa.7") << "0123456789";
  std::ofstream(dir_.path() + "/job/aa") << "01";  // of a stream that took it over
  std::ofstream(dir_.path() + "/lost+found/no.7") << "a stranger's";
  PartialFiles after(dir_.path());
  EXPECT_EQ(*after.Size("job", "aa", kBytes), kBytes);
  EXPECT_EQ(after.UsageOf("job").files, 1);
  EXPECT_EQ(after.UsageOf("job").bytes, kBytes);
  const auto file = after.Open("job", "aa", kBytes, kBytes);
  ASSERT_TRUE(file.ok()) << file.status();
  EXPECT_EQ(*(*file)->HexDigest(), Sha256::Hex("0123456789"));
  EXPECT_TRUE(fs::exists(dir_.path() + "/lost+found/no.7"));
}

}  // namespace
}  // namespace litags
