// One file of named byte sections, versioned and checksummed: checkpoints and scene snapshots.
#ifndef LITAGS_ENGINE_IO_CONTAINER_H_
#define LITAGS_ENGINE_IO_CONTAINER_H_

#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// Collects sections, then writes them in order as one file.
class ContainerWriter {
 public:
  // `kind` says what the file is ("checkpoint"), `version` the layout of its sections.
  ContainerWriter(std::string_view kind, uint32_t version) : kind_(kind), version_(version) {}

  // Names are unique and at most 255 bytes.
  void AddSection(std::string_view name, std::string bytes);
  // Keeps a reference only: `bytes` must live until Commit returns.
  void AddSectionView(std::string_view name, std::string_view bytes);
  // The elements of an array of numbers, by reference, as the little-endian machine holds them.
  template <typename T>
  void AddArrayView(std::string_view name, const std::vector<T>& values) {
    static_assert(std::is_arithmetic_v<T>);
    AddSectionView(name, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  }

  // Writes the file atomically (see WriteFileAtomically). The same sections give the same bytes.
  absl::Status Commit(const std::string& path) const;

 private:
  struct Entry {
    std::string name;
    std::string_view bytes;
  };
  std::string kind_;
  uint32_t version_;
  std::deque<std::string> owned_;  // deque: views into its strings survive growth
  std::vector<Entry> entries_;
};

// A file read back whole, every checksum verified.
class Container {
 public:
  // Reads a file of this `kind` whose version is `oldest` to `newest`. NOT_FOUND if missing.
  // INVALID_ARGUMENT: NOT_A_CONTAINER (foreign file), WRONG_CONTAINER_KIND. FAILED_PRECONDITION:
  // CONTAINER_TOO_OLD, CONTAINER_TOO_NEW. DATA_LOSS: CONTAINER_TRUNCATED, CONTAINER_CORRUPT.
  static absl::StatusOr<Container> Read(const std::string& path, std::string_view kind,
                                        uint32_t oldest, uint32_t newest,
                                        int64_t max_bytes = int64_t{8} << 30);
  // The same from memory; `name` stands in messages where the path would.
  static absl::StatusOr<Container> Parse(std::string bytes, std::string_view name,
                                         std::string_view kind, uint32_t oldest, uint32_t newest);

  uint32_t version() const { return version_; }
  bool Has(std::string_view name) const;
  std::vector<std::string> SectionNames() const;

  // The view lives as long as this object. DATA_LOSS (SECTION_MISSING) if there is none.
  absl::StatusOr<std::string_view> Section(std::string_view name) const;

  // A section written by AddArrayView. DATA_LOSS (SECTION_MISSING, SECTION_SIZE).
  template <typename T>
  absl::StatusOr<std::vector<T>> Array(std::string_view name) const {
    static_assert(std::is_arithmetic_v<T>);
    absl::StatusOr<std::string_view> bytes = Section(name);
    if (!bytes.ok()) return bytes.status();
    if (bytes->size() % sizeof(T) != 0) return BadArraySize(name, bytes->size(), sizeof(T));
    std::vector<T> values(bytes->size() / sizeof(T));
    if (!values.empty()) std::memcpy(values.data(), bytes->data(), bytes->size());
    return values;
  }

 private:
  struct Entry {
    std::string name;
    size_t offset;
    size_t size;
  };
  absl::Status BadArraySize(std::string_view name, size_t bytes, size_t element) const;

  std::string name_;
  std::string bytes_;
  uint32_t version_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_CONTAINER_H_
