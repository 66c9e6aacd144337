// Files: bounded reads, atomic writes, names that came from strangers.
#ifndef LITAGS_ENGINE_IO_FILE_UTIL_H_
#define LITAGS_ENGINE_IO_FILE_UTIL_H_

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

namespace litags {

// The whole file. `field` names the input in errors (empty: the path). NOT_FOUND if missing,
// INVALID_ARGUMENT (FILE_TOO_LARGE) if it holds more than `max_bytes`, checked before allocating.
absl::StatusOr<std::string> ReadFile(const std::string& path, std::string_view field,
                                     int64_t max_bytes);

// Replaces `path` so that a reader, or a crash at any instant, sees either the old file or the
// whole new one: temporary file in the same folder, fsync, rename, fsync of the folder.
// RESOURCE_EXHAUSTED (DISK_FULL) if there is no room; nothing is left behind on failure. What is no
// file (/dev/stdout, a FIFO) is written to as it is.
absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes);
// The same for `parts` written one after the other, without joining them in memory.
absl::Status WriteFileAtomically(const std::string& path, absl::Span<const std::string_view> parts);

// How the names of those temporary files end.
inline constexpr char kTempSuffix[] = ".litags-tmp";

// Deletes the temporary files that writers killed half-way left in `dir`. For the folder's only
// writer, when it starts. Returns how many there were.
int RemoveStaleTempFiles(const std::string& dir);

// Names of what lies in `dir`, folders too, that `accept` takes, sorted. `field` names the folder
// in errors. NOT_FOUND (NO_SUCH_FOLDER), INTERNAL (IO_ERROR): not all of it could be read.
absl::StatusOr<std::vector<std::string>> ListNames(
    const std::string& dir, std::string_view field,
    absl::FunctionRef<bool(const std::filesystem::directory_entry& entry)> accept);

// The same but for folders: a link to a file that is gone is among them.
absl::StatusOr<std::vector<std::string>> ListFiles(
    const std::string& dir, std::string_view field,
    absl::FunctionRef<bool(const std::string& name)> accept);

// Whether a client's `name` may become a file's name inside a folder of ours: 1..255 bytes, valid
// UTF-8, no '/' or '\', no control characters, no leading dot. INVALID_ARGUMENT (BAD_FILE_NAME).
absl::Status ValidateFileName(std::string_view name, std::string_view field);

// The part after the last '/' or '\'.
std::string BaseName(std::string_view path);
// The base name without its last extension: "low/0001.JPG" -> "0001".
std::string Stem(std::string_view path);

// Finds photos by name, else by stem: cameras and truth photos often come with another extension.
// Photos lie in one folder: of a path, its folders are tried in front of the name, joined by '_'
// ("cam0/0001.png" as "cam0_0001.png"), and then the name alone.
class NameIndex {
 public:
  explicit NameIndex(absl::Span<const std::string> names);
  // Index into `names`: what FindExact finds, else the first of FindAlike.
  std::optional<size_t> Find(const std::string& path) const;
  // Letter by letter.
  std::optional<size_t> FindExact(const std::string& path) const;
  // All that `path` may mean otherwise: names that differ in case or in how letters are encoded,
  // else names without their endings.
  std::vector<size_t> FindAlike(const std::string& path) const;

 private:
  using Indices = std::map<std::string, std::vector<size_t>>;

  std::map<std::string, size_t> by_name_;
  Indices by_key_, by_stem_;
};

// What Find compares paths with: it finds a name only if StemKey(name) is among KeysOf(path).
std::string StemKey(std::string_view name);
std::vector<std::string> KeysOf(std::string_view path);

// The path's name with its last folders in front, "a_b_0001.png": with eight folders at most, with
// ever fewer, and alone.
std::vector<std::string> NamesInOneFolder(std::string_view path);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_FILE_UTIL_H_
