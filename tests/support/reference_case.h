// Numeric reference cases: a folder with case.json and .npy arrays. They live beside the source
// tree and are not part of it; tests skip when they are missing.
#ifndef LITAGS_TESTS_SUPPORT_REFERENCE_CASE_H_
#define LITAGS_TESTS_SUPPORT_REFERENCE_CASE_H_

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/core/image.h"
#include "engine/io/npy.h"

namespace litags {

class ReferenceCase {
 public:
  // `source_root` is the top of the source tree.
  ReferenceCase(const std::string& source_root, const std::string& name)
      : dir_(std::filesystem::path(source_root) / "../shared/reference" / name) {
    std::ifstream file(dir_ / "case.json");
    if (file) json_ = nlohmann::json::parse(file);
  }

  bool found() const { return !json_.is_null(); }
  const nlohmann::json& json() const { return json_; }
  double param(const char* name) const { return json_["params"][name]; }
  double value(const char* name) const { return json_["values"][name]; }
  double tolerance(const char* name) const { return json_["tolerances"][name]; }

  NpyArray Array(const std::string& name) const {
    auto array = ReadNpy((dir_ / (name + ".npy")).string(), name);
    EXPECT_TRUE(array.ok()) << array.status();
    return array.ok() ? *array : NpyArray();
  }

  // A [C, H, W] or [H, W] array.
  Planes Map(const std::string& name) const {
    const NpyArray array = Array(name);
    const size_t n = array.shape.size();
    if (n != 2 && n != 3) return Planes();
    Planes planes(n == 3 ? static_cast<int>(array.shape[0]) : 1,
                  static_cast<int>(array.shape[n - 2]), static_cast<int>(array.shape[n - 1]));
    planes.data = array.ToFloats();
    return planes;
  }

  // A uint8 [H, W, 3] array.
  ImageU8 Photo(const std::string& name) const {
    const NpyArray array = Array(name);
    if (array.shape.size() != 3 || array.type != NpyType::kUInt8) return ImageU8();
    ImageU8 image(static_cast<int>(array.shape[1]), static_cast<int>(array.shape[0]));
    image.data = array.bytes;
    return image;
  }

 private:
  std::filesystem::path dir_;
  nlohmann::json json_;
};

}  // namespace litags

#define LITAGS_SKIP_IF_MISSING(reference)                                 \
  if (!(reference).found()) {                                             \
    GTEST_SKIP() << "the reference cases are not beside the source tree"; \
  }

#endif  // LITAGS_TESTS_SUPPORT_REFERENCE_CASE_H_
