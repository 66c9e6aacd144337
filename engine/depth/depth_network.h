#ifndef LITAGS_ENGINE_DEPTH_DEPTH_NETWORK_H_
#define LITAGS_ENGINE_DEPTH_DEPTH_NETWORK_H_

#include <array>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace litags {

// A monocular depth network as an ONNX file, the operator's or the user's of a command line: one
// picture [1, 3, height, width] in, one plane out.
struct DepthNetwork {
  std::string path;                                 // empty: there is none
  int width = 384, height = 384;                    // px of its input
  std::array<double, 3> mean = {.485, .456, .406};  // of RGB in [0, 1] (ImageNet)
  std::array<double, 3> std = {.229, .224, .225};
  bool inverse = true;  // gives inverse depth (MiDaS, Depth Anything), else depth (Marigold)

  // From "FILE[,size=518x518][,mean=0.5:0.5:0.5][,std=0.5:0.5:0.5][,output=inverse|depth]".
  // INVALID_ARGUMENT naming `field`. Empty text: no network.
  static absl::StatusOr<DepthNetwork> Parse(std::string_view text, std::string_view field);
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DEPTH_DEPTH_NETWORK_H_
