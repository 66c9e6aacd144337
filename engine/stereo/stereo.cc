#include "engine/stereo/stereo.h"

#include <algorithm>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/stereo/agreement.h"
#include "engine/stereo/match_image.h"
#include "engine/stereo/surface.h"
#include "engine/stereo/view_plan.h"

namespace litags {
namespace {

constexpr int kMaxViewsAtOnce = 8;  // each holds three bytes a pixel and label, up to 60 MB
constexpr int kLeastSide = 16;      // px; less is no picture to match

// Runs body(i) for all views, in chunks so that progress comes from this thread.
absl::Status ForEachView(size_t n, int threads, const CancelToken& cancel,
                         absl::FunctionRef<absl::Status(size_t)> body,
                         absl::FunctionRef<void(size_t done)> progress) {
  threads = std::min(threads > 0 ? threads : DefaultThreadCount(), kMaxViewsAtOnce);
  std::vector<absl::Status> status(n);
  for (size_t first = 0; first < n; first += threads) {
    const size_t count = std::min<size_t>(threads, n - first);
    ParallelFor(threads, count, [&](size_t i, int) { status[first + i] = body(first + i); });
    for (size_t i = first; i < first + count; ++i) LITAGS_RETURN_IF_ERROR(status[i]);
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    progress(first + count);
  }
  return absl::OkStatus();
}

// Views that are too small neither have sources nor are some.
std::vector<ViewPlan> PlanLargeViews(absl::Span<const Camera> cameras,
                                     absl::Span<const SparsePoint> points) {
  std::vector<ViewPlan> plans = PlanViews(cameras, points);
  const auto too_small = [&](int i) {
    return std::min(cameras[i].width, cameras[i].height) < kLeastSide;
  };
  for (size_t i = 0; i < plans.size(); ++i) {
    std::erase_if(plans[i].sources, too_small);
    if (too_small(static_cast<int>(i))) plans[i].sources.clear();
  }
  return plans;
}

// Those of the other photos stay empty.
absl::StatusOr<std::vector<MatchImage>> ImagesOf(absl::Span<const ViewPlan> plans,
                                                 absl::Span<const PosedPhoto> photos,
                                                 absl::Span<const Camera> cameras, int threads) {
  const size_t n = photos.size();
  std::vector<char> needed(n);
  for (size_t i = 0; i < n; ++i) {
    if (!plans[i].sources.empty()) needed[i] = true;
    for (const int s : plans[i].sources) needed[s] = true;
  }
  std::vector<MatchImage> images(n);
  std::vector<absl::Status> status(n);
  ParallelFor(threads, n, [&](size_t i, int) {
    if (!needed[i]) return;
    auto image = MakeMatchImage(*photos[i].photo, cameras[i]);
    status[i] = image.status();
    if (image.ok()) images[i] = *std::move(image);
  });
  for (const absl::Status& s : status) LITAGS_RETURN_IF_ERROR(s);
  return images;
}

}  // namespace

absl::Status StereoOptions::Validate() const {
  if (max_side >= 32 && max_side <= 4096) return absl::OkStatus();
  return InvalidInput("BAD_OPTION", "stereo.max_side",
                      absl::StrCat("stereo.max_side: ", max_side, " is not in 32..4096"));
}

absl::StatusOr<std::vector<std::optional<DepthMap>>> StereoDepth(
    absl::Span<const PosedPhoto> photos, absl::Span<const SparsePoint> points,
    const StereoOptions& options, const CancelToken& cancel, DepthProgress progress) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  const size_t n = photos.size();
  std::vector<Camera> cameras;
  for (const PosedPhoto& p : photos) {
    cameras.push_back(p.view->camera.ShrunkTo(options.max_side));
  }
  const std::vector<ViewPlan> plans = PlanLargeViews(cameras, points);
  std::vector<size_t> matched;
  for (size_t i = 0; i < n; ++i) {
    if (!plans[i].sources.empty()) matched.push_back(i);
  }
  LITAGS_ASSIGN_OR_RETURN(const std::vector<MatchImage> images,
                          ImagesOf(plans, photos, cameras, options.threads));

  std::vector<Surface> surfaces(n);
  LITAGS_RETURN_IF_ERROR(ForEachView(
      matched.size(), options.threads, cancel,
      [&](size_t k) -> absl::Status {
        const size_t i = matched[k];
        std::vector<const MatchImage*> sources;
        for (const int s : plans[i].sources) sources.push_back(&images[s]);
        LITAGS_ASSIGN_OR_RETURN(surfaces[i], EstimateSurface(images[i], sources, plans[i], cancel));
        return absl::OkStatus();
      },
      [&](size_t done) { progress(static_cast<int>(done), static_cast<int>(matched.size())); }));

  std::vector<std::optional<DepthMap>> maps(n);
  ParallelFor(options.threads, n, [&](size_t i, int) {
    if (surfaces[i].fit.empty()) return;
    std::vector<ViewSurface> others;
    for (const int s : plans[i].sources) {
      if (!surfaces[s].fit.empty()) others.push_back({&cameras[s], &surfaces[s]});
    }
    DepthMap map = Agree({&cameras[i], &surfaces[i]}, others);
    const auto& c = map.confidence.data;
    if (std::none_of(c.begin(), c.end(), [](float v) { return v > 0; })) return;
    maps[i] = std::move(map);
  });
  return maps;
}

namespace {

class StereoDepthProvider : public DepthProvider {
 public:
  StereoDepthProvider(std::vector<SparsePoint> points, const StereoOptions& options)
      : points_(std::move(points)), options_(options) {}

  absl::StatusOr<std::vector<std::optional<DepthMap>>> Maps(absl::Span<const PosedPhoto> photos,
                                                            const CancelToken& cancel,
                                                            DepthProgress progress) override {
    return StereoDepth(photos, points_, options_, cancel, progress);
  }

 private:
  const std::vector<SparsePoint> points_;
  const StereoOptions options_;
};

}  // namespace

std::unique_ptr<DepthProvider> MakeStereoDepthProvider(std::vector<SparsePoint> points,
                                                       const StereoOptions& options) {
  return std::make_unique<StereoDepthProvider>(std::move(points), options);
}

}  // namespace litags
