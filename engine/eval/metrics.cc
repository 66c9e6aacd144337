#include "engine/eval/metrics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr int kRadius = 5;

absl::Status CheckSizes(const Planes& a, const Planes& b) {
  if (a.empty() || b.empty()) {
    return InvalidInput("EMPTY_IMAGE", "image", "an image to compare is empty; give two images");
  }
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    return InvalidInput(
        "SIZE_MISMATCH", "image",
        absl::StrCat("images to compare are ", a.width, "x", a.height, "x", a.channels, " and ",
                     b.width, "x", b.height, "x", b.channels, "; they must be the same size"));
  }
  return absl::OkStatus();
}

double MeanSquaredError(const Planes& a, const Planes& b) {
  double sum = 0;
  for (size_t i = 0; i < a.data.size(); ++i) {
    const double d = double(a.data[i]) - b.data[i];
    sum += d * d;
  }
  return sum / a.data.size();
}

std::array<double, 2 * kRadius + 1> Window() {
  std::array<double, 2 * kRadius + 1> g;
  double sum = 0;
  for (int i = -kRadius; i <= kRadius; ++i) sum += g[i + kRadius] = std::exp(-i * i / 4.5);
  for (double& v : g) v /= sum;
  return g;
}

// Separable blur with zero padding, in place.
void Blur(const std::array<double, 2 * kRadius + 1>& window, int width, int height,
          std::vector<double>* map) {
  std::vector<double> rows(map->size());
  for (int y = 0; y < height; ++y) {
    const double* in = map->data() + size_t(y) * width;
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      const int first = std::max(-kRadius, -x), last = std::min(kRadius, width - 1 - x);
      for (int k = first; k <= last; ++k) sum += window[k + kRadius] * in[x + k];
      rows[size_t(y) * width + x] = sum;
    }
  }
  std::fill(map->begin(), map->end(), 0.0);
  for (int y = 0; y < height; ++y) {
    double* out = map->data() + size_t(y) * width;
    const int first = std::max(-kRadius, -y), last = std::min(kRadius, height - 1 - y);
    for (int k = first; k <= last; ++k) {
      const double* in = rows.data() + size_t(y + k) * width;
      for (int x = 0; x < width; ++x) out[x] += window[k + kRadius] * in[x];
    }
  }
}

// Mean of one channel's SSIM map over rows and columns [border, size - border).
double ChannelSsim(const float* a, const float* b, int width, int height, int border) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  const auto window = Window();
  const size_t n = size_t(width) * height;
  std::vector<double> ma(a, a + n), mb(b, b + n), aa(n), bb(n), ab(n);
  for (size_t i = 0; i < n; ++i) {
    aa[i] = ma[i] * ma[i];
    bb[i] = mb[i] * mb[i];
    ab[i] = ma[i] * mb[i];
  }
  for (auto* map : {&ma, &mb, &aa, &bb, &ab}) Blur(window, width, height, map);
  double sum = 0;
  for (int y = border; y < height - border; ++y) {
    for (int x = border; x < width - border; ++x) {
      const size_t i = size_t(y) * width + x;
      const double mean_product = ma[i] * mb[i], mean_squares = ma[i] * ma[i] + mb[i] * mb[i];
      sum += (2 * mean_product + kC1) * (2 * (ab[i] - mean_product) + kC2) /
             ((mean_squares + kC1) * (aa[i] + bb[i] - mean_squares + kC2));
    }
  }
  return sum / (double(width - 2 * border) * (height - 2 * border));
}

using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Matrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

}  // namespace

absl::StatusOr<double> Psnr(const Planes& a, const Planes& b) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(a, b));
  const double mse = MeanSquaredError(a, b);
  return mse == 0 ? std::numeric_limits<double>::infinity() : -10 * std::log10(mse);
}

absl::StatusOr<double> Psnr(const ImageU8& a, const ImageU8& b) {
  return Psnr(ToPlanes(a), ToPlanes(b));
}

absl::StatusOr<double> Ssim(const Planes& a, const Planes& b, SsimBorder border) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(a, b));
  const int margin = border == SsimBorder::kValid ? kRadius : 0;
  if (a.width <= 2 * margin || a.height <= 2 * margin) {
    return InvalidInput("IMAGE_TOO_SMALL", "image",
                        absl::StrCat("SSIM's window needs 11x11 px, the images are ", a.width, "x",
                                     a.height, "; use zero padding or larger images"));
  }
  double sum = 0;
  for (int c = 0; c < a.channels; ++c) {
    sum += ChannelSsim(a.plane(c), b.plane(c), a.width, a.height, margin);
  }
  return sum / a.channels;
}

absl::StatusOr<double> Ssim(const ImageU8& a, const ImageU8& b, SsimBorder border) {
  return Ssim(ToPlanes(a), ToPlanes(b), border);
}

Planes ColorFit::Apply(const Planes& image) const {
  Planes out = image;
  for (size_t i = 0; i < image.plane_size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      double v = m[4 * c + 3];
      for (int j = 0; j < 3; ++j) v += m[4 * c + j] * image.plane(j)[i];
      out.plane(c)[i] = static_cast<float>(std::clamp(v, 0.0, 1.0));
    }
  }
  return out;
}

absl::Status ColorFitter::Add(const Planes& render, const Planes& truth) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(render, truth));
  if (render.channels < 3) {
    return InvalidInput("NOT_A_COLOR_IMAGE", "image",
                        absl::StrCat("a colour fit needs 3 channels, got ", render.channels));
  }
  Eigen::Map<Matrix4> xtx(xtx_.data());
  Eigen::Map<Matrix34> xty(xty_.data());
  for (size_t i = 0; i < render.plane_size(); ++i) {
    const Eigen::Vector4d x(render.plane(0)[i], render.plane(1)[i], render.plane(2)[i], 1);
    const Eigen::Vector3d y(truth.plane(0)[i], truth.plane(1)[i], truth.plane(2)[i]);
    xtx += x * x.transpose();
    xty += y * x.transpose();
  }
  count_ += render.plane_size();
  return absl::OkStatus();
}

absl::Status ColorFitter::Add(const ImageU8& render, const ImageU8& truth) {
  return Add(ToPlanes(render), ToPlanes(truth));
}

absl::StatusOr<ColorFit> ColorFitter::Fit() const {
  if (count_ == 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "NO_IMAGES", "image",
                     "a colour fit needs at least one pair of images");
  }
  // The change from the identity of least norm: directions without data get none.
  const Matrix4 xtx = Eigen::Map<const Matrix4>(xtx_.data()) / count_;
  const Matrix34 xty = Eigen::Map<const Matrix34>(xty_.data()) / count_;
  const Matrix34 identity = Matrix34::Identity();
  Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix4d> solver;
  solver.setThreshold(1e-9);  // float input: below it is rounding
  solver.compute(xtx);
  const Matrix34 fit = identity + solver.solve((xty - identity * xtx).transpose()).transpose();
  ColorFit result;
  Eigen::Map<Matrix34>(result.m.data()) = fit;
  return result;
}

absl::StatusOr<CorrectedPsnr> AffineCorrectedPsnr(const std::vector<ImageU8>& renders,
                                                  const std::vector<ImageU8>& truths) {
  if (renders.size() != truths.size()) {
    return InvalidInput("COUNT_MISMATCH", "image",
                        absl::StrCat(renders.size(), " renders but ", truths.size(),
                                     " true images; they must come in pairs"));
  }
  ColorFitter fitter;
  for (size_t i = 0; i < renders.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(fitter.Add(renders[i], truths[i]));
  }
  CorrectedPsnr result;
  LITAGS_ASSIGN_OR_RETURN(result.fit, fitter.Fit());
  for (size_t i = 0; i < renders.size(); ++i) {
    const Planes render = ToPlanes(renders[i]), truth = ToPlanes(truths[i]);
    LITAGS_ASSIGN_OR_RETURN(const double corrected, Psnr(result.fit.Apply(render), truth));
    result.corrected_db += corrected / renders.size();
  }
  return result;
}

}  // namespace litags
