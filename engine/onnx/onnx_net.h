// Networks from ONNX files that the user brings, run on the CPU by OpenCV.
#ifndef LITAGS_ENGINE_ONNX_ONNX_NET_H_
#define LITAGS_ENGINE_ONNX_ONNX_NET_H_

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

// One input of a network: planes [C, H, W] become a tensor [1, C, H, W].
struct OnnxInput {
  std::string name;  // in the graph; empty: the first input
  Planes planes;
};

class OnnxNet {
 public:
  // NOT_FOUND if there is no such file; INVALID_ARGUMENT (ONNX_UNREADABLE) if OpenCV cannot read
  // it, for instance because of an operator it lacks. `field` names the option that gave the path.
  static absl::StatusOr<OnnxNet> Load(const std::string& path, std::string_view field);

  OnnxNet(OnnxNet&&) noexcept;
  OnnxNet& operator=(OnnxNet&&) noexcept;
  ~OnnxNet();

  // The output called `output` (empty: the last one). Its last two dimensions are H and W, the one
  // before, if any, C; anything in front of that must be 1. A vector becomes [1, 1, W].
  // INVALID_ARGUMENT: ONNX_RUN (wrong inputs or sizes, or an operator that OpenCV cannot run),
  // ONNX_OUTPUT (another shape, or values that are not finite). Not thread-safe.
  absl::StatusOr<Planes> Run(const std::vector<OnnxInput>& inputs, const std::string& output = "");

 private:
  struct Impl;
  explicit OnnxNet(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// How a photo becomes a network's input: resized, then (code / 255 - mean) / std per channel RGB.
struct OnnxPhotoOptions {
  int width = 0, height = 0;  // px; 0: the photo's own, rounded up to `multiple`
  int multiple = 1;           // sides are multiples of this, as networks that halve them need
  std::array<double, 3> mean = {0, 0, 0};
  std::array<double, 3> std = {1, 1, 1};  // 1/255 to feed codes 0..255

  // INVALID_ARGUMENT naming `field` for sides outside [0, 8192], a multiple outside [1, 1024], or a
  // std that is not positive and finite.
  absl::Status Validate(std::string_view field) const;
};

// A number per channel as in options, "R:G:B"; false if it is not three finite numbers.
bool ParsePerChannel(const std::string& text, std::array<double, 3>* values);

// [3, H, W], by area averaging where it shrinks and bilinearly where it grows.
Planes OnnxPhoto(const ImageU8& photo, const OnnxPhotoOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_ONNX_ONNX_NET_H_
