// NumPy .npy arrays (versions 1 and 2, C order, little-endian f2 f4 f8 i4 i8 u1 u2).
#ifndef LITAGS_ENGINE_IO_NPY_H_
#define LITAGS_ENGINE_IO_NPY_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace litags {

enum class NpyType { kFloat16, kFloat32, kFloat64, kInt32, kInt64, kUInt8, kUInt16 };

struct NpyArray {
  NpyType type = NpyType::kFloat32;
  std::vector<int64_t> shape;  // empty: a scalar
  std::vector<uint8_t> bytes;  // row-major

  int64_t size() const;  // elements
  // All elements converted to one type.
  std::vector<float> ToFloats() const;
  std::vector<double> ToDoubles() const;
};

// INVALID_ARGUMENT: NOT_A_NPY, NPY_UNSUPPORTED (other types, Fortran order), NPY_TRUNCATED.
absl::StatusOr<NpyArray> DecodeNpy(std::string_view bytes, std::string_view field);
// Type and shape alone, of a file's first bytes; its elements begin at `data`.
absl::StatusOr<NpyArray> DecodeNpyHeader(std::string_view bytes, std::string_view field,
                                         size_t* data);
// Of 1 GiB at most.
absl::StatusOr<NpyArray> ReadNpy(const std::string& path, std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_NPY_H_
