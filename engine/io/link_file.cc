#include "engine/io/link_file.h"

namespace litags {

namespace fs = std::filesystem;

void MakeSymlink(const fs::path& target, const fs::path& link, std::error_code& error) {
  fs::create_symlink(target, link, error);
}

std::error_code LinkFile(const fs::path& target, const fs::path& link, const Linker& linker) {
  std::error_code error;
  linker(fs::absolute(target), link, error);
  if (error) fs::copy_file(target, link, error);
  return error;
}

}  // namespace litags
