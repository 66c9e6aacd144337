#include "engine/video/frame_choice.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "engine/core/quantile.h"
#include "engine/noise/noise_estimate.h"

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
// A block shows something if its standard deviation is this much of the frame's, and if at most
// this share of its variance is noise. Two pictures of one place correlate by the rest, and what is
// found has kFound; choice.
constexpr double kTexture = 0.1, kMostNoise = 0.3;
// Blurs of the half size, px, of which the first that leaves little enough noise is taken. A wider
// one leaves a block so few details that noise correlates.
constexpr double kBlurs[] = {0, 1, 2};
// Variance of the blur that made the half size, in its px: a Gaussian's of 1 px and a box's of 2 px
// of the full size.
constexpr double kHalved = (1 + 0.25) / 4;

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

// Where blocks lie. They keep their distance from the border, so that all of them can move.
std::vector<cv::Point> Blocks(const cv::Mat& frame) {
  std::vector<cv::Point> blocks;
  const int width = frame.cols - 2 * kReach - kBlock, height = frame.rows - 2 * kReach - kBlock;
  if (width < 0 || height < 0) return blocks;
  for (int i = 0; i < kColumns * kRows; ++i) {
    blocks.emplace_back(kReach + i % kColumns * width / (kColumns - 1),
                        kReach + i / kColumns * height / (kRows - 1));
  }
  return blocks;
}

cv::Mat BlockAt(const cv::Mat& frame, const cv::Point& at) {
  return frame(cv::Rect(at.x, at.y, kBlock, kBlock));
}

// A frame of the half size, that motion is counted from.
struct Anchor {
  cv::Mat frame;
  double blur = 0;                // of kBlurs; `frame` has it
  std::vector<cv::Point> blocks;  // that show something
};

// `noise`: the deviation of the full size's, whose values are independent of each other.
Anchor AnchorAt(const cv::Mat& half, double noise) {
  Anchor anchor;
  for (const double blur : kBlurs) {
    anchor = {blur > 0 ? Blurred(half, blur) : half, blur, {}};
    // What a Gaussian blur of variance v leaves of it is 1 / (4 pi v); 4 px of the full size are 1.
    const double left = noise * noise / (16 * std::numbers::pi * (kHalved + blur * blur));
    const double texture = kTexture * Deviation(anchor.frame);
    size_t textured = 0;
    for (const cv::Point& at : Blocks(anchor.frame)) {
      const double deviation = Deviation(BlockAt(anchor.frame, at));
      if (!(deviation > texture)) continue;
      ++textured;
      if (left <= kMostNoise * deviation * deviation) anchor.blocks.push_back(at);
    }
    if (2 * anchor.blocks.size() >= textured) break;
  }
  return anchor;
}

// The median shift of the anchor's blocks, px; kReach where they are not found. Negative: nothing
// shows anything.
double MedianShift(const Anchor& anchor, const cv::Mat& half) {
  if (anchor.blocks.size() < kFewBlocks) return -1;
  const cv::Mat to = anchor.blur > 0 ? Blurred(half, anchor.blur) : half;
  std::vector<double> shifts;
  for (const cv::Point& block : anchor.blocks) {
    const cv::Rect around(block.x - kReach, block.y - kReach, kBlock + 2 * kReach,
                          kBlock + 2 * kReach);
    cv::Mat scores;
    cv::matchTemplate(to(around), BlockAt(anchor.frame, block), scores, cv::TM_CCOEFF_NORMED);
    double best = 0;
    cv::Point at;
    cv::minMaxLoc(scores, nullptr, &best, nullptr, &at);
    shifts.push_back(best < kFound ? kReach : std::hypot(at.x - kReach, at.y - kReach));
  }
  return MedianInPlace(shifts);
}

}  // namespace

struct FrameMeter::State {
  Anchor anchor;
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
  const auto start_from_here = [&] {
    const NoiseEstimate noise =
        NoiseOfChannel(luma.data.data(), luma.width, luma.height, {}, kBelowWhite);
    state_->anchor = AnchorAt(half, noise.Deviation() / 255);
  };
  if (state_->anchor.frame.empty()) {
    start_from_here();
    return facts;
  }
  const double side = std::max(half.cols, half.rows);
  const double shift = MedianShift(state_->anchor, half);
  facts.motion = state_->motion + std::max(0.0, shift) / side;
  if (shift < 0 || shift >= kNewAnchor) {
    state_->motion = facts.motion;
    start_from_here();
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
