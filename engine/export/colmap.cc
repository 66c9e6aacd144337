// The photos' cameras and the Gaussians' centres as COLMAP's model.
#include <algorithm>

#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/export/zip.h"
#include "engine/io/colmap_io.h"

namespace litags {

absl::StatusOr<std::string> EncodeColmap(const ViewerScene& scene) {
  SparseModel model;
  const std::array<double, 3>& o = scene.origin;
  for (const View& view : scene.views) model.views.push_back({view.name, view.camera.Moved(o)});
  std::sort(model.views.begin(), model.views.end(),
            [](const View& a, const View& b) { return a.name < b.name; });
  model.distortions.resize(model.views.size());
  for (size_t i = 0; i < scene.splats.size(); ++i) {
    SparsePoint& point = model.points.emplace_back();
    point.error = -1;
    for (int k = 0; k < 3; ++k) {
      point.xyz[k] = scene.splats.at(i, kMean + k) + o[k];
      point.rgb[k] = PackByte(255 * (0.5 + kSh0 * scene.splats.at(i, kShDc + k)));
    }
  }
  auto files = EncodeColmapModel(model);
  if (!files.ok()) return files.status();
  return StoredZip({{"sparse/0/cameras.bin", std::move(files->cameras)},
                    {"sparse/0/images.bin", std::move(files->images)},
                    {"sparse/0/points3D.bin", std::move(files->points)}});
}

}  // namespace litags
