#ifndef LITAGS_CLIENT_FOLDER_H_
#define LITAGS_CLIENT_FOLDER_H_

#include <filesystem>
#include <system_error>
#include <vector>

namespace litags::client {

// What lies in a folder, in any order; nothing if it is none. `*error`: why some may be missing. A
// range-for over the iterator itself would throw.
inline std::vector<std::filesystem::directory_entry> EntriesOf(const std::filesystem::path& dir,
                                                               std::error_code* error) {
  std::vector<std::filesystem::directory_entry> entries;
  std::filesystem::directory_iterator it(dir, *error);
  for (const std::filesystem::directory_iterator end; !*error && it != end; it.increment(*error)) {
    entries.push_back(*it);
  }
  return entries;
}

}  // namespace litags::client

#endif  // LITAGS_CLIENT_FOLDER_H_
