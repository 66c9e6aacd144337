// Depth by a monocular network that the user brings as an ONNX file.
#ifndef LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_
#define LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/depth/depth_provider.h"
#include "engine/onnx/onnx_net.h"

namespace litags {

struct NetworkDepthOptions {
  std::string path;        // ONNX file: one picture [1, 3, h, w] in, one plane out
  OnnxPhotoOptions input;  // its size and normalisation
  // The network gives inverse depth up to scale and offset (MiDaS, Depth Anything), not depth
  // (Marigold).
  bool inverse = true;
};

// Loads the network, which sees the photos' targets, or the photos where there are none. An inverse
// map is brought to [0, 1] between its 2nd and 98th percentile and becomes 1 / (map + 0.1): the
// offset that turns it into depth is not known, so near and far are taken to differ by 11 at most.
// Choice. A map where all is alike (a textureless photo) is nullopt. Errors of OnnxNet, and
// DEPTH_NETWORK_OUTPUT for more than one plane; `field` names the option that gave the path.
absl::StatusOr<std::unique_ptr<DepthProvider>> MakeNetworkDepthProvider(
    const NetworkDepthOptions& options, std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_
