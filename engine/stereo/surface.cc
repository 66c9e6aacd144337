#include "engine/stereo/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/pixel_at.h"
#include "engine/stereo/correlate.h"
#include "engine/stereo/semi_global.h"

namespace litags {
namespace {

constexpr int kWindowRadius = 2;    // px, of the correlated windows
constexpr int kBestSources = 2;     // a pixel is judged by the best; from others it may be occluded
constexpr double kCostScale = 250;  // of 1 - correlation, so that it fits a byte

// Depths tried: a step of so much in the source that sees it farthest, larger where these would be
// more than the most.
constexpr double kStepPx = 1;
constexpr int kMinLabels = 16, kMaxLabels = 192;

// Of semi-global matching, in units of correlation.
constexpr double kStepPenalty = 0.1, kJumpPenalty = 2;
constexpr double kEdgeContrast = 0.1;  // of MatchImage::gray, halves kJumpPenalty
constexpr double kAnchorWeight = 0.5;  // cost of leaving the depth of a sparse point at its pixel

// 1 / depth of label i is first + i * step.
struct Labels {
  double first = 0, step = 0;
  int count = 0;
};

// How far, px, a point of the reference moves in the source between two inverse depths; 0 if the
// source does not have it in front of it at both.
double Travel(const Transfer& t, double x, double y, double from, double to) {
  const std::array<double, 3> p = t.Project(x, y, from), q = t.Project(x, y, to);
  if (!(p[2] > 0 && q[2] > 0)) return 0;
  return std::hypot(q[0] / q[2] - p[0] / p[2], q[1] / q[2] - p[1] / p[2]);
}

// The longest way of the middle and of the points halfway to the corners: where the camera moves
// straight ahead, the middle stays where it is.
double LongestTravel(const Transfer& t, const Camera& camera, double from, double to) {
  double longest = Travel(t, 0.5 * camera.width, 0.5 * camera.height, from, to);
  for (const double x : {0.25, 0.75}) {
    for (const double y : {0.25, 0.75}) {
      longest = std::max(longest, Travel(t, x * camera.width, y * camera.height, from, to));
    }
  }
  return longest;
}

// The sources of one view and what the sweeps over them need.
class Matcher {
 public:
  Matcher(const MatchImage& reference, absl::Span<const MatchImage* const> sources)
      : camera_(reference.camera),
        reference_(reference, kWindowRadius),
        sources_(sources.begin(), sources.end()),
        pixels_(reference.gray.plane_size()),
        fit_(pixels_) {
    for (const MatchImage* source : sources_) transfers_.emplace_back(camera_, source->camera);
    const size_t best = std::clamp<size_t>(sources_.size(), 1, kBestSources);
    best_.assign(best, std::vector<float>(pixels_));
  }

  Labels ChooseLabels(const ViewPlan& plan) const {
    Labels labels;
    labels.first = 1 / plan.far_depth;
    const double last = 1 / plan.near_depth;
    double travel = 0;
    for (const Transfer& t : transfers_) {
      travel = std::max(travel, LongestTravel(t, camera_, labels.first, last));
    }
    labels.count = static_cast<int>(
        std::clamp<double>(std::ceil(travel / kStepPx) + 1, kMinLabels, kMaxLabels));
    labels.step = (last - labels.first) / (labels.count - 1);
    return labels;
  }

  // Correlation of every pixel at its inverse depth: mean of the best sources.
  void Fit(const float* inverse_depth, float* mean) {
    const size_t best = best_.size();
    for (auto& values : best_) std::fill(values.begin(), values.end(), -1.0f);
    for (size_t s = 0; s < sources_.size(); ++s) {
      Correlate(reference_, *sources_[s], transfers_[s], inverse_depth, &scratch_, fit_.data());
      for (size_t k = 0; k < best; ++k) {  // insertion, for all pixels at once
        float* kept = best_[k].data();
        for (size_t i = 0; i < pixels_; ++i) {
          const float better = std::max(kept[i], fit_[i]), worse = std::min(kept[i], fit_[i]);
          kept[i] = better;
          fit_[i] = worse;
        }
      }
    }
    const float share = 1.0f / best;
    for (size_t i = 0; i < pixels_; ++i) {
      float sum = 0;
      for (size_t k = 0; k < best; ++k) sum += best_[k][i];
      mean[i] = sum * share;
    }
  }

  size_t pixels() const { return pixels_; }

 private:
  const Camera& camera_;
  const CorrelationReference reference_;
  const std::vector<const MatchImage*> sources_;
  const size_t pixels_;
  std::vector<Transfer> transfers_;
  std::vector<float> fit_, scratch_;
  std::vector<std::vector<float>> best_;
};

absl::StatusOr<CostVolume> SweepPlanes(Matcher* matcher, const Camera& camera, const Labels& labels,
                                       const CancelToken& cancel) {
  CostVolume volume(camera.width, camera.height, labels.count);
  std::vector<float> inverse_depth(matcher->pixels()), fit(matcher->pixels());
  for (int label = 0; label < labels.count; ++label) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    std::fill(inverse_depth.begin(), inverse_depth.end(),
              static_cast<float>(labels.first + label * labels.step));
    matcher->Fit(inverse_depth.data(), fit.data());
    uint8_t* cost = volume.cost.data() + label;
    for (size_t i = 0; i < fit.size(); ++i) {
      const float worth = std::clamp(fit[i], 0.0f, 1.0f);
      cost[i * volume.labels] = static_cast<uint8_t>((1 - worth) * float(kCostScale) + 0.5f);
    }
  }
  return volume;
}

// Makes depths other than that of a sparse point dear at its pixel.
void AddAnchors(const ViewPlan& plan, const Labels& labels, CostVolume* volume) {
  const double most = kAnchorWeight * kCostScale;
  for (const Anchor& anchor : plan.anchors) {
    const std::optional<PixelIndex> pixel =
        PixelAt(anchor.x, anchor.y, volume->width, volume->height);
    if (!pixel.has_value()) continue;
    const double wanted = (1 / anchor.depth - labels.first) / labels.step;
    if (wanted < 0 || wanted > labels.count - 1) continue;
    uint8_t* cost = volume->at(size_t(pixel->y) * volume->width + pixel->x);
    for (int label = 0; label < labels.count; ++label) {
      const double away = std::max(0.0, std::abs(label - wanted) - 1);
      cost[label] =
          static_cast<uint8_t>(std::min(kCostScale, cost[label] + most * std::min(1.0, away / 2)));
    }
  }
}

// Where the parabola through (-1, left), (0, middle), (1, right) is least, in [-0.5, 0.5].
double ParabolaMinimum(double left, double middle, double right) {
  const double bend = left + right - 2 * middle;
  return bend > 1e-12 ? std::clamp((left - right) / (2 * bend), -0.5, 0.5) : 0.0;
}

void PickLabels(const std::vector<uint16_t>& sums, const CostVolume& volume, const Labels& labels,
                Planes* inverse_depth) {
  for (size_t i = 0; i < inverse_depth->data.size(); ++i) {
    const uint16_t* sum = &sums[i * volume.labels];
    const int label = static_cast<int>(std::min_element(sum, sum + labels.count) - sum);
    double offset = 0;
    if (label > 0 && label + 1 < labels.count) {
      offset = ParabolaMinimum(sum[label - 1], sum[label], sum[label + 1]);
    }
    inverse_depth->data[i] = static_cast<float>(labels.first + (label + offset) * labels.step);
  }
}

// Median of the 3x3 neighbourhood, the border repeated.
void Median3x3(Planes* plane) {
  const Planes in = *plane;
  for (int y = 0; y < in.height; ++y) {
    for (int x = 0; x < in.width; ++x) {
      std::array<float, 9> v;
      for (int k = 0; k < 9; ++k) {
        v[k] = in.at(0, std::clamp(y + k / 3 - 1, 0, in.height - 1),
                     std::clamp(x + k % 3 - 1, 0, in.width - 1));
      }
      std::nth_element(v.begin(), v.begin() + 4, v.end());
      plane->at(0, y, x) = v[4];
    }
  }
}

// Moves every pixel by up to `reach` in inverse depth to where it fits best.
absl::Status SweepSurface(Matcher* matcher, double reach, const CancelToken& cancel,
                          Surface* surface) {
  constexpr int kOffsets = 5;
  constexpr int kMiddle = kOffsets / 2;
  const size_t n = matcher->pixels();
  std::vector<float> moved(n);
  std::array<std::vector<float>, kOffsets> fits;
  const float step = static_cast<float>(reach / kMiddle);
  for (int k = 0; k < kOffsets; ++k) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    for (size_t i = 0; i < n; ++i) {
      moved[i] = surface->inverse_depth.data[i] + (k - kMiddle) * step;
    }
    fits[k].resize(n);
    matcher->Fit(moved.data(), fits[k].data());
  }
  for (size_t i = 0; i < n; ++i) {
    int best = kMiddle;
    for (int k = 0; k < kOffsets; ++k) {
      if (fits[k][i] > fits[best][i]) best = k;
    }
    double offset = best - kMiddle;
    if (best > 0 && best + 1 < kOffsets) {
      offset += ParabolaMinimum(-fits[best - 1][i], -fits[best][i], -fits[best + 1][i]);
    }
    surface->inverse_depth.data[i] += static_cast<float>(offset) * step;
    surface->fit.data[i] = fits[best][i];
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Surface> EstimateSurface(const MatchImage& reference,
                                        absl::Span<const MatchImage* const> sources,
                                        const ViewPlan& plan, const CancelToken& cancel) {
  Matcher matcher(reference, sources);
  const Labels labels = matcher.ChooseLabels(plan);
  Surface surface;
  surface.inverse_depth = surface.fit = Planes(1, reference.gray.height, reference.gray.width);
  {
    LITAGS_ASSIGN_OR_RETURN(CostVolume volume,
                            SweepPlanes(&matcher, reference.camera, labels, cancel));
    AddAnchors(plan, labels, &volume);
    SmoothnessPenalty penalty;
    penalty.step = static_cast<int>(std::lround(kStepPenalty * kCostScale));
    penalty.jump = static_cast<int>(std::lround(kJumpPenalty * kCostScale));
    penalty.edge_contrast = kEdgeContrast;
    const std::vector<uint16_t> sums = AggregateCosts(volume, reference.gray.data.data(), penalty);
    PickLabels(sums, volume, labels, &surface.inverse_depth);
  }
  for (const double reach : {0.5 * labels.step, 0.25 * labels.step}) {
    Median3x3(&surface.inverse_depth);
    LITAGS_RETURN_IF_ERROR(SweepSurface(&matcher, reach, cancel, &surface));
  }
  const float least = static_cast<float>(0.5 * labels.first);
  for (float& v : surface.inverse_depth.data) v = std::max(v, least);
  return surface;
}

}  // namespace litags
