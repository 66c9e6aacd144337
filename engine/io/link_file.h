// A file that stands for another.
#ifndef LITAGS_ENGINE_IO_LINK_FILE_H_
#define LITAGS_ENGINE_IO_LINK_FILE_H_

#include <filesystem>
#include <system_error>

namespace litags {

// Makes `link`, which is not there, a link to the file `target`; a copy of it where there can be no
// links, as on FAT and exFAT, or where `can_link` is false.
std::error_code LinkFile(const std::filesystem::path& target, const std::filesystem::path& link,
                         bool can_link = true);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_LINK_FILE_H_
