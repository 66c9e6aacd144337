// LPIPS, the learned perceptual distance (Zhang et al., CVPR 2018), by a network that the user
// brings.
#ifndef LITAGS_ENGINE_EVAL_LPIPS_H_
#define LITAGS_ENGINE_EVAL_LPIPS_H_

#include <string>

#include "absl/status/statusor.h"
#include "engine/core/image.h"
#include "engine/onnx/onnx_net.h"

namespace litags {

class Lpips {
 public:
  // An ONNX file with inputs in0 and in1, [1, 3, H, W] RGB in [-1, 1], and one number as output:
  // the `forward` of the authors' package, see docs/evaluation.md. Errors of OnnxNet::Load, with
  // field "--lpips".
  static absl::StatusOr<Lpips> Load(const std::string& path);

  // 0 for equal pictures. INVALID_ARGUMENT for sizes that differ, a network that cannot be run on
  // them, or one that gives more than one number. Not thread-safe.
  absl::StatusOr<double> Distance(const ImageU8& a, const ImageU8& b);

 private:
  explicit Lpips(OnnxNet net) : net_(std::move(net)) {}
  OnnxNet net_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_EVAL_LPIPS_H_
