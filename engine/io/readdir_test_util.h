// Makes the reading of a folder fail: a test program's own readdir stands before that of the C
// library, also for std::filesystem. Include it in one file of a program.
#ifndef LITAGS_ENGINE_IO_READDIR_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_READDIR_TEST_UTIL_H_

#include <dirent.h>
#include <dlfcn.h>

#include <cerrno>

namespace litags {

// How many calls succeed before one that fails, which sets it to -1: none fails.
inline int readdirs_before_failure = -1;

}  // namespace litags

extern "C" dirent* readdir(DIR* dir) {
  static const auto real = reinterpret_cast<dirent* (*)(DIR*)>(dlsym(RTLD_NEXT, "readdir"));
  int& left = litags::readdirs_before_failure;
  if (left < 0 || left-- > 0) return real(dir);
  errno = EIO;
  return nullptr;
}

#endif  // LITAGS_ENGINE_IO_READDIR_TEST_UTIL_H_
