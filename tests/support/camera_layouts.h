// Folders with cameras, and which of them are used: camera_layouts.txt, which says more.
#ifndef LITAGS_TESTS_SUPPORT_CAMERA_LAYOUTS_H_
#define LITAGS_TESTS_SUPPORT_CAMERA_LAYOUTS_H_

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace litags {

struct CameraLayout {
  std::vector<std::pair<std::string, int>> files;  // with numbers of images
  std::vector<std::pair<std::string, std::string>> links;
  std::string named, alone;  // used by `--cameras DIR`, and by DIR

  // The number of images as a model's list has it.
  static std::string ListOf(const std::string& name, int images) {
    std::string list;
    if (name.ends_with(".bin")) {
      const uint64_t count = images;
      list.resize(sizeof(count));
      std::memcpy(list.data(), &count, sizeof(count));
    }
    for (int i = 0; i < images; ++i) list += "1 1 0 0 0 0 0 0 1 a.png\n";
    return list;
  }

  void Write(const std::filesystem::path& dir) const {
    std::filesystem::remove_all(dir);
    std::filesystem::create_directories(dir / "images");
    std::ofstream(dir / "images/a.png") << "x";
    for (const auto& [name, target] : links) {
      std::filesystem::create_directories((dir / name).parent_path());
      std::filesystem::create_symlink(target, dir / name);
    }
    for (const auto& [name, images] : files) {
      std::filesystem::create_directories((dir / name).parent_path());
      std::ofstream(dir / name, std::ios::binary) << ListOf(name, images);
    }
  }

  // A path as the table has it.
  static std::string Seen(const std::filesystem::path& used, const std::filesystem::path& dir) {
    const std::string seen = used.lexically_relative(dir).generic_string();
    return seen.ends_with('/') ? seen.substr(0, seen.size() - 1) : seen;
  }

  static std::vector<CameraLayout> All() {
    std::vector<CameraLayout> all;
    std::ifstream table(std::filesystem::path(LITAGS_SOURCE_DIR) /
                        "tests/support/camera_layouts.txt");
    for (std::string line; std::getline(table, line);) {
      if (line.empty() || line[0] == '#') continue;
      CameraLayout layout;
      std::istringstream words(line);
      for (std::string word; words >> word && word != "|";) {
        const size_t arrow = word.find('>'), mark = word.find('=');
        if (arrow != std::string::npos) {
          layout.links.emplace_back(word.substr(0, arrow), word.substr(arrow + 1));
          continue;
        }
        layout.files.emplace_back(word.substr(0, mark),
                                  mark == std::string::npos ? 0 : std::stoi(word.substr(mark + 1)));
      }
      std::string bar;
      words >> layout.named >> bar >> layout.alone;
      all.push_back(std::move(layout));
    }
    return all;
  }
};

}  // namespace litags

#endif  // LITAGS_TESTS_SUPPORT_CAMERA_LAYOUTS_H_
