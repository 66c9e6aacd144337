#include "engine/core/file_ruleset.h"

#include <fcntl.h>
#include <linux/landlock.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <system_error>

#include "absl/strings/str_split.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Later than Debian 12's headers.
constexpr uint64_t kTruncate = uint64_t{1} << 14;

constexpr uint64_t kRead =
    LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr uint64_t kChange = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR |
                             LANDLOCK_ACCESS_FS_WRITE_FILE | LANDLOCK_ACCESS_FS_REMOVE_DIR |
                             LANDLOCK_ACCESS_FS_REMOVE_FILE | LANDLOCK_ACCESS_FS_MAKE_DIR |
                             LANDLOCK_ACCESS_FS_MAKE_REG | LANDLOCK_ACCESS_FS_REFER | kTruncate;
constexpr uint64_t kRefusedEverywhere =
    LANDLOCK_ACCESS_FS_MAKE_CHAR | LANDLOCK_ACCESS_FS_MAKE_SOCK | LANDLOCK_ACCESS_FS_MAKE_FIFO |
    LANDLOCK_ACCESS_FS_MAKE_BLOCK | LANDLOCK_ACCESS_FS_MAKE_SYM;
// All that a rule about a file may name.
constexpr uint64_t kOfFiles = LANDLOCK_ACCESS_FS_EXECUTE | LANDLOCK_ACCESS_FS_READ_FILE |
                              LANDLOCK_ACCESS_FS_WRITE_FILE | kTruncate;

// Of /etc only what programs start with; there are secrets in it.
constexpr const char* kSystemReads[] = {"/usr",
                                        "/bin",
                                        "/sbin",
                                        "/lib",
                                        "/lib32",
                                        "/lib64",
                                        "/etc/ld.so.cache",
                                        "/etc/ld.so.preload",
                                        "/etc/localtime",
                                        "/etc/nsswitch.conf",
                                        "/etc/passwd",
                                        "/proc",
                                        "/sys",
                                        "/dev/urandom",
                                        "/dev/random"};
constexpr const char* kSystemChanges[] = {"/dev/null", "/dev/zero", "/dev/full"};

// The version of what this kernel has; 0: none.
int Version() {
  const long version =
      syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  return version < 0 ? 0 : static_cast<int>(version);
}

uint64_t KnownTo(int version) {
  uint64_t rights = kRead | kChange | kRefusedEverywhere;
  if (version < 2) rights &= ~uint64_t{LANDLOCK_ACCESS_FS_REFER};
  if (version < 3) rights &= ~kTruncate;
  return rights;
}

void AddRule(int ruleset, const std::string& path, uint64_t rights) {
  const UniqueFd file(open(path.c_str(), O_PATH | O_CLOEXEC));
  struct stat info;
  if (!file.valid() || fstat(file.get(), &info) != 0) return;
  if (!S_ISDIR(info.st_mode)) rights &= kOfFiles;
  const landlock_path_beneath_attr rule = {rights, file.get()};
  syscall(SYS_landlock_add_rule, ruleset, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
}

}  // namespace

FileRuleset::FileRuleset(const FileAccess& access) {
  const int version = Version();
  if (version == 0) return;
  const uint64_t known = KnownTo(version);
  landlock_ruleset_attr rights = {};
  rights.handled_access_fs = known;
  // It is close-on-exec.
  ruleset_ =
      UniqueFd(static_cast<int>(syscall(SYS_landlock_create_ruleset, &rights, sizeof(rights), 0)));
  error_ = ruleset_.valid() ? 0 : errno;
  if (error_ != 0) return;
  for (const std::string& path : access.read) AddRule(ruleset_.get(), path, kRead & known);
  for (const std::string& path : access.change) AddRule(ruleset_.get(), path, kChange & known);
}

bool FileRuleset::Supported() { return Version() > 0; }

int FileRuleset::Apply() const {
  if (error_ != 0) return error_;
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return errno;
  return syscall(SYS_landlock_restrict_self, ruleset_.get(), 0) == 0 ? 0 : errno;
}

FileAccess AccessToRun(const std::string& program, const std::vector<std::string>& environment) {
  FileAccess access = {{std::begin(kSystemReads), std::end(kSystemReads)},
                       {std::begin(kSystemChanges), std::end(kSystemChanges)}};
  access.read.push_back(program);  // wherever it is: it may have been replaced since we started
  std::error_code error;
  const fs::path folder = fs::canonical(program, error).parent_path();
  if (!error) {
    access.read.push_back(folder);
    access.read.push_back(folder.parent_path() / "lib");
  }
  constexpr std::string_view kLibraries = "LD_LIBRARY_PATH=";
  for (const std::string& entry : environment) {
    if (!entry.starts_with(kLibraries)) continue;
    const std::vector<std::string> paths =
        absl::StrSplit(entry.substr(kLibraries.size()), ':', absl::SkipEmpty());
    access.read.insert(access.read.end(), paths.begin(), paths.end());
  }
  return access;
}

}  // namespace litags
