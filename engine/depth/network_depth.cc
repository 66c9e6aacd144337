#include "engine/depth/network_depth.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"
#include "engine/onnx/onnx_net.h"

namespace litags {
namespace {

constexpr double kTail = 0.02;            // of the values, at either end, may be wild
constexpr float kFarthestInverse = 0.1f;  // added to inverse depth in [0, 1]

// Makes the network's values depth up to scale and offset; false if they are all alike.
bool ToDepth(bool inverse, Planes* map) {
  std::vector<float> values = map->data;
  const float least = QuantileInPlace(values, kTail), most = QuantileInPlace(values, 1 - kTail);
  if (!(most > least) || !std::isfinite(most - least)) return false;
  for (float& v : map->data) {
    v = std::clamp((v - least) / (most - least), 0.0f, 1.0f);
    if (inverse) v = 1 / (v + kFarthestInverse);
  }
  return true;
}

OnnxPhotoOptions InputOf(const DepthNetwork& network) {
  OnnxPhotoOptions input;
  input.width = network.width;
  input.height = network.height;
  input.mean = network.mean;
  input.std = network.std;
  return input;
}

class NetworkDepthProvider : public DepthProvider {
 public:
  NetworkDepthProvider(OnnxNet net, const DepthNetwork& network, std::string_view field)
      : net_(std::move(net)), network_(network), field_(field) {}

  absl::StatusOr<std::vector<std::optional<DepthMap>>> Maps(absl::Span<const PosedPhoto> photos,
                                                            const CancelToken& cancel,
                                                            DepthProgress progress) override {
    std::vector<std::optional<DepthMap>> maps;
    for (const PosedPhoto& p : photos) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      LITAGS_ASSIGN_OR_RETURN(Planes depth, Run(p));
      maps.emplace_back();
      if (!depth.empty()) maps.back() = DepthMap{std::move(depth), Planes()};
      progress(static_cast<int>(maps.size()), static_cast<int>(photos.size()));
    }
    return maps;
  }

 private:
  // Of the network's size, at most the photo's; empty if the network sees nothing.
  absl::StatusOr<Planes> Run(const PosedPhoto& p) {
    const Photo& photo = p.target != nullptr ? *p.target : *p.photo;
    try {
      LITAGS_ASSIGN_OR_RETURN(Planes map,
                              net_.Run({{"", OnnxPhoto(PhotoToU8(photo), InputOf(network_))}}));
      if (map.channels != 1) {
        return InvalidInput("DEPTH_NETWORK_OUTPUT", field_,
                            absl::StrCat(field_, ": ", network_.path, " gives ", map.channels,
                                         " planes; a depth network gives one"));
      }
      if (!ToDepth(network_.inverse, &map)) return Planes();
      return AverageDown(map, photo.width, photo.height);
    } catch (const cv::Exception& e) {
      return MakeError(absl::StatusCode::kInternal, "DEPTH_NETWORK_RESIZE", field_,
                       absl::StrCat(field_, ": cannot resize: ", e.what()));
    }
  }

  OnnxNet net_;
  const DepthNetwork network_;
  const std::string field_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<DepthProvider>> MakeNetworkDepthProvider(const DepthNetwork& network,
                                                                        std::string_view field) {
  LITAGS_RETURN_IF_ERROR(InputOf(network).Validate(field));
  LITAGS_ASSIGN_OR_RETURN(OnnxNet net, OnnxNet::Load(network.path, field));
  return std::make_unique<NetworkDepthProvider>(std::move(net), network, field);
}

}  // namespace litags
