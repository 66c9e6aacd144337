#include "engine/io/link_file.h"

namespace litags {

namespace fs = std::filesystem;

std::error_code LinkFile(const fs::path& target, const fs::path& link, bool can_link) {
  std::error_code error = std::make_error_code(std::errc::operation_not_permitted);
  if (can_link) fs::create_symlink(fs::absolute(target), link, error);
  if (error) fs::copy_file(target, link, error);
  return error;
}

}  // namespace litags
