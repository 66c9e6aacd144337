// What rounding to 8-bit codes does to dark colours, and what they probably were before.
#ifndef LITAGS_ENGINE_TARGET_ROUNDING_H_
#define LITAGS_ENGINE_TARGET_ROUNDING_H_

#include <array>
#include <vector>

namespace litags {

// What is known of a capture's colours before its pixels are looked at.
struct ColorPrior {
  // Mean Cb / Y and Cr / Y of linear light (ITU-R BT.601 of linear light, Cb = (B - Y) / 1.772).
  double cb = 0, cr = 0;
  double noise = 0;        // deviation per channel before rounding, 8-bit codes
  bool jpeg = true;        // the codes were rounded a second time, as Y, Cb and Cr
  double chroma_step = 0;  // quantisation step of the DC coefficient of Cb and Cr; 0: not a JPEG
};

// The mean of what a dark colour may have been, given its rounded code.
//
// A camera rounds R, G and B to integers; a JPEG encoder makes Y, Cb and Cr of them and rounds
// again. Where light is a few codes, both are large, and not only random: libjpeg rounds halves
// down, Cb = (B - Y) / 1.772 of a grey whose blue is one code less is exactly a half, and so is Cr
// where red is one code more. Rounding down both is a step towards green. Noise of a code evens
// this out, but reduced or denoised photos have less.
//
// The table follows colours through both roundings: log-uniform in light from a 20th of a code, of
// normally distributed Cb / Y and Cr / Y around the prior's. It stores by how much the colours that
// arrive at a code differ from it in the mean. The deviation of a normal photo's colours is
// measured on 110 photos; nothing is fitted to dark ones.
class RoundingTable {
 public:
  explicit RoundingTable(const ColorPrior& prior);

  // Y, Cb, Cr to be added to a colour, all in 8-bit codes of sRGB, Cb and Cr around 0. Continuous;
  // 0 above kTop.
  std::array<float, 3> Correction(const std::array<float, 3>& ycc) const;

  static constexpr float kTop = 13;  // codes of luma. Rounding is 2 % of the colour there. Choice

 private:
  std::vector<std::array<float, 3>> cells_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_ROUNDING_H_
