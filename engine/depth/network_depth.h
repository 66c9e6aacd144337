// Depth by a monocular network that the user brings as an ONNX file.
#ifndef LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_
#define LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_

#include <memory>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/depth/depth_network.h"
#include "engine/depth/depth_provider.h"

namespace litags {

// Loads the network, which sees the photos' targets, or the photos where there are none. An inverse
// map is brought to [0, 1] between its 2nd and 98th percentile and becomes 1 / (map + 0.1): the
// offset that turns it into depth is not known, so near and far are taken to differ by 11 at most.
// Choice. A map where all is alike (a textureless photo) is nullopt. Errors of OnnxNet, and
// DEPTH_NETWORK_OUTPUT for more than one plane; `field` names the option that gave the path.
absl::StatusOr<std::unique_ptr<DepthProvider>> MakeNetworkDepthProvider(const DepthNetwork& network,
                                                                        std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_DEPTH_NETWORK_DEPTH_H_
