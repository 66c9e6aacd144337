#include "server/archive/extract.h"

#include <archive.h>
#include <archive_entry.h>
#include <locale.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <system_error>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"

namespace litags {
namespace {

constexpr size_t kBlockBytes = size_t{256} << 10;
// Unpacked bytes that no ratio forbids.
constexpr int64_t kFreeBytes = int64_t{64} << 20;

using Reader = std::unique_ptr<archive, int (*)(archive*)>;

// The library gives names in the character set of the thread's locale, and none at all if it lacks
// a character, as that of a program does that sets no locale.
class Utf8Names {
 public:
  Utf8Names() {
    static const locale_t kUtf8 = newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
    if (kUtf8) before_ = uselocale(kUtf8);
  }
  Utf8Names(const Utf8Names&) = delete;
  Utf8Names& operator=(const Utf8Names&) = delete;
  ~Utf8Names() {
    if (before_) uselocale(before_);
  }

 private:
  locale_t before_ = nullptr;
};

// The characters 0x80 to 0xFF of code page 437, the one of ZIP names that are not UTF-8.
constexpr std::string_view kCodePage437 =
    "ÇüéâäàåçêëèïîìÄÅÉæÆôöòûùÿÖÜ¢£¥₧ƒáíóúñÑªº¿⌐¬½¼¡«»░▒▓│┤╡╢╖╕╣║╗╝╜╛┐"
    "└┴┬├─┼╞╟╚╔╩╦╠═╬╧╨╤╥╙╘╒╓╫╪┘┌█▄▌▐▀αßΓπΣσµτΦΘΩδ∞φε∩≡±≥≤⌠⌡÷≈°∙·√ⁿ²■\u00A0";

std::string FromCodePage437(std::string_view text) {
  std::vector<std::string_view> high;
  for (std::string_view rest = kCodePage437; !rest.empty();) {
    high.push_back(rest.substr(0, Utf8Length(rest)));
    rest.remove_prefix(high.back().size());
  }
  std::string out;
  for (const char c : text) {
    const auto code = static_cast<uint8_t>(c);
    if (code < 0x80) {
      out += c;
    } else {
      out += high[code - 0x80];
    }
  }
  return out;
}

absl::Status NotRecognized(const std::string& field, const std::string& why) {
  return InvalidInput(
      "ARCHIVE_NOT_RECOGNIZED", field,
      absl::StrCat(field, ": not the start of a ZIP or TAR archive, plain or gzipped (",
                   ShownName(why), "); pack it anew or upload the files themselves"));
}

class Extraction : public ArchiveReader {
 public:
  Extraction(Reader reader, int64_t archive_bytes, const ArchiveLimits& limits,
             std::string_view field, ArchiveSink* sink, const CancelToken& cancel)
      : reader_(std::move(reader)),
        archive_bytes_(archive_bytes),
        limits_(limits),
        field_(field),
        sink_(sink),
        cancel_(cancel) {}

  absl::StatusOr<bool> ReadNext() override {
    const Utf8Names utf8_names;
    for (;; ++entries_) {
      LITAGS_RETURN_IF_ERROR(cancel_.Check());
      archive_entry* entry = nullptr;
      const int result = archive_read_next_header(reader_.get(), &entry);
      if (result == ARCHIVE_EOF) break;
      if (result != ARCHIVE_OK && result != ARCHIVE_WARN) return Corrupt(entries_ == 0);
      if (entries_ == limits_.max_entries) {
        return TooMuch("ARCHIVE_TOO_MANY_ENTRIES",
                       absl::StrCat("more than ", limits_.max_entries, " entries"));
      }
      LITAGS_RETURN_IF_ERROR(CheckEntry(entry));
      if (archive_entry_filetype(entry) == AE_IFDIR) continue;
      ++entries_;
      has_file_ = true;
      LITAGS_RETURN_IF_ERROR(ReadFile(entry));
      return true;
    }
    if (has_file_) return false;
    return InvalidInput("ARCHIVE_EMPTY", field_,
                        absl::StrCat(field_,
                                     ": there is no file in the archive; pack the folder "
                                     "that holds the photos"));
  }

 private:
  absl::Status Corrupt(bool at_start) const {
    const char* why = archive_error_string(reader_.get());
    const std::string text = why ? why : "damaged";
    if (at_start) return NotRecognized(field_, text);
    return InvalidInput(
        "ARCHIVE_CORRUPT", field_,
        absl::StrCat(field_, ": the archive cannot be read",
                     name_.empty() ? "" : " from the entry " + ShownName(name_) + " on", " (",
                     ShownName(text), "); pack it anew"));
  }

  absl::Status TooMuch(const char* reason, const std::string& what) const {
    return MakeError(absl::StatusCode::kResourceExhausted, reason, field_,
                     absl::StrCat(field_, ": the archive has ", what,
                                  "; upload fewer or smaller photos, or the files themselves"));
  }

  absl::Status Unsafe(const char* why) const {
    return InvalidInput("ARCHIVE_ENTRY_UNSAFE", field_,
                        absl::StrCat(field_, ": the entry \"", ShownName(name_), "\" ", why,
                                     "; an archive may hold plain files and folders with relative "
                                     "names only"));
  }

  // Kind and name; sets name_ and parts_.
  absl::Status CheckEntry(archive_entry* entry) {
    const char* name = archive_entry_pathname_utf8(entry);
    if (!name) name = archive_entry_pathname(entry);
    name_ = name ? name : "";
    // Windows' own program does not mark names, and many others write UTF-8 without the mark.
    const bool zip =
        (archive_format(reader_.get()) & ARCHIVE_FORMAT_BASE_MASK) == ARCHIVE_FORMAT_ZIP;
    if (zip && !IsUtf8(name_)) name_ = FromCodePage437(name_);
    if (archive_entry_hardlink(entry) || archive_entry_symlink(entry) ||
        archive_entry_filetype(entry) == AE_IFLNK) {
      return Unsafe("is a link");
    }
    const auto type = archive_entry_filetype(entry);
    if (type != AE_IFREG && type != AE_IFDIR) return Unsafe("is a device, pipe or socket");
    if (archive_entry_is_encrypted(entry)) {
      return InvalidInput("ARCHIVE_ENCRYPTED", field_,
                          absl::StrCat(field_, ": the entry \"", ShownName(name_),
                                       "\" is encrypted; pack the folder without a password"));
    }
    return SplitName(type == AE_IFDIR);
  }

  absl::Status SplitName(bool is_folder) {
    if (name_.empty()) return Unsafe("has no name, or none that can be read");
    if (name_.front() == '/' || (name_.size() > 1 && name_[1] == ':')) {
      return Unsafe("has an absolute name");
    }
    if (name_.find('\\') != std::string::npos) return Unsafe("has a backslash in its name");
    parts_.clear();
    for (size_t begin = 0; begin <= name_.size();) {
      const size_t end = std::min(name_.find('/', begin), name_.size());
      std::string part = name_.substr(begin, end - begin);
      begin = end + 1;
      if (part == "..") return Unsafe("leads out of its folder");
      if (!part.empty() && part != ".") parts_.push_back(std::move(part));
    }
    if (parts_.empty() && !is_folder) return Unsafe("has no name");
    return absl::OkStatus();
  }

  absl::Status ReadFile(archive_entry* entry) {
    ArchiveEntry file;
    file.name = std::move(parts_.back());
    parts_.pop_back();
    file.folders = std::move(parts_);
    LITAGS_ASSIGN_OR_RETURN(const bool wanted, sink_->Begin(file));
    if (wanted && archive_entry_size_is_set(entry)) {
      LITAGS_RETURN_IF_ERROR(CheckSize(archive_entry_size(entry)));
    }
    int64_t bytes = 0;
    // Also what is not wanted is read and counted: a format may only be passed through in order.
    for (;;) {
      LITAGS_RETURN_IF_ERROR(cancel_.Check());
      const la_ssize_t n = archive_read_data(reader_.get(), block_.data(), block_.size());
      if (n == 0) break;
      if (n < 0) return Corrupt(false);
      bytes += n;
      total_ += n;
      LITAGS_RETURN_IF_ERROR(CheckTotal());
      if (wanted) {
        LITAGS_RETURN_IF_ERROR(CheckSize(bytes));
        LITAGS_RETURN_IF_ERROR(sink_->Write({block_.data(), static_cast<size_t>(n)}));
      }
    }
    return wanted ? sink_->End() : absl::OkStatus();
  }

  absl::Status CheckSize(int64_t bytes) const {
    if (bytes >= 0 && bytes <= limits_.max_entry_bytes) return absl::OkStatus();
    return TooMuch("ARCHIVE_ENTRY_TOO_LARGE",
                   absl::StrCat("the entry \"", ShownName(name_), "\" of more than ",
                                limits_.max_entry_bytes, " bytes"));
  }

  absl::Status CheckTotal() const {
    if (total_ > limits_.max_total_bytes) {
      return TooMuch("ARCHIVE_TOO_LARGE",
                     absl::StrCat("more than ", limits_.max_total_bytes, " bytes, unpacked"));
    }
    if (total_ > kFreeBytes && total_ / limits_.max_ratio > archive_bytes_) {
      return TooMuch("ARCHIVE_RATIO_TOO_LARGE",
                     absl::StrCat("more than ", limits_.max_ratio,
                                  " times its size, unpacked, as no photos have"));
    }
    return absl::OkStatus();
  }

  const Reader reader_;
  const int64_t archive_bytes_;
  const ArchiveLimits limits_;
  const std::string field_;
  ArchiveSink* const sink_;
  const CancelToken cancel_;
  int64_t entries_ = 0;  // read
  bool has_file_ = false;
  int64_t total_ = 0;
  std::string name_;                // of the entry in hand
  std::vector<std::string> parts_;  // of that name
  std::string block_ = std::string(kBlockBytes, '\0');
};

Reader MakeReader() {
  Reader reader(archive_read_new(), archive_read_free);
  archive_read_support_format_zip(reader.get());
  archive_read_support_format_tar(reader.get());
  archive_read_support_filter_gzip(reader.get());
  return reader;
}

absl::Status NotOpened(archive* reader, std::string_view field) {
  const char* why = archive_error_string(reader);
  return NotRecognized(std::string(field), why ? why : "it cannot be opened");
}

}  // namespace

std::string ShownName(std::string_view name) {
  constexpr size_t kLongest = 200;
  const std::string text = absl::Utf8SafeCHexEscape({name.data(), name.size()});
  return absl::StrCat(Utf8Prefix(text, kLongest), text.size() <= kLongest ? "" : "...");
}

absl::StatusOr<std::unique_ptr<ArchiveReader>> ArchiveReader::Open(const std::string& path,
                                                                   const ArchiveLimits& limits,
                                                                   std::string_view field,
                                                                   ArchiveSink* sink,
                                                                   const CancelToken& cancel) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  Reader reader = MakeReader();
  if (error || archive_read_open_filename(reader.get(), path.c_str(), kBlockBytes) != ARCHIVE_OK) {
    return NotOpened(reader.get(), field);
  }
  return std::make_unique<Extraction>(std::move(reader), static_cast<int64_t>(bytes), limits, field,
                                      sink, cancel);
}

absl::Status ExtractArchiveBytes(std::string_view bytes, const ArchiveLimits& limits,
                                 std::string_view field, ArchiveSink* sink) {
  Reader reader = MakeReader();
  if (archive_read_open_memory(reader.get(), bytes.data(), bytes.size()) != ARCHIVE_OK) {
    return NotOpened(reader.get(), field);
  }
  Extraction extraction(std::move(reader), static_cast<int64_t>(bytes.size()), limits, field, sink,
                        CancelToken());
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, extraction.ReadNext());
    if (!more) return absl::OkStatus();
  }
}

}  // namespace litags
