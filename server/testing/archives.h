#ifndef LITAGS_SERVER_TESTING_ARCHIVES_H_
#define LITAGS_SERVER_TESTING_ARCHIVES_H_

#include <cstdio>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/archive/extract.h"

namespace litags {

// One file of an archive, which two empty blocks end.
inline std::string TarEntry(const std::string& name, const std::string& bytes) {
  std::string entry(512, '\0');
  const auto put = [&](size_t at, const std::string& text) {
    entry.replace(at, text.size(), text);
  };
  put(0, name);
  put(100, "0000644");
  char size[12];
  std::snprintf(size, sizeof(size), "%011zo", bytes.size());
  put(124, size);
  put(148, "        ");
  put(156, "0");
  put(257, "ustar");
  put(263, "00");
  unsigned sum = 0;
  for (const unsigned char c : entry) sum += c;
  std::snprintf(size, sizeof(size), "%06o", sum);
  put(148, size);
  put(154, std::string(1, '\0'));
  entry += bytes;
  entry.resize((entry.size() + 511) / 512 * 512);
  return entry;
}

// A whole archive of files, by name.
inline std::string Tar(const std::vector<std::pair<std::string, std::string>>& files) {
  std::string tar;
  for (const auto& [name, bytes] : files) tar += TarEntry(name, bytes);
  return tar + std::string(1024, '\0');
}

// Keeps the files of an archive by folders and name, "set|images|1.jpg", but those that are called
// "unwanted".
class MapSink : public ArchiveSink {
 public:
  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    name_.clear();
    for (const std::string& folder : entry.folders) name_ += folder + "|";
    name_ += entry.name;
    if (on_begin) on_begin();
    return entry.name != "unwanted";
  }
  absl::Status Write(std::string_view bytes) override {
    files[name_] += bytes;
    return absl::OkStatus();
  }
  absl::Status End() override {
    ++ended;
    return absl::OkStatus();
  }

  std::function<void()> on_begin;
  std::map<std::string, std::string> files;
  int ended = 0;

 private:
  std::string name_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_ARCHIVES_H_
