// Layout, little-endian, no padding, so that every byte is under a checksum:
//   magic[8] "\x89LITAGS\n"  u32 format version  u32 header size
//   header: u32 size + kind, u32 version, u32 number of sections,
//           per section: u32 size + name, u64 size, SHA-256 of its bytes
//   SHA-256 of all of the above, then the sections' bytes, one after the other.
#include "engine/io/container.h"

#include <openssl/evp.h>

#include <array>
#include <set>

#include "engine/io/byte_reader.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

constexpr std::string_view kMagic = "\x89LITAGS\n";
constexpr uint32_t kFormatVersion = 1;
constexpr size_t kPreambleSize = 16;
constexpr size_t kDigestSize = 32;
constexpr size_t kMaxNameSize = 255;

// SHA-256 and not a CRC: OpenSSL has it with run-time choice of the CPU's instructions, and it also
// tells scenes apart by content.
bool Sha256(std::string_view bytes, std::array<char, kDigestSize>* digest) {
  unsigned int size = 0;
  return EVP_Digest(bytes.data(), bytes.size(), reinterpret_cast<unsigned char*>(digest->data()),
                    &size, EVP_sha256(), nullptr) == 1 &&
         size == kDigestSize;
}

absl::Status DigestFailed(std::string_view name) {
  return FieldError(absl::StatusCode::kInternal, "DIGEST_FAILED", name,
                    "OpenSSL could not compute a SHA-256");
}

absl::Status Truncated(std::string_view name) {
  return FieldError(absl::StatusCode::kDataLoss, "CONTAINER_TRUNCATED", name,
                    "the file ends early; delete it and make it again");
}

absl::Status Corrupt(std::string_view name, std::string_view what) {
  return FieldError(
      absl::StatusCode::kDataLoss, "CONTAINER_CORRUPT", name,
      absl::StrCat(Absl(what), "; the file was damaged, delete it and make it again"));
}

absl::Status CheckDigest(std::string_view bytes, std::string_view expected, std::string_view name,
                         std::string_view what) {
  std::array<char, kDigestSize> digest;
  if (!Sha256(bytes, &digest)) return DigestFailed(name);
  if (std::string_view(digest.data(), digest.size()) == expected) return absl::OkStatus();
  return Corrupt(name, absl::StrCat(Absl(what), " does not match its checksum"));
}

void AppendString(std::string* out, std::string_view text) {
  AppendNumber(out, static_cast<uint32_t>(text.size()));
  out->append(text);
}

bool ReadString(ByteReader* reader, std::string_view* text) {
  uint32_t size = 0;
  return reader->Read(&size) && reader->ReadBytes(size, text);
}

// Checks the magic, the format version and the header's checksum; on success `header` is what lies
// between preamble and checksum.
absl::Status OpenHeader(std::string_view bytes, std::string_view name, std::string_view* header) {
  if (bytes.substr(0, kMagic.size()) != kMagic.substr(0, bytes.size()) || bytes.empty()) {
    return InvalidField("NOT_A_CONTAINER", name, "not a litags file; give one that litags wrote");
  }
  ByteReader reader(bytes);
  uint32_t format = 0, header_size = 0;
  if (!reader.Skip(kMagic.size()) || !reader.Read(&format) || !reader.Read(&header_size)) {
    return Truncated(name);
  }
  if (format > kFormatVersion) {
    return FieldError(absl::StatusCode::kFailedPrecondition, "CONTAINER_TOO_NEW", name,
                      absl::StrCat("file format ", format, " is newer than ", kFormatVersion,
                                   ", the newest this program knows; update litags"));
  }
  std::string_view expected;
  if (!reader.ReadBytes(header_size, header) || !reader.ReadBytes(kDigestSize, &expected)) {
    return Truncated(name);
  }
  return CheckDigest(bytes.substr(0, kPreambleSize + header_size), expected, name, "the header");
}

}  // namespace

void ContainerWriter::AddSection(std::string_view name, std::string bytes) {
  owned_.push_back(std::move(bytes));
  AddSectionView(name, owned_.back());
}

void ContainerWriter::AddSectionView(std::string_view name, std::string_view bytes) {
  entries_.push_back({std::string(name), bytes});
}

absl::Status ContainerWriter::Commit(const std::string& path) const {
  std::set<std::string_view> names;
  std::string header;
  AppendString(&header, kind_);
  AppendNumber(&header, version_);
  AppendNumber(&header, static_cast<uint32_t>(entries_.size()));
  for (const Entry& entry : entries_) {
    if (entry.name.empty() || entry.name.size() > kMaxNameSize ||
        !names.insert(entry.name).second) {
      return FieldError(
          absl::StatusCode::kInternal, "BAD_SECTION_NAME", path,
          absl::StrCat("section name '", entry.name, "' is empty, too long or used twice"));
    }
    std::array<char, kDigestSize> digest;
    if (!Sha256(entry.bytes, &digest)) return DigestFailed(path);
    AppendString(&header, entry.name);
    AppendNumber(&header, static_cast<uint64_t>(entry.bytes.size()));
    header.append(digest.data(), digest.size());
  }

  std::string front(kMagic);
  AppendNumber(&front, kFormatVersion);
  AppendNumber(&front, static_cast<uint32_t>(header.size()));
  front += header;
  std::array<char, kDigestSize> digest;
  if (!Sha256(front, &digest)) return DigestFailed(path);
  front.append(digest.data(), digest.size());

  std::vector<std::string_view> parts = {front};
  for (const Entry& entry : entries_) parts.push_back(entry.bytes);
  return WriteFileAtomically(path, parts);
}

absl::StatusOr<Container> Container::Read(const std::string& path, std::string_view kind,
                                          uint32_t oldest, uint32_t newest, int64_t max_bytes) {
  LITAGS_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path, path, max_bytes));
  return Parse(std::move(bytes), path, kind, oldest, newest);
}

absl::StatusOr<Container> Container::Parse(std::string bytes, std::string_view name,
                                           std::string_view kind, uint32_t oldest,
                                           uint32_t newest) {
  Container container;
  container.name_ = std::string(name);
  container.bytes_ = std::move(bytes);
  const std::string_view all = container.bytes_;
  std::string_view header;
  LITAGS_RETURN_IF_ERROR(OpenHeader(all, name, &header));

  ByteReader reader(header);
  std::string_view file_kind;
  if (!ReadString(&reader, &file_kind) || !reader.Read(&container.version_)) {
    return Corrupt(name, "the header is malformed");
  }
  if (file_kind != kind) {
    return InvalidField(
        "WRONG_CONTAINER_KIND", name,
        absl::StrCat("this is a litags '", Absl(file_kind), "' file, not a '", Absl(kind), "'"));
  }
  if (container.version_ > newest) {
    return FieldError(absl::StatusCode::kFailedPrecondition, "CONTAINER_TOO_NEW", name,
                      absl::StrCat(Absl(kind), " version ", container.version_, " is newer than ",
                                   newest, ", the newest this program knows; update litags"));
  }
  if (container.version_ < oldest) {
    return FieldError(
        absl::StatusCode::kFailedPrecondition, "CONTAINER_TOO_OLD", name,
        absl::StrCat(Absl(kind), " version ", container.version_, " is older than ", oldest,
                     ", the oldest this program knows; delete the file and make it again"));
  }

  uint32_t count = 0;
  if (!reader.Read(&count)) return Corrupt(name, "the header is malformed");
  size_t offset = kPreambleSize + header.size() + kDigestSize;
  for (uint32_t i = 0; i < count; ++i) {
    std::string_view section, digest;
    uint64_t size = 0;
    if (!ReadString(&reader, &section) || !reader.Read(&size) ||
        !reader.ReadBytes(kDigestSize, &digest)) {
      return Corrupt(name, "the header is malformed");
    }
    if (size > all.size() - offset) return Truncated(name);
    LITAGS_RETURN_IF_ERROR(CheckDigest(all.substr(offset, size), digest, name,
                                       absl::StrCat("section '", Absl(section), "'")));
    container.entries_.push_back({std::string(section), offset, static_cast<size_t>(size)});
    offset += size;
  }
  if (offset != all.size()) return Corrupt(name, "bytes follow the last section");
  return container;
}

bool Container::Has(std::string_view name) const {
  for (const Entry& entry : entries_) {
    if (entry.name == name) return true;
  }
  return false;
}

std::vector<std::string> Container::SectionNames() const {
  std::vector<std::string> names;
  for (const Entry& entry : entries_) names.push_back(entry.name);
  return names;
}

absl::StatusOr<std::string_view> Container::Section(std::string_view name) const {
  for (const Entry& entry : entries_) {
    if (entry.name == name) return std::string_view(bytes_).substr(entry.offset, entry.size);
  }
  return FieldError(absl::StatusCode::kDataLoss, "SECTION_MISSING", name_,
                    absl::StrCat("there is no section '", Absl(name), "'"));
}

absl::Status Container::BadArraySize(std::string_view name, size_t bytes, size_t element) const {
  return FieldError(absl::StatusCode::kDataLoss, "SECTION_SIZE", name_,
                    absl::StrCat("section '", Absl(name), "' has ", bytes,
                                 " bytes, not a multiple of ", element));
}

}  // namespace litags
