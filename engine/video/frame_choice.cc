#include "engine/video/frame_choice.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>

#include "engine/core/quantile.h"

namespace litags {
namespace {

// Motion is measured on half the size, by blocks of the frame that motion is counted from.
constexpr int kBlock = 24, kReach = 16;  // px
constexpr int kColumns = 6, kRows = 4;   // of blocks
// A block is found if this much of it correlates. What is not found has moved out of reach.
constexpr double kFound = 0.6;
// The median shift from which on motion is counted from a new frame, px: well within reach.
constexpr double kNewAnchor = 8;
// Fewer blocks with something in them say nothing.
constexpr size_t kFewBlocks = 4;
// A block shows something if its standard deviation is this much of the frame's.
constexpr double kTexture = 0.1;

cv::Mat Blurred(const cv::Mat& image, double sigma) {
  cv::Mat out;
  cv::GaussianBlur(image, out, cv::Size(), sigma, sigma, cv::BORDER_REFLECT);
  return out;
}

cv::Mat MatOf(const Planes& luma) {
  return cv::Mat(luma.height, luma.width, CV_32F, const_cast<float*>(luma.data.data()));
}

double GradientEnergy(const cv::Mat& image) {
  cv::Mat dx, dy;
  cv::Sobel(image, dx, CV_32F, 1, 0);
  cv::Sobel(image, dy, CV_32F, 0, 1);
  return dx.dot(dx) + dy.dot(dy);
}

double Deviation(const cv::Mat& image) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  return deviation[0];
}

// The median shift of the blocks of `from` that show something, px; kReach where they are not
// found. Negative: nothing shows anything.
double MedianShift(const cv::Mat& from, const cv::Mat& to) {
  const double texture = kTexture * Deviation(from);
  std::vector<double> shifts;
  for (int i = 0; i < kColumns * kRows; ++i) {
    // Blocks keep their distance from the border, so that all of them can move.
    const int x = kReach + (i % kColumns) * (from.cols - 2 * kReach - kBlock) / (kColumns - 1);
    const int y = kReach + (i / kColumns) * (from.rows - 2 * kReach - kBlock) / (kRows - 1);
    const cv::Rect block(x, y, kBlock, kBlock);
    const cv::Rect around(x - kReach, y - kReach, kBlock + 2 * kReach, kBlock + 2 * kReach);
    const cv::Rect frame(0, 0, from.cols, from.rows);
    if ((around & frame) != around || !(Deviation(from(block)) > texture)) continue;
    cv::Mat scores;
    cv::matchTemplate(to(around), from(block), scores, cv::TM_CCOEFF_NORMED);
    double best = 0;
    cv::Point at;
    cv::minMaxLoc(scores, nullptr, &best, nullptr, &at);
    shifts.push_back(best < kFound ? kReach : std::hypot(at.x - kReach, at.y - kReach));
  }
  if (shifts.size() < kFewBlocks) return -1;
  return MedianInPlace(shifts);
}

}  // namespace

struct FrameMeter::State {
  cv::Mat anchor;
  double motion = 0;  // up to the anchor
};

double SharpnessOf(const Planes& luma) {
  const cv::Mat image = MatOf(luma);
  // A little blur first: noise is no sharpness.
  const double fine = GradientEnergy(Blurred(image, 1)), coarse = GradientEnergy(Blurred(image, 3));
  return coarse > 0 ? fine / coarse : 0;
}

FrameMeter::FrameMeter() : state_(std::make_unique<State>()) {}
FrameMeter::~FrameMeter() = default;

FrameFacts FrameMeter::Measure(const Planes& luma) {
  const cv::Mat image = MatOf(luma);
  FrameFacts facts;
  facts.sharpness = SharpnessOf(luma);
  cv::Mat half;
  cv::resize(Blurred(image, 1), half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  if (state_->anchor.empty()) {
    state_->anchor = half;
    return facts;
  }
  const double side = std::max(half.cols, half.rows);
  const double shift = MedianShift(state_->anchor, half);
  facts.motion = state_->motion + std::max(0.0, shift) / side;
  if (shift < 0 || shift >= kNewAnchor) {
    state_->motion = facts.motion;
    state_->anchor = half;
  }
  return facts;
}

std::vector<int> ChooseFrames(std::span<const FrameFacts> frames, int most) {
  const int n = static_cast<int>(frames.size());
  if (most <= 0) most = kMostFrames;
  if (n == 0) return {};
  // Motion grows but for noise; of a camera that stands still, frames are counted instead.
  const double way = frames.back().motion;
  const bool still = way < kMotionStep;
  const auto at = [&](int i) { return still ? double(i) / n : frames[i].motion / way; };
  const int asked =
      still ? kFewFrames : std::max(kFewFrames, static_cast<int>(std::lround(way / kMotionStep)));
  const int bins = std::min({asked, most, n});
  struct Best {
    int frame = -1;
    bool central = false;
  };
  std::vector<Best> best(bins);
  for (int i = 0; i < n; ++i) {
    const double place = std::clamp(at(i), 0.0, 1.0) * bins;
    const int bin = std::min(static_cast<int>(place), bins - 1);
    // Not at the end of a part: the next part's may lie just behind it.
    const bool central = std::abs(place - bin - 0.5) < 0.3;
    Best& b = best[bin];
    if (b.frame < 0 || central > b.central ||
        (central == b.central && frames[i].sharpness > frames[b.frame].sharpness)) {
      b = {i, central};
    }
  }
  std::vector<int> chosen;
  for (const Best& b : best) {
    if (b.frame >= 0) chosen.push_back(b.frame);
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  return chosen;
}

}  // namespace litags
