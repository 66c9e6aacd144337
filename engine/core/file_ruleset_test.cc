#include "engine/core/file_ruleset.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"

namespace litags {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;

namespace fs = std::filesystem;

// A folder that a program may read, one that it may change, and one of somebody else.
class FileRulesetTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!FileRuleset::Supported()) GTEST_SKIP() << "this kernel has no Landlock";
    for (const std::string& folder : {read_, change_, other_}) {
      fs::create_directory(folder);
      std::ofstream(folder + "/file") << "words of " << fs::path(folder).filename().string();
    }
  }

  // What `body` returned in a process with these rules.
  int Under(const std::function<int()>& body) const {
    const FileRuleset ruleset({{read_}, {change_}});
    const pid_t child = fork();
    if (child == 0) _exit(ruleset.Apply() == 0 ? body() : 255);
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  int ErrorOfOpen(const std::string& path, int flags) const {
    return Under([&] { return open(path.c_str(), flags | O_CLOEXEC, 0600) < 0 ? errno : 0; });
  }

  std::string Output(const std::string& script) const {
    SubprocessOptions options;
    options.args = {"/bin/sh", "-c", script};
    options.confined = true;
    options.files = {{read_}, {change_}};
    const auto result = RunSubprocess(options, CancelToken());
    return result.ok() ? result->tail : result.status().ToString();
  }

  const TempDir dir_;
  const std::string read_ = dir_ / "read", change_ = dir_ / "change", other_ = dir_ / "other";
};

TEST_F(FileRulesetTest, OnlyWhatIsNamedIsOpened) {
  EXPECT_EQ(ErrorOfOpen(read_ + "/file", O_RDONLY), 0);
  EXPECT_EQ(ErrorOfOpen(read_ + "/file", O_WRONLY), EACCES);
  EXPECT_EQ(ErrorOfOpen(read_ + "/new", O_WRONLY | O_CREAT), EACCES);
  EXPECT_EQ(ErrorOfOpen(change_ + "/file", O_RDWR | O_TRUNC), 0);
  EXPECT_EQ(ErrorOfOpen(change_ + "/new", O_WRONLY | O_CREAT), 0);
  EXPECT_EQ(ErrorOfOpen(other_ + "/file", O_RDONLY), EACCES);
  EXPECT_EQ(ErrorOfOpen(other_, O_RDONLY | O_DIRECTORY), EACCES);
  EXPECT_EQ(ErrorOfOpen(other_ + "/new", O_WRONLY | O_CREAT), EACCES);
}

// Who reads the folder afterwards would follow a link to what its maker could not read.
TEST_F(FileRulesetTest, NoLinksLeadOut) {
  const std::string link = change_ + "/link", file = other_ + "/file";
  EXPECT_EQ(Under([&] { return symlink(file.c_str(), link.c_str()) != 0 ? errno : 0; }), EACCES);
  EXPECT_NE(Under([&] { return ::link(file.c_str(), link.c_str()) != 0 ? errno : 0; }), 0);
  EXPECT_NE(Under([&] { return rename(file.c_str(), link.c_str()) != 0 ? errno : 0; }), 0);
  EXPECT_EQ(Under([&] { return mkfifo(link.c_str(), 0600) != 0 ? errno : 0; }), EACCES);
}

TEST_F(FileRulesetTest, AFolderThatMayChangeHasFoldersMadeMovedAndRemoved) {
  EXPECT_EQ(Under([&] {
              const std::string a = change_ + "/a", b = change_ + "/b";
              if (mkdir(a.c_str(), 0700) != 0 || mkdir(b.c_str(), 0700) != 0) return 1;
              std::ofstream(a + "/1") << "x";
              if (rename((a + "/1").c_str(), (a + "/2").c_str()) != 0) return 2;
              if (unlink((a + "/2").c_str()) != 0) return 3;
              return rmdir(a.c_str()) == 0 ? 0 : 4;
            }),
            0);
}

TEST_F(FileRulesetTest, FilesThatAreOpenStayOpen) {
  const UniqueFd file(open((other_ + "/file").c_str(), O_RDONLY | O_CLOEXEC));
  EXPECT_EQ(Under([&] {
              char first = 0;
              return read(file.get(), &first, 1) == 1 && first == 'w' ? 0 : 1;
            }),
            0);
}

TEST_F(FileRulesetTest, AConfinedProgramAndWhatItStartsHaveThemFromTheirStart) {
  EXPECT_EQ(Output(absl::StrCat("cat ", read_, "/file")), "words of read");
  EXPECT_EQ(Output(absl::StrCat("echo more > ", change_, "/new; cat ", change_, "/new")), "more");
  EXPECT_THAT(Output(absl::StrCat("cat ", other_, "/file")), EndsWith("Permission denied"));
  EXPECT_THAT(Output(absl::StrCat("ls ", dir_.path())), HasSubstr("Permission denied"));
  EXPECT_THAT(Output("cat /etc/hostname /etc/group"), HasSubstr("/etc/group: Permission denied"));
  EXPECT_EQ(Output("echo x > /dev/null; head -c 1 /dev/zero | wc -c; head -c 1 "
                   "/proc/cpuinfo | wc -c"),
            "1\n1");
}

TEST_F(FileRulesetTest, AProgramReadsItsOwnFolderAndItsLibraries) {
  for (const char* folder : {"bin", "lib", "libs"}) fs::create_directory(read_ + "/" + folder);
  const std::string program = read_ + "/bin/program";
  std::ofstream(program) << "#!/bin/sh\ncat \"$@\"\n";
  fs::permissions(program, fs::perms::owner_all);
  fs::create_symlink(program, other_ + "/program");
  SubprocessOptions options;
  options.args = {other_ + "/program"};
  for (const char* path : {"/bin/words", "/lib/words", "/libs/words"}) {
    std::ofstream(read_ + path) << path << "\n";
    options.args.push_back(read_ + path);
  }
  options.confined = true;
  const auto without = RunSubprocess(options, CancelToken());
  ASSERT_TRUE(without.ok()) << without.status();
  EXPECT_THAT(without->tail, HasSubstr("/bin/words\n/lib/words\n"));
  EXPECT_THAT(without->tail, HasSubstr("/libs/words: Permission denied"));
  options.env = {absl::StrCat("LD_LIBRARY_PATH=/nowhere:", read_, "/libs")};
  const auto with = RunSubprocess(options, CancelToken());
  ASSERT_TRUE(with.ok()) << with.status();
  EXPECT_EQ(with->tail, "/bin/words\n/lib/words\n/libs/words");
}

}  // namespace
}  // namespace litags
