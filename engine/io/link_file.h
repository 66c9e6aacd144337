// A file that stands for another.
#ifndef LITAGS_ENGINE_IO_LINK_FILE_H_
#define LITAGS_ENGINE_IO_LINK_FILE_H_

#include <filesystem>
#include <functional>
#include <system_error>

namespace litags {

using Linker = std::function<void(const std::filesystem::path& target,
                                  const std::filesystem::path& link, std::error_code& error)>;
void MakeSymlink(const std::filesystem::path& target, const std::filesystem::path& link,
                 std::error_code& error);

// Makes `link`, which is not there, a link to the file `target`; a copy of it where there can be no
// links, as on FAT and exFAT.
std::error_code LinkFile(const std::filesystem::path& target, const std::filesystem::path& link,
                         const Linker& linker = MakeSymlink);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_LINK_FILE_H_
