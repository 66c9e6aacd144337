#include "engine/depth/depth_provider.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/core/quantile.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/sparse_model.h"

namespace litags {
namespace {

// Neighbours that differ by more are two surfaces: of depth where that is the distance, else of
// what the middle half of a map spans. In the sample capture's truth the latter finds 95 % of the
// outlines that the former does. Choice
constexpr float kEdge = 0.05f;

// Known pixels: depth as it is, confidence 1; unknown ones: 0 and 0.
DepthMap SplitKnown(Planes depth) {
  DepthMap map;
  map.confidence = Planes(1, depth.height, depth.width);
  for (size_t i = 0; i < depth.data.size(); ++i) {
    const bool known = std::isfinite(depth.data[i]) && depth.data[i] != 0;
    map.confidence.data[i] = known ? 1.0f : 0.0f;
    if (!known) depth.data[i] = 0;
  }
  map.depth = std::move(depth);
  return map;
}

// Why nothing can be learnt from a map; empty: it can.
std::string WhyUseless(const DepthMap& map) {
  float least = INFINITY, most = -INFINITY;
  for (size_t i = 0; i < map.depth.data.size(); ++i) {
    if (map.confidence.data[i] == 0) continue;
    least = std::min(least, map.depth.data[i]);
    most = std::max(most, map.depth.data[i]);
  }
  if (least > most) return "no pixel has a depth (all are 0, not finite or too large)";
  return least == most ? absl::StrCat("every pixel has depth ", least) : "";
}

// Mean over the known pixels under each new one; known if at least half of them are.
DepthMap AverageKnown(const DepthMap& map, int width, int height) {
  DepthMap out{AverageDown(map.depth, width, height), AverageDown(map.confidence, width, height)};
  for (size_t i = 0; i < out.depth.data.size(); ++i) {
    float& share = out.confidence.data[i];
    const bool known = share >= 0.5f;
    out.depth.data[i] = known ? out.depth.data[i] / share : 0.0f;
    share = known ? 1.0f : 0.0f;
  }
  return out;
}

// Between which pixels of a row or column of `from` the pixels of one of `to` lie.
struct Between {
  int first, second;
  float at;  // from the first's centre, [0, 1]

  int Nearest() const { return at < 0.5f ? first : second; }
  float Mix(const float* line) const { return line[first] + at * (line[second] - line[first]); }
};

std::vector<Between> Betweens(int from, int to) {
  std::vector<Between> out(to);
  for (int i = 0; i < to; ++i) {
    const float p = std::clamp((i + 0.5f) * from / to - 0.5f, 0.0f, float(from - 1));
    const int first = static_cast<int>(p);
    out[i] = {first, std::min(first + 1, from - 1), p - first};
  }
  return out;
}

// The least and the largest of the four pixels between which one of a larger plane lies.
std::pair<float, float> LeastAndMost(const Planes& plane, const Between& row,
                                     const Between& column) {
  return std::minmax({plane.at(0, row.first, column.first), plane.at(0, row.first, column.second),
                      plane.at(0, row.second, column.first),
                      plane.at(0, row.second, column.second)});
}

// Whether those four are known and of one surface.
bool AreOneSurface(const DepthMap& map, const Between& row, const Between& column) {
  const auto [least, most] = LeastAndMost(map.depth, row, column);
  if (!map.edge.has_value()) return least > 0 && most <= (1 + kEdge) * least;
  const bool known = map.confidence.empty() || LeastAndMost(map.confidence, row, column).first > 0;
  return known && most - least <= *map.edge;
}

class FolderDepthProvider : public DepthProvider {
 public:
  FolderDepthProvider(std::string folder, std::vector<std::string>* notes)
      : folder_(std::move(folder)), notes_(notes) {}

  absl::StatusOr<std::vector<std::optional<DepthMap>>> Maps(absl::Span<const PosedPhoto> photos,
                                                            const CancelToken& cancel,
                                                            DepthProgress progress) override {
    std::vector<std::optional<DepthMap>> maps;
    std::vector<std::string> useless;
    for (const PosedPhoto& p : photos) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      LITAGS_ASSIGN_OR_RETURN(std::optional<DepthMap> map, Read(p, &useless));
      maps.push_back(std::move(map));
      progress(static_cast<int>(maps.size()), static_cast<int>(photos.size()));
    }
    if (notes_ != nullptr && !useless.empty()) {
      const bool one = useless.size() == 1;
      notes_->push_back(absl::StrCat(Counted(useless.size(), "depth map"),
                                     one ? " is not used: " : " are not used, such as ",
                                     useless.front()));
    }
    return maps;
  }

 private:
  absl::StatusOr<std::optional<DepthMap>> Read(const PosedPhoto& posed,
                                               std::vector<std::string>* useless) const {
    const Photo& photo = *posed.photo;
    const std::string path = FindDepthMap(folder_, posed.view->name);
    if (path.empty()) return std::nullopt;
    const std::string field = absl::StrCat("depth/", BaseName(path));
    absl::StatusOr<Planes> plane = ReadDepthMap(path, field);
    if (const auto detail = GetErrorDetail(plane.status());
        detail && detail->reason == "NOT_FINITE") {
      useless->emplace_back(plane.status().message());
      return std::nullopt;
    }
    LITAGS_RETURN_IF_ERROR(plane.status());
    DepthMap map = SplitKnown(*std::move(plane));
    if (posed.distortion != nullptr) {
      for (Planes* p : {&map.depth, &map.confidence}) {
        LITAGS_ASSIGN_OR_RETURN(*p, UndistortNearest(*p, posed.view->camera, *posed.distortion));
      }
    }
    LITAGS_RETURN_IF_ERROR(
        CheckDepthShape(map.depth.width, map.depth.height, photo.width, photo.height, field));
    if (map.depth.width > photo.width || map.depth.height > photo.height) {
      try {
        map = AverageKnown(map, photo.width, photo.height);
      } catch (const cv::Exception& e) {
        return MakeError(absl::StatusCode::kInternal, "DEPTH_MAP_RESIZE", field,
                         absl::StrCat(field, ": cannot resize: ", e.what()));
      }
    }
    if (const std::string why = WhyUseless(map); !why.empty()) {
      useless->push_back(absl::StrCat(field, ": ", why));
      return std::nullopt;
    }
    const auto& confidence = map.confidence.data;
    if (std::all_of(confidence.begin(), confidence.end(), [](float c) { return c == 1; })) {
      map.confidence = Planes();
    }
    return map;
  }

  const std::string folder_;
  std::vector<std::string>* const notes_;
};

}  // namespace

absl::Status CheckDepthShape(int width, int height, int photo_width, int photo_height,
                             const std::string& field, int orientation) {
  const double skew = double(width) * photo_height / (double(height) * photo_width) - 1;
  if (std::abs(skew) <= 0.01) return absl::OkStatus();
  return InvalidInput(
      "DEPTH_MAP_SIZE", field,
      absl::StrCat(field, ": ", width, "x", height, " px does not fit the ", photo_width, "x",
                   photo_height, " px photo; give maps of the photo's aspect ratio",
                   orientation == 1
                       ? ""
                       : absl::StrCat(", upright: EXIF turns it (orientation ", orientation, ")")));
}

Planes AverageDown(const Planes& plane, int most_width, int most_height) {
  Planes out(1, std::min(plane.height, most_height), std::min(plane.width, most_width));
  const cv::Mat in(plane.height, plane.width, CV_32F, const_cast<float*>(plane.data.data()));
  cv::Mat result(out.height, out.width, CV_32F, out.data.data());
  cv::resize(in, result, result.size(), 0, 0, cv::INTER_AREA);
  return out;
}

float EdgeOf(const DepthMap& map) {
  std::vector<float> known;
  for (size_t i = 0; i < map.depth.data.size(); ++i) {
    if (map.confidence.empty() || map.confidence.data[i] > 0) known.push_back(map.depth.data[i]);
  }
  const float far = QuantileInPlace(known, 0.75), near = QuantileInPlace(known, 0.25);
  return kEdge * (far - near);
}

void ResizeDepth(const DepthMap& map, int width, int height, const PixelRect& crop, int threads,
                 DepthMap* out) {
  out->edge = map.edge;
  out->depth.Reshape(1, crop.height, crop.width);
  if (map.confidence.empty()) {
    out->confidence = Planes();
  } else {
    out->confidence.Reshape(1, crop.height, crop.width);
  }
  const std::vector<Between> columns = Betweens(map.depth.width, width);
  const std::vector<Between> rows = Betweens(map.depth.height, height);
  ParallelFor(threads, crop.height, [&](size_t y, int) {
    const auto row_of = [](const Planes& plane, size_t i) {
      return plane.data.data() + i * plane.width;
    };
    const Between& row = rows[crop.y + y];
    const int nearest = row.Nearest();
    const float *top = row_of(map.depth, row.first), *bottom = row_of(map.depth, row.second);
    const float* known = map.confidence.empty() ? nullptr : row_of(map.confidence, nearest);
    for (int x = 0; x < crop.width; ++x) {
      const Between& column = columns[crop.x + x];
      out->depth.at(0, y, x) =
          AreOneSurface(map, row, column)
              ? column.Mix(top) + row.at * (column.Mix(bottom) - column.Mix(top))
              : map.depth.at(0, nearest, column.Nearest());
      if (known != nullptr) out->confidence.at(0, y, x) = known[column.Nearest()];
    }
  });
}

absl::StatusOr<std::unique_ptr<DepthProvider>> MakeFolderDepthProvider(
    const std::string& folder, std::vector<std::string>* notes) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    return MakeError(
        absl::StatusCode::kNotFound, "DEPTH_FOLDER_MISSING", "depth_dir",
        absl::StrCat("depth folder '", folder, "' does not exist; give a folder of maps or none"));
  }
  return std::make_unique<FolderDepthProvider>(folder, notes);
}

}  // namespace litags
