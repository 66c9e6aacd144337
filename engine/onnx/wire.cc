#include "engine/onnx/wire.h"

namespace litags {
namespace {

constexpr int kVarint = 0, kFixed64 = 1, kLengthDelimited = 2, kFixed32 = 5;
constexpr uint64_t kMaxFieldNumber = (1u << 29) - 1;

// Takes a number from the front of `bytes`.
bool TakeVarint(std::string_view* bytes, uint64_t* value) {
  *value = 0;
  for (int shift = 0; shift < 64 && !bytes->empty(); shift += 7) {
    const auto byte = static_cast<uint8_t>(bytes->front());
    bytes->remove_prefix(1);
    *value |= uint64_t{byte & 0x7fu} << shift;
    if (byte < 0x80) return true;
  }
  return false;
}

std::string Varint(uint64_t value) {
  std::string out;
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  return out + static_cast<char>(value);
}

}  // namespace

std::optional<std::vector<WireField>> ReadWireFields(std::string_view message) {
  std::vector<WireField> fields;
  std::string_view rest = message;
  while (!rest.empty()) {
    const std::string_view begin = rest;
    uint64_t key = 0, length = 0;
    if (!TakeVarint(&rest, &key)) return std::nullopt;
    if ((key >> 3) == 0 || (key >> 3) > kMaxFieldNumber) return std::nullopt;
    switch (key & 7) {
      case kVarint: {
        uint64_t number = 0;
        if (!TakeVarint(&rest, &number)) return std::nullopt;
        break;
      }
      case kFixed64:
        length = 8;
        break;
      case kFixed32:
        length = 4;
        break;
      case kLengthDelimited:
        if (!TakeVarint(&rest, &length)) return std::nullopt;
        break;
      default:  // groups, which ONNX does not have
        return std::nullopt;
    }
    if (length > rest.size()) return std::nullopt;
    WireField field;
    field.number = static_cast<int>(key >> 3);
    if ((key & 7) == kLengthDelimited) field.value = rest.substr(0, length);
    rest.remove_prefix(length);
    field.whole = begin.substr(0, begin.size() - rest.size());
    fields.push_back(field);
  }
  return fields;
}

std::string WireNumber(int number, int64_t value) {
  return Varint(uint64_t(number) << 3 | kVarint) + Varint(static_cast<uint64_t>(value));
}

std::string WireBytes(int number, std::string_view value) {
  std::string field = Varint(uint64_t(number) << 3 | kLengthDelimited) + Varint(value.size());
  return field.append(value);
}

}  // namespace litags
