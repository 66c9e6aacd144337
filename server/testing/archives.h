#ifndef LITAGS_SERVER_TESTING_ARCHIVES_H_
#define LITAGS_SERVER_TESTING_ARCHIVES_H_

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

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

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_ARCHIVES_H_
