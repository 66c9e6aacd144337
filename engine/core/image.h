// Image containers: interleaved samples (pictures as bytes, photos as photo.h says) and float
// planes.
#ifndef LITAGS_ENGINE_CORE_IMAGE_H_
#define LITAGS_ENGINE_CORE_IMAGE_H_

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace litags {

// RGB, [H, W, 3] interleaved, rows top to bottom, no padding.
template <typename T>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<T> data;

  Image() = default;
  Image(int w, int h) : width(w), height(h), data(size_t{3} * w * h) {}

  bool empty() const { return data.empty(); }
  size_t pixels() const { return size_t(width) * height; }
  T* pixel(int x, int y) { return data.data() + 3 * (size_t(y) * width + x); }
  const T* pixel(int x, int y) const { return data.data() + 3 * (size_t(y) * width + x); }
};

// A rectangle of an image's pixels.
struct PixelRect {
  int x = 0, y = 0;           // top-left pixel
  int width = 0, height = 0;  // px

  bool empty() const { return width <= 0 || height <= 0; }
};

// The pixels of a rectangle inside the image.
template <typename T>
Image<T> Cut(const Image<T>& image, const PixelRect& rect) {
  Image<T> out(rect.width, rect.height);
  for (int y = 0; y < rect.height; ++y) {
    std::copy_n(image.pixel(rect.x, rect.y + y), size_t{3} * rect.width, out.pixel(0, y));
  }
  return out;
}

// A finished picture: 8-bit sRGB codes.
using ImageU8 = Image<uint8_t>;

// Float planes, [C, H, W], no padding: what kernels read and write, because SIMD lanes run
// along pixels. Colour values are sRGB-encoded in [0, 1] unless a name says _linear.
struct Planes {
  int channels = 0;
  int height = 0;
  int width = 0;
  std::vector<float> data;

  Planes() = default;
  Planes(int c, int h, int w) : channels(c), height(h), width(w), data(size_t(c) * h * w) {}

  // Gives it another size and keeps its memory; the values are any that were there.
  void Reshape(int c, int h, int w) {
    channels = c;
    height = h;
    width = w;
    data.resize(size_t(c) * h * w);
  }

  bool empty() const { return data.empty(); }
  size_t plane_size() const { return size_t(height) * width; }
  float* plane(int c) { return data.data() + c * plane_size(); }
  const float* plane(int c) const { return data.data() + c * plane_size(); }
  float& at(int c, int y, int x) { return plane(c)[size_t(y) * width + x]; }
  float at(int c, int y, int x) const { return plane(c)[size_t(y) * width + x]; }
};

// Consecutive planes of a Planes, e.g. the colour of an 11-channel render; [channels, H, W]. A
// whole Planes converts by itself. Valid as long as the Planes is.
template <typename T>
struct BasicPlanesView {
  T* data = nullptr;
  int channels = 0;
  int height = 0;
  int width = 0;

  using Source = std::conditional_t<std::is_const_v<T>, const Planes, Planes>;

  BasicPlanesView() = default;
  BasicPlanesView(Source& planes) : BasicPlanesView(planes, 0, planes.channels) {}  // NOLINT
  BasicPlanesView(Source& planes, int first, int count)
      : data(planes.plane(first)), channels(count), height(planes.height), width(planes.width) {}
  // A span is also a view.
  template <class U>
  requires(std::is_const_v<T> && !std::is_const_v<U>)
      BasicPlanesView(const BasicPlanesView<U>& span)  // NOLINT
      : data(span.data), channels(span.channels), height(span.height), width(span.width) {}

  bool empty() const { return data == nullptr; }
  size_t plane_size() const { return size_t(height) * width; }
  size_t size() const { return channels * plane_size(); }
  T* plane(int c) const { return data + c * plane_size(); }
};
using PlanesView = BasicPlanesView<const float>;
using PlanesSpan = BasicPlanesView<float>;

inline bool SameSize(PlanesView a, PlanesView b) {
  return a.channels == b.channels && a.height == b.height && a.width == b.width;
}

// Bytes to [3, H, W] floats in [0, 1]; no change of encoding.
inline Planes ToPlanes(const ImageU8& image) {
  Planes planes(3, image.height, image.width);
  const size_t n = planes.plane_size();
  for (int c = 0; c < 3; ++c) {
    float* out = planes.plane(c);
    for (size_t i = 0; i < n; ++i) out[i] = image.data[3 * i + c] * (1.0f / 255.0f);
  }
  return planes;
}

// First three planes, or of one or two the first as grey, clamped to [0, 1] and rounded to bytes;
// NaN becomes 0.
inline ImageU8 ToImageU8(const Planes& planes) {
  ImageU8 image(planes.width, planes.height);
  const size_t n = planes.plane_size();
  for (int c = 0; c < 3; ++c) {
    const float* in = planes.plane(planes.channels < 3 ? 0 : c);
    for (size_t i = 0; i < n; ++i) {
      const float v = in[i] > 0.0f ? (in[i] < 1.0f ? in[i] : 1.0f) : 0.0f;
      image.data[3 * i + c] = static_cast<uint8_t>(v * 255.0f + 0.5f);
    }
  }
  return image;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_IMAGE_H_
