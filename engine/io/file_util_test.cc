#include "engine/io/file_util.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/sync_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/bundler_io.h"
#include "engine/io/cameras_io.h"
#include "engine/io/link_file.h"
#include "engine/io/readdir_test_util.h"
#include "engine/io/work_folder.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

int CountFiles(const std::string& dir) {
  int n = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(dir)) ++n;
  return n;
}

TEST(WriteFileAtomically, ReplacesTheFileAndLeavesNothingElse) {
  TempDir dir;
  const std::string path = dir / "a";
  ASSERT_TRUE(WriteFileAtomically(path, "old").ok());
  const std::string bytes("n\0w", 3);
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(ReadFile(path, "f", 100).value(), bytes);
  EXPECT_EQ(CountFiles(dir.path()), 1);
}

TEST(WriteFileAtomically, KeepsTheOldFileWhenItFails) {
  TempDir dir;
  // A folder cannot be replaced by a file.
  std::filesystem::create_directory(dir / "a");
  std::ofstream(dir / "a/inside") << "x";
  const absl::Status status = WriteFileAtomically(dir / "a", "new");
  EXPECT_FALSE(status.ok());
  EXPECT_TRUE(std::filesystem::exists(dir / "a/inside"));
  EXPECT_EQ(CountFiles(dir.path()), 1);
}

TEST(WriteFileAtomically, PutsContentOnDiskAndThenItsName) {
  TempDir dir;
  const std::string folder = std::filesystem::canonical(dir.path());
  Synced().Take();
  ASSERT_TRUE(WriteFileAtomically(folder + "/a", "x").ok());
  EXPECT_THAT(Synced().Take(), testing::ElementsAre(testing::StartsWith(folder + "/"), folder));
}

TEST(WriteFileAtomically, WritesToWhatIsNoFile) {
  TempDir dir;
  const std::string path = dir / "a";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const int reader = open(path.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  ASSERT_TRUE(WriteFileAtomically(path, "whole").ok());
  EXPECT_TRUE(std::filesystem::is_fifo(path));
  char bytes[16];
  EXPECT_EQ(read(reader, bytes, sizeof(bytes)), 5);
  close(reader);
}

TEST(WriteFileAtomically, NamesAMissingFolder) {
  TempDir dir;
  const absl::Status status = WriteFileAtomically(dir / "none/a", "x");
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("none/a"));
}

// A file size limit cuts the write short, as a full disk does.
TEST(WriteFileAtomically, CleansUpWhenThereIsNoRoom) {
  TempDir dir;
  ASSERT_TRUE(WriteFileAtomically(dir / "a", "old").ok());
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {4096, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status status = WriteFileAtomically(dir / "a", std::string(100000, 'x'));
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);

  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(status), "DISK_FULL");
  EXPECT_EQ(ReadFile(dir / "a", "f", 100).value(), "old");
  EXPECT_EQ(CountFiles(dir.path()), 1);
}

TEST(WriteFileAtomically, AReaderSeesOnlyWholeFiles) {
  TempDir dir;
  const std::string path = dir / "a";
  const std::string a(100000, 'a'), b(50000, 'b');
  ASSERT_TRUE(WriteFileAtomically(path, a).ok());
  std::thread writer([&] {
    for (int i = 0; i < 50; ++i) {
      ASSERT_TRUE(WriteFileAtomically(path, i % 2 == 0 ? b : a).ok());
    }
  });
  for (int i = 0; i < 200; ++i) {
    const absl::StatusOr<std::string> bytes = ReadFile(path, "f", 1 << 20);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    ASSERT_TRUE(*bytes == a || *bytes == b) << bytes->size();
  }
  writer.join();
}

TEST(RemoveStaleTempFiles, RemovesOnlyThose) {
  TempDir dir;
  std::ofstream(dir / ".123-0.litags-tmp") << "half";
  std::ofstream(dir / "scene.litags") << "whole";
  EXPECT_EQ(RemoveStaleTempFiles(dir.path()), 1);
  EXPECT_TRUE(std::filesystem::exists(dir / "scene.litags"));
  EXPECT_EQ(CountFiles(dir.path()), 1);
}

TEST(ReadFile, RefusesMissingTooLargeAndSpecialFiles) {
  TempDir dir;
  EXPECT_EQ(ReadFile(dir / "none", "f", 100).status().code(), absl::StatusCode::kNotFound);
  ASSERT_TRUE(WriteFileAtomically(dir / "a", "12345").ok());
  EXPECT_TRUE(ReadFile(dir / "a", "f", 5).ok());
  const absl::Status large = ReadFile(dir / "a", "images[a]", 4).status();
  EXPECT_EQ(Reason(large), "FILE_TOO_LARGE");
  EXPECT_THAT(std::string(large.message()), testing::StartsWith("images[a]: "));
  EXPECT_EQ(Reason(ReadFile(dir.path(), "f", 100).status()), "NOT_A_FILE");
}

TEST(ReadFile, SaysThatAFileMayNotBeRead) {
  if (geteuid() == 0) GTEST_SKIP() << "root may read every file";
  TempDir dir;
  ASSERT_TRUE(WriteFileAtomically(dir / "a", "x").ok());
  std::filesystem::permissions(dir / "a", std::filesystem::perms::none);
  EXPECT_EQ(Reason(ReadFile(dir / "a", "f", 100).status()), "NO_PERMISSION");
}

TEST(ValidateFileName, AcceptsOrdinaryNames) {
  for (const char* name : {"0001.jpg", "IMG 1 (2).JPEG", "a..b.png", "\xC3\xA9t\xC3\xA9.jpg",
                           "\xF0\x9F\x93\xB7.png", "-rf", "\xD7\x90\xE2\x80\x8F.png"}) {
    EXPECT_TRUE(ValidateFileName(name, "f").ok()) << name;
  }
  EXPECT_TRUE(ValidateFileName(std::string(255, 'a'), "f").ok());
}

TEST(ValidateFileName, RefusesTricks) {
  const std::vector<std::string> names = {"",
                                          ".",
                                          "..",
                                          ".hidden",
                                          "../a.jpg",
                                          "a/b.jpg",
                                          "a\\b.jpg",
                                          "/etc/passwd",
                                          std::string("a\0b", 3),
                                          "a\nb",
                                          "a\x7F",
                                          "a\xC2\x85.jpg",         // control character NEL
                                          "a\xE2\x80\xA8.jpg",     // line separator
                                          "a\xE2\x80\xAEgpj.png",  // right-to-left override
                                          "a\xE2\x81\xA6.jpg",     // isolate
                                          "a\xFF.jpg",             // not UTF-8
                                          "a\xC0\xAF.jpg",         // overlong '/'
                                          "a\xED\xA0\x80.jpg",     // surrogate
                                          "a\xE2\x82",             // cut sequence
                                          "a\xF4\x90\x80\x80",     // past U+10FFFF
                                          std::string(256, 'a')};
  for (const std::string& name : names) {
    EXPECT_EQ(Reason(ValidateFileName(name, "f")), "BAD_FILE_NAME") << name;
  }
}

TEST(PathParts, AreTheLastPart) {
  EXPECT_EQ(BaseName("low/0001.JPG"), "0001.JPG");
  EXPECT_EQ(BaseName("low\\0001.JPG"), "0001.JPG");
  EXPECT_EQ(BaseName("0001.JPG"), "0001.JPG");
  EXPECT_EQ(Stem("low.d/0001.JPG"), "0001");
  EXPECT_EQ(Stem("0001"), "0001");
  EXPECT_EQ(Stem("a.b.png"), "a.b");
}

TEST(NameIndex, FindsByNameElseByStem) {
  const std::vector<std::string> names = {"a.jpg", "a.png", "b.png"};
  const NameIndex index(names);
  EXPECT_EQ(index.Find("a.png"), 1u);
  EXPECT_EQ(index.Find("a.JPG"), 0u);
  EXPECT_EQ(index.Find("b"), 2u);
  EXPECT_EQ(index.Find("c.png"), std::nullopt);
}

TEST(LinkFile, IsACopyWhereThereAreNoLinks) {
  TempDir dir;
  std::ofstream(dir / "a") << "photo";
  EXPECT_FALSE(LinkFile(dir / "a", dir / "link"));
  EXPECT_TRUE(std::filesystem::is_symlink(dir / "link"));
  EXPECT_FALSE(LinkFile(dir / "a", dir / "copy", /*can_link=*/false));
  EXPECT_FALSE(std::filesystem::is_symlink(dir / "copy"));
  EXPECT_EQ(ReadFile(dir / "copy", "f", 100).value(), "photo");
  EXPECT_EQ(LinkFile(dir / "a", dir / "none/copy", /*can_link=*/false),
            std::errc::no_such_file_or_directory);
}

TEST(NameIndex, FindsNamesAsOtherProgramsWriteThem) {
  const std::vector<std::string> names = {"clip.2024.frame_1.JPG", "clip.2024.frame_2.JPG",
                                          "Su\u0308d 1.jpg", "\u00DF (1).jpg"};
  const NameIndex index(names);
  EXPECT_EQ(index.Find("clip.2024.frame_2"), 1u);  // what follows the last dot is no ending
  EXPECT_EQ(index.Find("clip.2024.frame_3"), std::nullopt);
  EXPECT_EQ(index.Find("S\u00FCd 1.jpg"), 2u);
  EXPECT_EQ(index.Find("%C3%9F%20(1).png"), 3u);
}

TEST(NameIndex, FindsOnlyNamesWhoseKeyIsAmongThoseOfThePath) {
  for (const std::string name : {"a.jpg", "Su\u0308d 1.jpg", "left_a.png", "a.jpg.png", "a"}) {
    const NameIndex index({&name, 1});
    for (const std::string path : {"a", "A.PNG", "left/a.jpg", "x/left/a", "S\u00FCd%201.JPG",
                                   "a.jpg", "a.jpg.png", "b.jpg", "right/a_.jpg"}) {
      const std::vector<std::string> keys = KeysOf(path);
      EXPECT_EQ(index.Find(path).has_value(),
                std::find(keys.begin(), keys.end(), StemKey(name)) != keys.end())
          << name << " " << path;
    }
  }
}

TEST(MakeEmptyFolder, LeavesNothingButTheMarkerAndSaysWhatItCannotMake) {
  TempDir dir;
  const std::string folder = dir / "run/sfm";
  ASSERT_TRUE(MakeEmptyFolder(folder).ok());
  ASSERT_TRUE(WriteFileAtomically(folder + "/left", "x").ok());
  ASSERT_TRUE(WriteFileAtomically(folder + "/.1-0.litags-tmp", "half").ok());
  ASSERT_TRUE(MakeFolder(folder).ok());
  ASSERT_TRUE(MakeOwnFolder(folder).ok());
  EXPECT_EQ(CountFiles(folder), 3);
  ASSERT_TRUE(MakeEmptyFolder(folder).ok());
  EXPECT_EQ(CountFiles(folder), 1);
  EXPECT_TRUE(std::filesystem::exists(folder + "/" + kOwnFolderMarker));

  ASSERT_TRUE(WriteFileAtomically(dir / "file", "x").ok());
  for (const absl::Status& refused : {MakeFolder(dir / "file/sfm"), MakeOwnFolder(dir / "file/sfm"),
                                      MakeEmptyFolder(dir / "file/sfm")}) {
    EXPECT_EQ(Reason(refused), "FOLDER_NOT_WRITABLE");
    EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("file/sfm"));
  }
}

TEST(OwnFolder, FilesOfOthersAreRefusedAndStay) {
  TempDir dir;
  std::filesystem::create_directory(dir / "mine");
  ASSERT_TRUE(WriteFileAtomically(dir / "mine/original.NEF", "bytes").ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "file", "bytes").ok());
  std::filesystem::create_directory_symlink(dir / "mine", dir / "link");
  std::filesystem::create_directory_symlink(dir / "none", dir / "dangling");
  for (const char* name : {"mine", "file", "link", "dangling"}) {
    const std::string folder = dir / name;
    for (const absl::Status& refused :
         {CheckOwnFolder(folder), MakeOwnFolder(folder), MakeEmptyFolder(folder)}) {
      EXPECT_EQ(Reason(refused), "FOLDER_NOT_OURS") << name;
      EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr(folder));
    }
  }
  EXPECT_EQ(CountFiles(dir / "mine"), 1);
  EXPECT_EQ(ReadFile(dir / "mine/original.NEF", "", 9).value(), "bytes");
  EXPECT_EQ(ReadFile(dir / "file", "", 9).value(), "bytes");
}

TEST(OwnFolder, EmptyOnesAndMarkedOnesAreTaken) {
  TempDir dir;
  const std::string folder = dir / "sfm";
  EXPECT_TRUE(CheckOwnFolder(folder).ok());
  std::filesystem::create_directory(folder);
  EXPECT_TRUE(CheckOwnFolder(folder).ok());
  // Of a run that was killed while it wrote the marker.
  ASSERT_TRUE(WriteFileAtomically(folder + "/.1-0.litags-tmp", "half").ok());
  EXPECT_TRUE(CheckOwnFolder(folder).ok());
  ASSERT_TRUE(MakeOwnFolder(folder).ok());
  ASSERT_TRUE(WriteFileAtomically(folder + "/database.db", "x").ok());
  EXPECT_TRUE(CheckOwnFolder(folder).ok());
}

// The folder of another run, say: it may still be wanted there.
TEST(MakeEmptyFolder, WhatALinkPointsToStays) {
  TempDir dir;
  ASSERT_TRUE(MakeOwnFolder(dir / "other").ok());
  ASSERT_TRUE(WriteFileAtomically(dir / "other/frame.png", "x").ok());
  std::filesystem::create_directory_symlink(dir / "other", dir / "frames");
  ASSERT_TRUE(MakeEmptyFolder(dir / "frames").ok());
  EXPECT_FALSE(std::filesystem::is_symlink(dir / "frames"));
  EXPECT_TRUE(std::filesystem::exists(dir / "other/frame.png"));
}

TEST(ListNames, FoldersAndFilesAreSorted) {
  TempDir dir;
  std::filesystem::create_directory(dir / "b");
  for (const char* name : {"c.lst", "a"}) std::ofstream(dir / name) << "x";
  const auto names = ListNames(dir.path(), "f", [](const std::filesystem::directory_entry& entry) {
    return entry.path().filename() != "a";
  });
  EXPECT_THAT(names.value(), testing::ElementsAre("b", "c.lst"));
  const auto all = [](const std::filesystem::directory_entry&) { return true; };
  EXPECT_EQ(Reason(ListNames(dir / "none", "f", all).status()), "NO_SUCH_FOLDER");
}

TEST(ListNames, AFolderThatCannotBeReadToItsEndIsAnErrorOrEmptyAndThrowsNothing) {
  TempDir dir;
  for (const char* name : {"a.lst", "bundle.out"}) std::ofstream(dir / name) << "x";
  std::filesystem::create_directories(dir / "sparse/0");
  std::ofstream(dir / "sparse/0/cameras.txt") << "x";
  EXPECT_EQ(BundlerListOf(dir / "bundle.out"), dir / "a.lst");
  EXPECT_EQ(ResolveCameras(dir / "sparse"), dir / "sparse/0");

  const auto all = [](const std::string&) { return true; };
  readdirs_before_failure = 3;
  EXPECT_EQ(Reason(ListFiles(dir.path(), "f", all).status()), "IO_ERROR");
  readdirs_before_failure = 3;
  EXPECT_EQ(BundlerListOf(dir / "bundle.out"), "");
  readdirs_before_failure = 2;
  EXPECT_EQ(ResolveCameras(dir / "sparse"), dir / "sparse");
  EXPECT_EQ(readdirs_before_failure, -1) << "the C++ library reads folders by another function";
}

}  // namespace
}  // namespace litags
