// Inside this module: glTF 2.0 as one binary file.
#ifndef LITAGS_ENGINE_EXPORT_GLB_FILE_H_
#define LITAGS_ENGINE_EXPORT_GLB_FILE_H_

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "absl/status/statusor.h"
#include "engine/io/byte_reader.h"

namespace litags {

constexpr int kGlbVertices = 34962, kGlbIndices = 34963;  // what a part of the buffer holds

// The binary part, and the JSON that says what is where.
class GlbBuffer {
 public:
  // For so many bytes, and what the file has before them.
  explicit GlbBuffer(size_t bytes) { bytes_.reserve(bytes + kRoomBefore); }

  // Appends `count` elements of `width` numbers of type T; value(i, k) is number k of element i.
  // Returns the accessor, with which more can be said; its number is num_accessors() - 1. An
  // element's bytes are a multiple of 4.
  template <typename T, typename F>
  nlohmann::json& Add(int target, size_t count, int width, F&& value) {
    const char* const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    const size_t at = bytes_.size();
    for (size_t i = 0; i < count; ++i) {
      for (int k = 0; k < width; ++k) AppendNumber(&bytes_, static_cast<T>(value(i, k)));
    }
    views_.push_back({{"buffer", 0},
                      {"byteOffset", at},
                      {"byteLength", bytes_.size() - at},
                      {"target", target}});
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", ComponentType<T>()},
                          {"count", count},
                          {"type", types[width - 1]}});
    return accessors_.back();
  }

  // The same of vertices' positions, with their bounds. Not empty.
  template <typename F>
  void AddPositions(size_t count, F&& value) {
    nlohmann::json& accessor = Add<float>(kGlbVertices, count, 3, value);
    std::array<float, 3> min, max;
    for (int k = 0; k < 3; ++k) {
      min[k] = max[k] = static_cast<float>(value(0, k));
      for (size_t i = 1; i < count; ++i) {
        min[k] = std::min(min[k], static_cast<float>(value(i, k)));
        max[k] = std::max(max[k], static_cast<float>(value(i, k)));
      }
    }
    accessor["min"] = min;
    accessor["max"] = max;
  }

  size_t num_accessors() const { return accessors_.size(); }

 private:
  friend absl::StatusOr<std::string> EncodeGlbFile(GlbBuffer buffer,
                                                   const nlohmann::json& primitive,
                                                   const std::array<double, 3>& translation,
                                                   const nlohmann::json& more);

  template <typename T>
  static constexpr int ComponentType() {
    if (std::is_same_v<T, uint8_t>) return 5121;
    if (std::is_same_v<T, uint16_t>) return 5123;
    if (std::is_same_v<T, uint32_t>) return 5125;
    static_assert(std::is_same_v<T, float> || std::is_unsigned_v<T>);
    return 5126;
  }

  static constexpr size_t kRoomBefore = size_t{64} << 10;

  std::string bytes_;
  nlohmann::json views_ = nlohmann::json::array(), accessors_ = nlohmann::json::array();
};

// A file with one node of one primitive, whose positions count from `translation`; `more` is added
// to the JSON. FAILED_PRECONDITION (EXPORT_OUT_OF_RANGE) beyond 4 GiB.
absl::StatusOr<std::string> EncodeGlbFile(GlbBuffer buffer, const nlohmann::json& primitive,
                                          const std::array<double, 3>& translation,
                                          const nlohmann::json& more);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_GLB_FILE_H_
