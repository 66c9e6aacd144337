#include "engine/onnx/onnx_writer.h"

#include "engine/onnx/wire.h"

namespace litags {
namespace {

// Field numbers below are those of onnx.proto.
std::string ValueInfo(const std::string& name, const OnnxWriter::Dims& dims) {
  std::string shape;
  for (const int64_t dim : dims) shape += WireBytes(1, WireNumber(1, dim));
  const std::string tensor = WireNumber(1, 1 /* FLOAT */) + WireBytes(2, shape);
  return WireBytes(1, name) + WireBytes(2, WireBytes(1, tensor));
}

}  // namespace

void OnnxWriter::AddInput(const std::string& name, const Dims& dims) {
  inputs_ += WireBytes(11, ValueInfo(name, dims));
}

void OnnxWriter::AddOutput(const std::string& name, const Dims& dims) {
  outputs_ += WireBytes(12, ValueInfo(name, dims));
}

void OnnxWriter::AddConstant(const std::string& name, const Dims& dims,
                             const std::vector<float>& values) {
  std::string tensor;
  for (const int64_t dim : dims) tensor += WireNumber(1, dim);
  tensor += WireNumber(2, 1 /* FLOAT */) + WireBytes(8, name);
  // raw_data is little-endian, as are the machines this runs on.
  tensor += WireBytes(9, {reinterpret_cast<const char*>(values.data()), 4 * values.size()});
  constants_ += WireBytes(5, tensor);
}

void OnnxWriter::AddNode(const std::string& op, const Names& inputs, const std::string& output,
                         const std::vector<std::pair<std::string, Dims>>& lists,
                         const std::vector<std::pair<std::string, int64_t>>& scalars) {
  std::string node;
  for (const std::string& input : inputs) node += WireBytes(1, input);
  node += WireBytes(2, output) + WireBytes(3, output + "_node") + WireBytes(4, op);
  for (const auto& [name, values] : lists) {
    std::string attribute = WireBytes(1, name);
    for (const int64_t value : values) attribute += WireNumber(8, value);
    node += WireBytes(5, attribute + WireNumber(20, 7 /* INTS */));
  }
  for (const auto& [name, value] : scalars) {
    node += WireBytes(5, WireBytes(1, name) + WireNumber(3, value) + WireNumber(20, 2 /* INT */));
  }
  nodes_ += WireBytes(1, node);
}

std::string OnnxWriter::Bytes() const {
  const std::string graph = nodes_ + WireBytes(2, "test") + constants_ + inputs_ + outputs_;
  return WireNumber(1, 7 /* ir_version */) + WireBytes(7, graph) +
         WireBytes(8, WireBytes(1, "") + WireNumber(2, 11 /* opset */));
}

std::string PointwiseModel(int height, int width, const std::vector<float>& weights,
                           const std::vector<float>& bias) {
  const auto channels = static_cast<int64_t>(bias.size());
  OnnxWriter model;
  model.AddInput("x", {1, 3, height, width});
  model.AddConstant("w", {channels, 3, 1, 1}, weights);
  model.AddConstant("b", {channels}, bias);
  model.AddNode("Conv", {"x", "w", "b"}, "y", {{"kernel_shape", {1, 1}}});
  model.AddOutput("y", {1, channels, height, width});
  return model.Bytes();
}

std::string ScalingModel(int height, int width, int channels, float weight, float bias) {
  std::vector<float> weights(size_t(channels) * 3, 0.0f);
  for (int c = 0; c < channels; ++c) weights[c * 3 + c] = weight;
  return PointwiseModel(height, width, weights, std::vector<float>(channels, bias));
}

std::string SquaredDifferenceModel(int height, int width) {
  OnnxWriter model;
  for (const char* name : {"in0", "in1"}) model.AddInput(name, {1, 3, height, width});
  model.AddNode("Sub", {"in0", "in1"}, "d");
  model.AddNode("Mul", {"d", "d"}, "s");
  model.AddNode("ReduceMean", {"s"}, "y", {{"axes", {1, 2, 3}}}, {{"keepdims", 1}});
  model.AddOutput("y", {1, 1, 1, 1});
  return model.Bytes();
}

}  // namespace litags
