#include "engine/onnx/onnx_writer.h"

namespace litags {
namespace {

// Protobuf's wire format. Field numbers below are those of onnx.proto.
std::string Varint(uint64_t value) {
  std::string out;
  for (; value >= 0x80; value >>= 7) out += static_cast<char>(value | 0x80);
  return out + static_cast<char>(value);
}

std::string Number(int field, int64_t value) {
  return Varint(field << 3) + Varint(static_cast<uint64_t>(value));
}

std::string Bytes(int field, const std::string& bytes) {
  return Varint(field << 3 | 2) + Varint(bytes.size()) + bytes;
}

std::string ValueInfo(const std::string& name, const OnnxWriter::Dims& dims) {
  std::string shape;
  for (const int64_t dim : dims) shape += Bytes(1, Number(1, dim));
  const std::string tensor = Number(1, 1 /* FLOAT */) + Bytes(2, shape);
  return Bytes(1, name) + Bytes(2, Bytes(1, tensor));
}

}  // namespace

void OnnxWriter::AddInput(const std::string& name, const Dims& dims) {
  inputs_ += litags::Bytes(11, ValueInfo(name, dims));
}

void OnnxWriter::AddOutput(const std::string& name, const Dims& dims) {
  outputs_ += litags::Bytes(12, ValueInfo(name, dims));
}

void OnnxWriter::AddConstant(const std::string& name, const Dims& dims,
                             const std::vector<float>& values) {
  std::string tensor;
  for (const int64_t dim : dims) tensor += Number(1, dim);
  tensor += Number(2, 1 /* FLOAT */) + litags::Bytes(8, name);
  // raw_data is little-endian, as are the machines this runs on.
  tensor += litags::Bytes(9, {reinterpret_cast<const char*>(values.data()), 4 * values.size()});
  constants_ += litags::Bytes(5, tensor);
}

void OnnxWriter::AddNode(const std::string& op, const Names& inputs, const std::string& output,
                         const std::vector<std::pair<std::string, Dims>>& lists,
                         const std::vector<std::pair<std::string, int64_t>>& scalars) {
  std::string node;
  for (const std::string& input : inputs) node += litags::Bytes(1, input);
  node += litags::Bytes(2, output) + litags::Bytes(3, output + "_node") + litags::Bytes(4, op);
  for (const auto& [name, values] : lists) {
    std::string attribute = litags::Bytes(1, name);
    for (const int64_t value : values) attribute += Number(8, value);
    node += litags::Bytes(5, attribute + Number(20, 7 /* INTS */));
  }
  for (const auto& [name, value] : scalars) {
    node += litags::Bytes(5, litags::Bytes(1, name) + Number(3, value) + Number(20, 2 /* INT */));
  }
  nodes_ += litags::Bytes(1, node);
}

std::string OnnxWriter::Bytes() const {
  const std::string graph = nodes_ + litags::Bytes(2, "test") + constants_ + inputs_ + outputs_;
  return Number(1, 7 /* ir_version */) + litags::Bytes(7, graph) +
         litags::Bytes(8, litags::Bytes(1, "") + Number(2, 11 /* opset */));
}

}  // namespace litags
