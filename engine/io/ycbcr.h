// YCbCr, as codecs of photos and videos store it, to RGB in floating point. Nothing is rounded or
// cut off at black.
#ifndef LITAGS_ENGINE_IO_YCBCR_H_
#define LITAGS_ENGINE_IO_YCBCR_H_

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace litags {

// Where a sample of chroma lies among the pixels that share it.
enum class ChromaSite { kCentre, kFirst };

// Where full-size sample i of a side lies among `n` samples, `ratio` of them to one: between two
// neighbours.
struct Tap {
  int low, high;
  float weight;  // of high
};
std::vector<Tap> TapsOf(int size, int n, double ratio, ChromaSite site = ChromaSite::kCentre);
// Whether the taps give `n` samples back as they are.
bool IsEachItself(const std::vector<Tap>& taps, int n);

// One component at its own resolution: another's memory.
template <class T>
struct ComponentView {
  const T* data = nullptr;
  int width = 0, height = 0;
  ptrdiff_t stride = 0;  // samples

  const T* row(int y) const { return data + y * stride; }
};

// Gives rows of a component at the photo's size, interpolated linearly.
template <class T>
class Upsampler {
 public:
  Upsampler(const ComponentView<T>& plane, std::vector<Tap> x_taps, std::vector<Tap> y_taps)
      : plane_(plane),
        same_width_(IsEachItself(x_taps, plane.width)),
        x_taps_(std::move(x_taps)),
        y_taps_(std::move(y_taps)),
        between_(plane.width) {}

  // `out` has the photo's width.
  void Row(int y, float* out) {
    const Tap& tap = y_taps_[y];
    const T *low = plane_.row(tap.low), *high = plane_.row(tap.high);
    float* between = same_width_ ? out : between_.data();
    for (int x = 0; x < plane_.width; ++x) {
      const float a = low[x], b = high[x];
      between[x] = a + tap.weight * (b - a);
    }
    if (same_width_) return;
    for (size_t x = 0; x < x_taps_.size(); ++x) {
      const Tap& t = x_taps_[x];
      out[x] = between[t.low] + t.weight * (between[t.high] - between[t.low]);
    }
  }

 private:
  ComponentView<T> plane_;
  bool same_width_;
  std::vector<Tap> x_taps_, y_taps_;
  std::vector<float> between_;
};

// Code points of ITU-T H.273; 2: not said.
struct YCbCrKind {
  int matrix = 2, primaries = 2, transfer = 2;
  bool full_range = true;
  int bits = 8;
};

// The codes of luma that stand for 0 and 1.
struct LumaRange {
  double black, white;
};
LumaRange LumaRangeOf(const YCbCrKind& kind);

// From codes to R, G and B, of which 1 is white. What is not said, or not known, is BT.601.
class YCbCrToRgb {
 public:
  explicit YCbCrToRgb(const YCbCrKind& kind);

  // `rgb`: three to a pixel.
  void Convert(const float* luma, const float* cb, const float* cr, size_t pixels,
               float* rgb) const;

 private:
  std::array<float, 3> zero_;                  // codes of Y, Cb and Cr that stand for 0
  std::array<std::array<float, 3>, 3> scale_;  // [R, G, B][Y, Cb, Cr]
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_YCBCR_H_
