#include "engine/export/zip.h"

#include <zlib.h>

#include "engine/core/error.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr uint16_t kVersion = 20;  // 2.0 can read it
constexpr uint32_t kDate =
    0x00210000;  // 1 January 1980, the first there is: same scene, same bytes

// What the header before a file and its line in the directory have in common.
std::string Entry(const std::string& name, const std::string& content) {
  std::string out;
  AppendNumber(&out, kVersion);
  AppendNumber(&out, uint16_t{0});  // flags
  AppendNumber(&out, uint16_t{0});  // stored
  AppendNumber(&out, kDate);
  AppendNumber(&out, static_cast<uint32_t>(crc32_z(
                         0, reinterpret_cast<const Bytef*>(content.data()), content.size())));
  AppendNumber(&out, static_cast<uint32_t>(content.size()));
  AppendNumber(&out, static_cast<uint32_t>(content.size()));
  AppendNumber(&out, static_cast<uint16_t>(name.size()));
  AppendNumber(&out, uint16_t{0});  // extra field
  return out;
}

}  // namespace

absl::StatusOr<std::string> StoredZip(
    const std::vector<std::pair<std::string, std::string>>& files) {
  std::string out, directory;
  for (const auto& [name, content] : files) {
    if (out.size() + content.size() > 0xf0000000) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
                       "format: the file would have more than 4 GiB; give a smaller max_splats");
    }
    const std::string entry = Entry(name, content);
    AppendNumber(&directory, uint32_t{0x02014b50});
    AppendNumber(&directory, kVersion);
    directory += entry;
    directory.append(2 + 2 + 2 + 4, '\0');  // comment, disk, attributes
    AppendNumber(&directory, static_cast<uint32_t>(out.size()));
    directory += name;
    AppendNumber(&out, uint32_t{0x04034b50});
    out += entry + name;
    out += content;
  }
  const auto at = static_cast<uint32_t>(out.size());
  out += directory;
  AppendNumber(&out, uint32_t{0x06054b50});
  AppendNumber(&out, uint32_t{0});  // disks
  AppendNumber(&out, static_cast<uint16_t>(files.size()));
  AppendNumber(&out, static_cast<uint16_t>(files.size()));
  AppendNumber(&out, static_cast<uint32_t>(directory.size()));
  AppendNumber(&out, at);
  AppendNumber(&out, uint16_t{0});  // comment
  return out;
}

}  // namespace litags
