#include "engine/sfm/point_colors.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/io/image_io.h"

namespace litags {
namespace {

using Color = std::array<float, 3>;  // sRGB codes

// Bilinear; beyond the border its pixels are repeated.
Color Sample(const ImageU8& image, double x, double y) {
  x = std::clamp(x - 0.5, 0.0, image.width - 1.0);
  y = std::clamp(y - 0.5, 0.0, image.height - 1.0);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  const double u = x - x0, v = y - y0;
  Color color;
  for (size_t c = 0; c < 3; ++c) {
    const double top = (1 - u) * image.pixel(x0, y0)[c] + u * image.pixel(x1, y0)[c];
    const double bottom = (1 - u) * image.pixel(x0, y1)[c] + u * image.pixel(x1, y1)[c];
    color[c] = static_cast<float>((1 - v) * top + v * bottom);
  }
  return color;
}

struct Mark {
  const TrackElement* seen;
  Color* color;
};

}  // namespace

absl::Status ColorPoints(const std::vector<std::string>& paths, int threads,
                         const CancelToken& cancel, std::vector<SparsePoint>& points) {
  std::vector<std::vector<Color>> colors(points.size());  // of each track element
  std::vector<std::vector<Mark>> marks(paths.size());
  for (size_t p = 0; p < points.size(); ++p) {
    colors[p].resize(points[p].track.size());
    for (size_t i = 0; i < colors[p].size(); ++i) {
      marks[points[p].track[i].view].push_back({&points[p].track[i], &colors[p][i]});
    }
  }
  std::vector<absl::Status> statuses(paths.size());
  ParallelFor(threads, paths.size(), [&](size_t view, int) {
    statuses[view] = cancel.Check();
    if (!statuses[view].ok() || marks[view].empty()) return;
    const absl::StatusOr<ImageU8> image = ReadImage(paths[view], "prepared photo");
    statuses[view] = image.status();
    if (!image.ok()) return;
    for (const Mark& mark : marks[view]) *mark.color = Sample(*image, mark.seen->x, mark.seen->y);
  });
  for (absl::Status& status : statuses) LITAGS_RETURN_IF_ERROR(std::move(status));
  for (size_t p = 0; p < points.size(); ++p) {
    for (size_t c = 0; c < 3; ++c) {
      double sum = 0;
      for (const Color& color : colors[p]) sum += color[c];
      points[p].rgb[c] =
          static_cast<uint8_t>(std::lround(sum / std::max<size_t>(1, colors[p].size())));
    }
  }
  return absl::OkStatus();
}

}  // namespace litags
