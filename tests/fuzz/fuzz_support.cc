#include "tests/fuzz/fuzz_support.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "engine/core/check.h"
#include "engine/io/container.h"

namespace litags {
namespace {

constexpr size_t kLengthBytes = 4;
constexpr size_t kMaxNameSize = 255;  // that a container takes

// Removed when the process ends.
struct ScratchFolder {
  ScratchFolder() {
    std::error_code none;
    const bool memory = std::filesystem::is_directory("/dev/shm", none);
    path = std::string(memory ? "/dev/shm" : "/tmp") + "/litags-fuzz-XXXXXX";
    LITAGS_CHECK(mkdtemp(path.data()) != nullptr);
    file = path + "/input";
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  std::string path, file;
};

}  // namespace

std::string JoinPieces(const std::vector<std::string>& pieces) {
  std::string joined;
  for (const std::string& piece : pieces) {
    for (size_t i = 0; i < kLengthBytes; ++i) {
      joined.push_back(static_cast<char>(piece.size() >> (8 * i) & 0xFF));
    }
    joined += piece;
  }
  return joined;
}

std::vector<std::string> SplitPieces(std::string_view input) {
  std::vector<std::string> pieces;
  while (input.size() >= kLengthBytes) {
    size_t length = 0;
    for (size_t i = 0; i < kLengthBytes; ++i) {
      length |= static_cast<size_t>(static_cast<uint8_t>(input[i])) << (8 * i);
    }
    input.remove_prefix(kLengthBytes);
    length = std::min(length, input.size());
    pieces.emplace_back(input.substr(0, length));
    input.remove_prefix(length);
  }
  return pieces;
}

const std::string& ScratchPath() {
  static const ScratchFolder folder;
  return folder.file;
}

void WriteScratchFile(std::string_view bytes) {
  std::ofstream file(ScratchPath(), std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  LITAGS_CHECK(file.good());
}

void WriteScratchContainer(std::string_view input, std::string_view kind, uint32_t version) {
  const std::vector<std::string> pieces = SplitPieces(input);
  ContainerWriter writer(kind, version);
  std::set<std::string> names;
  for (size_t i = 0; i + 1 < pieces.size(); i += 2) {
    const bool fits = !pieces[i].empty() && pieces[i].size() <= kMaxNameSize;
    if (!fits || !names.insert(pieces[i]).second) continue;
    writer.AddSection(pieces[i], pieces[i + 1]);
  }
  LITAGS_CHECK(writer.Commit(ScratchPath()).ok());
}

uint32_t WriteScratchScene(std::string_view input) {
  const uint32_t version = input.empty() ? 1 : 1 + static_cast<uint8_t>(input[0]) % 4;
  WriteScratchContainer(input.substr(input.empty() ? 0 : 1), "scene", version);
  return version;
}

}  // namespace litags
