#ifndef LITAGS_SERVER_TESTING_TEMP_DIR_H_
#define LITAGS_SERVER_TESTING_TEMP_DIR_H_

#include <cstdlib>
#include <filesystem>
#include <string>

#include "engine/core/check.h"

namespace litags {

// A folder that is removed with everything in it when the test ends.
class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "litags-XXXXXX").string();
    LITAGS_CHECK(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  ~TempDir() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_TEMP_DIR_H_
