#include "engine/io/color_space.h"

#include <lcms2.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "engine/io/io_error.h"

namespace litags {
namespace {

// Curves are tables over Photo's range of codes, [-2, 2], with its step.
constexpr float kCurveStart = -2, kCurveSteps = kPhotoWhite;
constexpr int kCurveSize = 4 * kPhotoWhite + 1;

float LightOf(const std::vector<float>& curve, float code) {
  if (std::isnan(code)) return 0;  // a hole: dark, not the darkest that there is
  const float at = std::max(0.0f, code - kCurveStart) * kCurveSteps;
  const int i = static_cast<int>(std::min(at, float(kCurveSize - 2)));
  return curve[i] + std::min(at - i, 1.0f) * (curve[i + 1] - curve[i]);
}

struct ProfileCloser {
  void operator()(void* profile) const { cmsCloseProfile(profile); }
};
using Profile = std::unique_ptr<void, ProfileCloser>;

// Columns are the colorants' XYZ as the profile connection space has it (D50).
std::optional<cv::Matx33d> ColorantsOf(cmsHPROFILE profile) {
  constexpr cmsTagSignature kTags[] = {cmsSigRedColorantTag, cmsSigGreenColorantTag,
                                       cmsSigBlueColorantTag};
  cv::Matx33d columns;
  for (int c = 0; c < 3; ++c) {
    const auto* xyz = static_cast<const cmsCIEXYZ*>(cmsReadTag(profile, kTags[c]));
    if (xyz == nullptr) return std::nullopt;
    columns(0, c) = xyz->X;
    columns(1, c) = xyz->Y;
    columns(2, c) = xyz->Z;
  }
  return columns;
}

struct Chromaticity {
  double x, y;
};

using Primaries = std::array<Chromaticity, 3>;

constexpr Primaries kBt709 = {{{.64, .33}, {.30, .60}, {.15, .06}}},
                    kP3 = {{{.68, .32}, {.265, .69}, {.15, .06}}},
                    kBt2020 = {{{.708, .292}, {.17, .797}, {.131, .046}}},
                    kAdobe = {{{.64, .33}, {.21, .71}, {.15, .06}}};

// Columns are the XYZ of primaries whose sum is the white of D65.
cv::Matx33d XyzOf(const Primaries& primaries) {
  const auto xyz = [](const Chromaticity& c) {
    return cv::Vec3d(c.x / c.y, 1, (1 - c.x - c.y) / c.y);
  };
  cv::Matx33d columns;
  for (int c = 0; c < 3; ++c) {
    const cv::Vec3d column = xyz(primaries[c]);
    for (int i = 0; i < 3; ++i) columns(i, c) = column[i];
  }
  const cv::Vec3d scale = columns.inv() * xyz({0.3127, 0.3290});
  return columns * cv::Matx33d::diag(scale);
}

std::array<std::array<float, 3>, 3> ToRows(const cv::Matx33d& m) {
  std::array<std::array<float, 3>, 3> rows;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rows[i][j] = static_cast<float>(m(i, j));
  }
  return rows;
}

// To light of sRGB's primaries.
std::array<std::array<float, 3>, 3> MatrixOf(const Primaries& primaries) {
  return ToRows(XyzOf(kBt709).inv() * XyzOf(primaries));
}

// ITU-R BT.2100: the inverse of the curve that a camera has.
double LinearFromHlg(double code) {
  constexpr double kA = 0.17883277, kB = 0.28466892, kC = 0.55991073;
  return code <= 0.5 ? code * code / 3 : (std::exp((code - kC) / kA) + kB) / 12;
}

cmsColorSpaceSignature SignatureOf(int channels) {
  return channels == 1 ? cmsSigGrayData : channels == 3 ? cmsSigRgbData : cmsSigCmykData;
}

cmsUInt32Number FormatOf(int channels) {
  return channels == 1 ? TYPE_GRAY_FLT : channels == 3 ? TYPE_RGB_FLT : TYPE_CMYK_FLT;
}

std::shared_ptr<void> MakeTransform(cmsHPROFILE profile, int channels) {
  const Profile srgb(cmsCreate_sRGBProfile());
  const cmsHTRANSFORM transform =
      cmsCreateTransform(profile, FormatOf(channels), srgb.get(), TYPE_RGB_FLT, INTENT_PERCEPTUAL,
                         cmsFLAGS_NOCACHE | cmsFLAGS_NOOPTIMIZE);
  if (transform == nullptr) return nullptr;
  return std::shared_ptr<void>(transform, cmsDeleteTransform);
}

}  // namespace

// `light` is asked for codes of 0 to `most`, above which the curve goes on as a line. Below black
// it is mirrored, so that the mean of noise stays.
std::shared_ptr<const ColorSpace::Curve> ColorSpace::MakeCurve(
    const std::function<double(double)>& light, double most) {
  auto curve = std::make_shared<Curve>(kCurveSize);
  const double end = light(most), slope = (end - light(most - 1.0 / 64)) * 64;
  const int zero = kCurveSize / 2;
  for (int i = 0; i <= zero; ++i) {
    const double code = double(i) / kPhotoWhite;
    const double value = code <= most ? light(code) : end + slope * (code - most);
    (*curve)[zero + i] = static_cast<float>(value);
    (*curve)[zero - i] = static_cast<float>(-value);
  }
  (*curve)[zero] = static_cast<float>(light(0));
  return curve;
}

ColorSpace ColorSpace::Srgb(int channels) {
  ColorSpace space(channels);
  space.is_srgb_ = true;
  return space;
}

ColorSpace ColorSpace::Gamma(double exponent, int channels) {
  ColorSpace space(channels);
  space.curves_.fill(MakeCurve([&](double code) { return std::pow(code, exponent); }));
  return space;
}

ColorSpace ColorSpace::AdobeRgb() {
  ColorSpace space = Gamma(563 / 256.0, 3);
  space.matrix_ = MatrixOf(kAdobe);
  return space;
}

std::optional<ColorSpace> ColorSpace::FromIcc(std::string_view icc, int channels) {
  if (icc.empty() || icc.size() > kMaxProfileBytes) return std::nullopt;
  const Profile profile(
      cmsOpenProfileFromMem(icc.data(), static_cast<cmsUInt32Number>(icc.size())));
  if (profile == nullptr || cmsGetColorSpace(profile.get()) != SignatureOf(channels)) {
    return std::nullopt;
  }
  ColorSpace space(channels);
  if (channels == 4 || !cmsIsMatrixShaper(profile.get())) {
    space.transform_ = MakeTransform(profile.get(), channels);
    if (space.transform_ == nullptr) return std::nullopt;
    return space;
  }
  constexpr cmsTagSignature kCurves[] = {cmsSigRedTRCTag, cmsSigGreenTRCTag, cmsSigBlueTRCTag};
  for (int c = 0; c < 3; ++c) {
    const cmsTagSignature tag = channels == 1 ? cmsSigGrayTRCTag : kCurves[c];
    const auto* curve = static_cast<const cmsToneCurve*>(cmsReadTag(profile.get(), tag));
    if (curve == nullptr) return std::nullopt;
    space.curves_[c] = MakeCurve([&](double code) {
      const double light = cmsEvalToneCurveFloat(curve, static_cast<float>(code));
      return std::isfinite(light) ? std::clamp(light, 0.0, 1.0) : 0.0;
    });
  }
  if (channels == 3) {
    const Profile srgb(cmsCreate_sRGBProfile());
    const auto from = ColorantsOf(profile.get()), to = ColorantsOf(srgb.get());
    if (!from.has_value() || !to.has_value()) return std::nullopt;
    space.matrix_ = ToRows(to->inv() * *from);
  }
  space.is_srgb_ = space.IsNearlySrgb();
  return space;
}

ColorSpace ColorSpace::FromIccOrSrgb(std::string_view icc, int channels) {
  std::optional<ColorSpace> space = FromIcc(icc, channels);
  return space.has_value() ? *std::move(space) : Srgb(channels);
}

absl::StatusOr<ColorSpace> ColorSpace::FromCodePoints(int primaries, int transfer,
                                                      std::string_view field) {
  ColorSpace space(3);
  switch (transfer) {
    case 1:
    case 2:
    case 6:
    case 13:
    case 14:
    case 15:  // viewers show video's curve as sRGB's
      space.curves_.fill(MakeCurve([](double code) { return LinearFromSrgb(code); }));
      break;
    case 4:
      space.curves_.fill(MakeCurve([](double code) { return std::pow(code, 2.2); }));
      break;
    case 8:
      space.curves_.fill(MakeCurve([](double code) { return code; }));
      break;
    case 16:
      return InvalidField("IMAGE_UNSUPPORTED", field,
                          "a picture for HDR screens (PQ); save it in standard range");
    case 18:
      space.curves_.fill(MakeCurve(LinearFromHlg, 2));
      break;
    default:
      return InvalidField("IMAGE_UNSUPPORTED", field,
                          absl::StrCat("a picture of transfer characteristics ", transfer,
                                       " (ITU-T H.273); save it as sRGB"));
  }
  const bool p3 = primaries == 12, bt2020 = primaries == 9;
  if (p3 || bt2020) space.matrix_ = MatrixOf(p3 ? kP3 : kBt2020);
  space.is_srgb_ = space.IsNearlySrgb();
  return space;
}

bool ColorSpace::IsNearlySrgb() const {
  constexpr float kCodes[] = {0, 0.004f, 0.02f, 0.05f, 0.1f, 0.3f, 0.6f, 1};
  constexpr int kRounding = static_cast<int>(kPhotoCode / 4);
  for (const float r : kCodes) {
    for (const float g : kCodes) {
      for (const float b : kCodes) {
        const float codes[] = {r, g, b};
        int16_t samples[3];
        Convert(codes, 1, samples);
        for (int c = 0; c < 3; ++c) {
          const float code = codes[channels_ == 1 ? 0 : c];
          if (std::abs(samples[c] - PhotoSample(code)) > kRounding) return false;
        }
      }
    }
  }
  return true;
}

void ColorSpace::Convert(const float* codes, size_t pixels, int16_t* samples) const {
  if (transform_ != nullptr) {
    std::vector<float> in(codes, codes + channels_ * pixels), rgb(3 * pixels);
    if (channels_ == 4) {
      for (float& ink : in) ink *= 100;  // percent
    }
    cmsDoTransform(transform_.get(), in.data(), rgb.data(), static_cast<cmsUInt32Number>(pixels));
    std::transform(rgb.begin(), rgb.end(), samples, PhotoSample);
    return;
  }
  const SampleTable& encode = SampleTable::Get();
  for (size_t i = 0; i < pixels; ++i, samples += 3) {
    const float* code = codes + channels_ * i;
    if (is_srgb_) {
      for (int c = 0; c < 3; ++c) samples[c] = PhotoSample(code[channels_ == 1 ? 0 : c]);
      continue;
    }
    if (channels_ == 1) {
      samples[0] = samples[1] = samples[2] = encode(LightOf(*curves_[0], code[0]));
      continue;
    }
    const float light[] = {LightOf(*curves_[0], code[0]), LightOf(*curves_[1], code[1]),
                           LightOf(*curves_[2], code[2])};
    for (int c = 0; c < 3; ++c) {
      const auto& row = matrix_[c];
      samples[c] = encode(row[0] * light[0] + row[1] * light[1] + row[2] * light[2]);
    }
  }
}

void ColorSpace::Convert(Photo* photo) const {
  if (is_srgb_) return;
  std::vector<float> codes(size_t(channels_) * photo->width);
  for (int y = 0; y < photo->height; ++y) {
    int16_t* row = photo->pixel(0, y);
    for (size_t i = 0; i < codes.size(); ++i) codes[i] = EncodedOf(row[channels_ == 1 ? 3 * i : i]);
    Convert(codes.data(), photo->width, row);
  }
}

}  // namespace litags
