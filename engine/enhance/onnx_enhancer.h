// An enhancer that is a network in an ONNX file of the user's.
#ifndef LITAGS_ENGINE_ENHANCE_ONNX_ENHANCER_H_
#define LITAGS_ENGINE_ENHANCE_ONNX_ENHANCER_H_

#include <string>

#include "absl/status/statusor.h"
#include "engine/enhance/enhance.h"
#include "engine/onnx/onnx_net.h"

namespace litags {

struct OnnxEnhancerOptions {
  std::string name;  // in tables: letters, digits, '.', '_' and '-'
  std::string path;
  OnnxPhotoOptions input;
  std::string output;  // name in the graph; empty: the last one
  double scale = 1;    // value of white in the output: 1 or 255
  std::string text;    // what these were parsed from

  absl::Status Validate() const;
};

// Parses "NAME=FILE.onnx" with any of ",size=WxH", ",multiple=N", ",mean=R:G:B", ",std=R:G:B",
// ",output=NAME", ",white=255" behind it (a file name with a comma is not possible).
// INVALID_ARGUMENT naming the part that is wrong.
absl::StatusOr<OnnxEnhancerOptions> ParseOnnxEnhancer(const std::string& text);

// The network takes [1, 3, H, W] and gives the same, RGB; the result is resized to the photo. Its
// errors are those of OnnxNet. Not thread-safe.
absl::StatusOr<Enhancer> MakeOnnxEnhancer(const OnnxEnhancerOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_ENHANCE_ONNX_ENHANCER_H_
