#ifndef LITAGS_ENGINE_CORE_TEMP_DIR_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_TEMP_DIR_TEST_UTIL_H_

#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "engine/core/check.h"

namespace litags {

// A fresh folder, removed with everything in it when this object ends.
class TempDir {
 public:
  TempDir() : path_((std::filesystem::temp_directory_path() / "litags-XXXXXX").string()) {
    LITAGS_CHECK(mkdtemp(path_.data()) != nullptr);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  ~TempDir() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }

  const std::string& path() const { return path_; }
  std::string operator/(std::string_view name) const { return path_ + "/" + std::string(name); }

 private:
  std::string path_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_TEMP_DIR_TEST_UTIL_H_
