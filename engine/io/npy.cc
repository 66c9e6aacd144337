#include "engine/io/npy.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/check.h"
#include "engine/io/byte_reader.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";

struct TypeInfo {
  NpyType type;
  const char* descr;
  size_t size;
};
constexpr TypeInfo kTypes[] = {{NpyType::kFloat16, "<f2", 2}, {NpyType::kFloat32, "<f4", 4},
                               {NpyType::kFloat64, "<f8", 8}, {NpyType::kInt32, "<i4", 4},
                               {NpyType::kInt64, "<i8", 8},   {NpyType::kUInt8, "|u1", 1},
                               {NpyType::kUInt16, "<u2", 2}};

const TypeInfo& InfoOf(NpyType type) {
  for (const TypeInfo& info : kTypes) {
    if (info.type == type) return info;
  }
  LITAGS_CHECK(false);
}

absl::Status Unsupported(std::string_view field, std::string_view what) {
  return InvalidField("NPY_UNSUPPORTED", field,
                      absl::StrCat(Absl(what),
                                   "; save a C-order array of float16, float32, float64, int32, "
                                   "int64, uint8 or uint16"));
}

absl::Status Truncated(std::string_view field) {
  return InvalidField("NPY_TRUNCATED", field,
                      "the file is shorter than its header says; send all of it");
}

// The text after 'key': in the header, a Python dict literal; empty if the key is missing.
std::string_view ValueOf(std::string_view header, std::string_view key) {
  const std::string quoted = absl::StrCat("'", Absl(key), "'");
  size_t at = header.find(quoted);
  if (at == std::string_view::npos) return {};
  at = header.find(':', at + quoted.size());
  if (at == std::string_view::npos) return {};
  at = header.find_first_not_of(' ', at + 1);
  return at == std::string_view::npos ? std::string_view() : header.substr(at);
}

// "(480, 270)" to numbers; nullopt if malformed or if the product overflows.
std::optional<std::vector<int64_t>> ParseShape(std::string_view text) {
  const size_t close = text.find(')');
  if (!text.starts_with('(') || close == std::string_view::npos) return std::nullopt;
  std::vector<int64_t> shape;
  int64_t product = 1;
  for (absl::string_view part :
       absl::StrSplit(Absl(text.substr(1, close - 1)), ',', absl::SkipWhitespace())) {
    int64_t side = 0;
    if (!absl::SimpleAtoi(part, &side) || side < 0 ||
        __builtin_mul_overflow(product, side, &product)) {
      return std::nullopt;
    }
    shape.push_back(side);
  }
  return shape;
}

// IEEE 754's binary16.
struct Half {
  uint16_t bits;

  template <typename To>
  explicit operator To() const {
    constexpr int kMantissaBits = 10, kBias = 15, kSpecial = 31;
    const int exponent = bits >> kMantissaBits & kSpecial, mantissa = bits & 0x3FF;
    const To sign = bits >> 15 != 0 ? -1 : 1;
    if (exponent == kSpecial) {
      return mantissa != 0 ? std::numeric_limits<To>::quiet_NaN()
                           : sign * std::numeric_limits<To>::infinity();
    }
    const int whole = exponent == 0 ? mantissa : mantissa | 1 << kMantissaBits;
    return sign * std::ldexp(static_cast<To>(whole), std::max(exponent, 1) - kBias - kMantissaBits);
  }
};

template <typename To>
std::vector<To> Convert(const NpyArray& array) {
  const auto from = [&]<typename From>(From) {
    std::vector<To> out(array.bytes.size() / sizeof(From));
    for (size_t i = 0; i < out.size(); ++i) {
      From value;
      std::memcpy(&value, array.bytes.data() + i * sizeof(From), sizeof(From));
      out[i] = static_cast<To>(value);
    }
    return out;
  };
  switch (array.type) {
    case NpyType::kFloat16:
      return from(Half{});
    case NpyType::kFloat32:
      return from(float{});
    case NpyType::kFloat64:
      return from(double{});
    case NpyType::kInt32:
      return from(int32_t{});
    case NpyType::kInt64:
      return from(int64_t{});
    case NpyType::kUInt8:
      return from(uint8_t{});
    case NpyType::kUInt16:
      return from(uint16_t{});
  }
  LITAGS_CHECK(false);
}

}  // namespace

int64_t NpyArray::size() const {
  int64_t product = 1;
  for (int64_t side : shape) product *= side;
  return product;
}

std::vector<float> NpyArray::ToFloats() const { return Convert<float>(*this); }
std::vector<double> NpyArray::ToDoubles() const { return Convert<double>(*this); }

absl::StatusOr<NpyArray> DecodeNpyHeader(std::string_view bytes, std::string_view field,
                                         size_t* data) {
  ByteReader reader(bytes);
  std::string_view magic, header;
  uint8_t major = 0, minor = 0;
  if (!reader.ReadBytes(kMagic.size(), &magic) || magic != kMagic) {
    return InvalidField("NOT_A_NPY", field, "not a NumPy .npy file");
  }
  if (!reader.Read(&major) || !reader.Read(&minor)) return Truncated(field);
  uint16_t short_size = 0;
  uint32_t size = 0;
  if (major == 1) {
    if (!reader.Read(&short_size)) return Truncated(field);
    size = short_size;
  } else if (major == 2) {
    if (!reader.Read(&size)) return Truncated(field);
  } else {
    return Unsupported(field, absl::StrCat("file version ", major, ".", minor));
  }
  if (!reader.ReadBytes(size, &header)) return Truncated(field);

  const TypeInfo* type = nullptr;
  const std::string_view descr = ValueOf(header, "descr");
  for (const TypeInfo& info : kTypes) {
    if (descr.starts_with(absl::StrCat("'", info.descr, "'"))) type = &info;
  }
  if (type == nullptr) {
    return Unsupported(field, absl::StrCat("element type ", Absl(descr.substr(0, 8))));
  }
  if (!ValueOf(header, "fortran_order").starts_with("False")) {
    return Unsupported(field, "the array is not in C order");
  }
  std::optional<std::vector<int64_t>> shape = ParseShape(ValueOf(header, "shape"));
  if (!shape.has_value()) return Unsupported(field, "the shape cannot be read");

  *data = reader.position();
  return NpyArray{type->type, *std::move(shape), {}};
}

absl::StatusOr<NpyArray> DecodeNpy(std::string_view bytes, std::string_view field) {
  size_t begin = 0;
  LITAGS_ASSIGN_OR_RETURN(NpyArray array, DecodeNpyHeader(bytes, field, &begin));
  ByteReader reader(bytes.substr(begin));
  const uint64_t count = static_cast<uint64_t>(array.size());
  const size_t size = InfoOf(array.type).size;
  if (!reader.CanHold(count, size)) return Truncated(field);
  std::string_view data;
  reader.ReadBytes(count * size, &data);
  array.bytes.assign(data.begin(), data.end());
  return array;
}

absl::StatusOr<NpyArray> ReadNpy(const std::string& path, std::string_view field) {
  constexpr int64_t kMaxBytes = int64_t{1} << 30;
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, kMaxBytes));
  return DecodeNpy(bytes, field.empty() ? std::string_view(path) : field);
}

}  // namespace litags
