// Writes small ONNX files, so that tests can make the network they need.
#ifndef LITAGS_ENGINE_ONNX_ONNX_WRITER_H_
#define LITAGS_ENGINE_ONNX_ONNX_WRITER_H_

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace litags {

// A model of opset 11 with float tensors and one default domain. Only what tests use.
class OnnxWriter {
 public:
  using Dims = std::vector<int64_t>;
  using Names = std::vector<std::string>;

  void AddInput(const std::string& name, const Dims& dims);
  void AddOutput(const std::string& name, const Dims& dims);
  // A constant tensor; `values` has the product of `dims` elements.
  void AddConstant(const std::string& name, const Dims& dims, const std::vector<float>& values);
  // An operator; attributes are lists of integers, or one where `scalars` names them.
  void AddNode(const std::string& op, const Names& inputs, const std::string& output,
               const std::vector<std::pair<std::string, Dims>>& lists = {},
               const std::vector<std::pair<std::string, int64_t>>& scalars = {});

  std::string Bytes() const;

 private:
  std::string nodes_, constants_, inputs_, outputs_;
};

// y = weights x + bias at every pixel, of three channels: `weights` has three for each of `bias`.
std::string PointwiseModel(int height, int width, const std::vector<float>& weights,
                           const std::vector<float>& bias);

// y = weight x + bias, of `channels` channels: the first ones of three.
std::string ScalingModel(int height, int width, int channels, float weight, float bias);

// The mean squared difference of two pictures, which stands in for LPIPS.
std::string SquaredDifferenceModel(int height, int width);

}  // namespace litags

#endif  // LITAGS_ENGINE_ONNX_ONNX_WRITER_H_
