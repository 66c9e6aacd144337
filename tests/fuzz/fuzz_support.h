// What the fuzz targets share.
#ifndef LITAGS_TESTS_FUZZ_FUZZ_SUPPORT_H_
#define LITAGS_TESTS_FUZZ_FUZZ_SUPPORT_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

// The entry point that libFuzzer, or the replay program, calls for each input.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace litags {

inline std::string_view AsText(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// Several pieces in one input: each is preceded by its length as four bytes, least significant
// first. A length beyond the end takes what is left.
std::string JoinPieces(const std::vector<std::string>& pieces);
std::vector<std::string> SplitPieces(std::string_view input);

// A scratch file in memory, one per process: for readers that take a path.
const std::string& ScratchPath();
void WriteScratchFile(std::string_view bytes);

// Writes the scratch file as a container of this kind, with valid checksums, whose sections are the
// input's pieces in pairs of name and bytes: so that what stands behind the checksums is fuzzed.
void WriteScratchContainer(std::string_view input, std::string_view kind, uint32_t version);

// The same of a scene, of the version that the input's first byte chooses, which is returned.
uint32_t WriteScratchScene(std::string_view input);

}  // namespace litags

#endif  // LITAGS_TESTS_FUZZ_FUZZ_SUPPORT_H_
