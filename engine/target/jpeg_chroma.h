// What JPEG's roundings hide of dark colours.
#ifndef LITAGS_ENGINE_TARGET_JPEG_CHROMA_H_
#define LITAGS_ENGINE_TARGET_JPEG_CHROMA_H_

#include <array>
#include <opencv2/core.hpp>

namespace litags {

// An encoder rounds R, G and B to codes, then Y, Cb and Cr of these, halves of Cb and Cr down
// (libjpeg's jccolor.c). In dark pixels many colours become one code, and they do not lie around
// it: what reads Y = 3, Cb = -1, Cr = 0 was R = G = 3, B = 2 or so, whose Cb is -0.5. This is the
// mean of all colours that become a code, those near the capture's mean likelier.
class JpegChroma {
 public:
  // The mean Cb / Y and Cr / Y of a capture's colours.
  explicit JpegChroma(const cv::Vec2f& mean);

  // What to add to Cb and Cr where Y, Cb and Cr are `codes` (of 255) in the mean over some pixels
  // without noise. Nothing from kDarkCodes codes of luma on.
  cv::Vec2f Lost(const cv::Vec3f& codes) const;

 private:
  static constexpr int kDarkCodes = 16, kMostChroma = 8;
  static constexpr int kChromas = 2 * kMostChroma + 1;
  using Row = std::array<cv::Vec2f, kChromas>;
  using Plane = std::array<Row, kChromas>;

  std::array<Plane, kDarkCodes + 1> lost_;  // by Y, Cb, Cr
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_JPEG_CHROMA_H_
