// Reads and writes Protobuf's wire format, as far as ONNX files need it: a message is a list of
// fields. It saves the engine the Protobuf library.
#ifndef LITAGS_ENGINE_ONNX_WIRE_H_
#define LITAGS_ENGINE_ONNX_WIRE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace litags {

// One field of a message. The views are valid as long as the message's bytes.
struct WireField {
  int number = 0;
  std::string_view whole;  // key, length and value, as they stand in the message
  std::string_view value;  // of a string or a message; empty for a number
};

// The fields of a message in their order; nullopt if the bytes are not a whole message.
std::optional<std::vector<WireField>> ReadWireFields(std::string_view message);

// A field as bytes that can be appended to a message.
std::string WireNumber(int number, int64_t value);
std::string WireBytes(int number, std::string_view value);

}  // namespace litags

#endif  // LITAGS_ENGINE_ONNX_WIRE_H_
