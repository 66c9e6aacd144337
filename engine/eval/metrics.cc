#include "engine/eval/metrics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/ssim.h"

namespace litags {
namespace {

constexpr int kRadius = kSsimRadius;

absl::Status CheckSizes(const Planes& a, const Planes& b, const PlaneU8& mask) {
  if (a.empty() || b.empty()) {
    return InvalidInput("EMPTY_IMAGE", "image", "an image to compare is empty; give two images");
  }
  if (a.width != b.width || a.height != b.height || a.channels != b.channels) {
    return InvalidInput(
        "SIZE_MISMATCH", "image",
        absl::StrCat("images to compare are ", a.width, "x", a.height, "x", a.channels, " and ",
                     b.width, "x", b.height, "x", b.channels, "; they must be the same size"));
  }
  if (!mask.empty() && (mask.width != a.width || mask.height != a.height)) {
    return InvalidInput(
        "SIZE_MISMATCH", "mask",
        absl::StrCat("the mask is ", mask.width, "x", mask.height, ", the images to compare are ",
                     a.width, "x", a.height, "; they must be the same size"));
  }
  return absl::OkStatus();
}

double MeanSquaredError(const Planes& a, const Planes& b, const PlaneU8& mask) {
  double sum = 0;
  for (int c = 0; c < a.channels; ++c) {
    ForCounted(mask, a.plane_size(), [&](size_t i) {
      const double d = double(a.plane(c)[i]) - b.plane(c)[i];
      sum += d * d;
    });
  }
  return sum / (double(a.channels) * CountedPixels(mask, a.plane_size()));
}

// Pixels that count and are at least `border` from the rim.
double CountedInside(const PlaneU8& mask, int width, int height, int border) {
  double count = 0;
  for (int y = border; y < height - border; ++y) {
    for (int x = border; x < width - border; ++x) count += Counts(mask, x, y);
  }
  return count;
}

std::array<double, 2 * kRadius + 1> Window() {
  std::array<double, 2 * kRadius + 1> g;
  double sum = 0;
  for (int i = -kRadius; i <= kRadius; ++i) {
    sum += g[i + kRadius] = std::exp(-i * i / (2 * kSsimSigma * kSsimSigma));
  }
  for (double& v : g) v /= sum;
  return g;
}

// Sums over columns [border, width - border) of SSIM in rows [first, last) of one channel, by the
// separable window with zero padding, of pixels that count. Keeps its memory.
class SsimRows {
 public:
  void Sum(const float* a, const float* b, const PlaneU8& mask, int width, int height, int border,
           int first, int last, double* sums) {
    const int top = std::max(0, first - kRadius), rows = std::min(height, last + kRadius) - top;
    const size_t n = width, map = n * rows;
    along_x_.assign(kMaps * map, 0.0);
    maps_.resize(kMaps * n);
    for (int row = 0; row < rows; ++row) {
      const float *pa = a + (top + row) * n, *pb = b + (top + row) * n;
      for (size_t x = 0; x < n; ++x) {
        const double va = pa[x], vb = Counts(mask, static_cast<int>(x), top + row) ? pb[x] : va;
        const double of_maps[kMaps] = {va, vb, va * va, vb * vb, va * vb};
        for (size_t m = 0; m < kMaps; ++m) maps_[m * n + x] = of_maps[m];
      }
      for (size_t m = 0; m < kMaps; ++m)
        BlurRow(&maps_[m * n], width, &along_x_[m * map + row * n]);
    }
    for (int y = first; y < last; ++y) {
      std::fill(maps_.begin(), maps_.end(), 0.0);
      for (size_t m = 0; m < kMaps; ++m) {
        double* out = &maps_[m * n];
        const int up = std::max(-kRadius, -y), down = std::min(kRadius, height - 1 - y);
        for (int k = up; k <= down; ++k) {
          const double* in = &along_x_[m * map + (y + k - top) * n];
          const double weight = window_[k + kRadius];
          for (size_t x = 0; x < n; ++x) out[x] += weight * in[x];
        }
      }
      sums[y] = SumRow(mask, width, border, y);
    }
  }

 private:
  static constexpr size_t kMaps = 5;  // a, b, a^2, b^2, ab

  // Adds to `out`, which is zero.
  void BlurRow(const double* in, int width, double* out) const {
    for (int k = -kRadius; k <= kRadius; ++k) {
      const double weight = window_[k + kRadius];
      for (int x = std::max(0, -k); x < width - std::max(0, k); ++x) out[x] += weight * in[x + k];
    }
  }

  // Of the means in maps_.
  double SumRow(const PlaneU8& mask, int width, int border, int y) const {
    constexpr double kC1 = kSsimK1 * kSsimK1, kC2 = kSsimK2 * kSsimK2;
    const double *ma = maps_.data(), *mb = ma + width, *aa = mb + width, *bb = aa + width,
                 *ab = bb + width;
    double sum = 0;
    for (int x = border; x < width - border; ++x) {
      if (!Counts(mask, x, y)) continue;
      const double mean_product = ma[x] * mb[x], mean_squares = ma[x] * ma[x] + mb[x] * mb[x];
      sum += (2 * mean_product + kC1) * (2 * (ab[x] - mean_product) + kC2) /
             ((mean_squares + kC1) * (aa[x] + bb[x] - mean_squares + kC2));
    }
    return sum;
  }

  const std::array<double, 2 * kRadius + 1> window_ = Window();
  std::vector<double> along_x_;  // [kMaps][rows][width]
  std::vector<double> maps_;     // [kMaps][width]
};

using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Matrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

}  // namespace

absl::StatusOr<double> Psnr(const Planes& a, const Planes& b, const PlaneU8& mask) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(a, b, mask));
  if (CountedPixels(mask, a.plane_size()) == 0) {
    return InvalidInput("MASK_BLACK", "mask",
                        "no pixel counts by the mask; leave the images out, or mask less of them");
  }
  const double mse = MeanSquaredError(a, b, mask);
  return mse == 0 ? std::numeric_limits<double>::infinity() : -10 * std::log10(mse);
}

absl::StatusOr<double> Psnr(const ImageU8& a, const ImageU8& b, const PlaneU8& mask) {
  return Psnr(ToPlanes(a), ToPlanes(b), mask);
}

absl::StatusOr<double> Ssim(const Planes& a, const Planes& b, SsimBorder border, int threads,
                            const PlaneU8& mask) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(a, b, mask));
  const int margin = border == SsimBorder::kValid ? kRadius : 0;
  const double counted = CountedInside(mask, a.width, a.height, margin);
  if (counted == 0) {
    return InvalidInput(
        "IMAGE_TOO_SMALL", "image",
        absl::StrCat("SSIM's window needs 11x11 px, the images are ", a.width, "x", a.height,
                     mask.empty() ? "" : " with a mask", "; use zero padding or larger images"));
  }
  constexpr int kTaskRows = 64;  // the window's rows above and below are a small part of it
  const int end = a.height - margin, tasks = (end - margin + kTaskRows - 1) / kTaskRows;
  if (threads <= 0) threads = DefaultThreadCount();
  std::vector<SsimRows> of_threads(threads);
  std::vector<double> sums(size_t(a.channels) * a.height, 0.0);
  ParallelFor(threads, size_t(a.channels) * tasks, [&](size_t task, int thread) {
    const int c = static_cast<int>(task) / tasks;
    const int first = margin + static_cast<int>(task) % tasks * kTaskRows;
    of_threads[thread].Sum(a.plane(c), b.plane(c), mask, a.width, a.height, margin, first,
                           std::min(end, first + kTaskRows), &sums[size_t(c) * a.height]);
  });
  const double sum = std::accumulate(sums.begin(), sums.end(), 0.0);
  return sum / (counted * a.channels);
}

absl::StatusOr<double> Ssim(const ImageU8& a, const ImageU8& b, SsimBorder border,
                            const PlaneU8& mask) {
  return Ssim(ToPlanes(a), ToPlanes(b), border, /*threads=*/1, mask);
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

absl::Status ColorFitter::Add(const Planes& render, const Planes& truth, const PlaneU8& mask) {
  LITAGS_RETURN_IF_ERROR(CheckSizes(render, truth, mask));
  if (render.channels < 3) {
    return InvalidInput("NOT_A_COLOR_IMAGE", "image",
                        absl::StrCat("a colour fit needs 3 channels, got ", render.channels));
  }
  Eigen::Map<Matrix4> xtx(xtx_.data());
  Eigen::Map<Matrix34> xty(xty_.data());
  ForCounted(mask, render.plane_size(), [&](size_t i) {
    const Eigen::Vector4d x(render.plane(0)[i], render.plane(1)[i], render.plane(2)[i], 1);
    const Eigen::Vector3d y(truth.plane(0)[i], truth.plane(1)[i], truth.plane(2)[i]);
    xtx += x * x.transpose();
    xty += y * x.transpose();
  });
  count_ += CountedPixels(mask, render.plane_size());
  return absl::OkStatus();
}

absl::Status ColorFitter::Add(const ImageU8& render, const ImageU8& truth, const PlaneU8& mask) {
  return Add(ToPlanes(render), ToPlanes(truth), mask);
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
                                                  const std::vector<ImageU8>& truths,
                                                  const std::vector<PlaneU8>& masks) {
  if (renders.size() != truths.size()) {
    return InvalidInput("COUNT_MISMATCH", "image",
                        absl::StrCat(renders.size(), " renders but ", truths.size(),
                                     " true images; they must come in pairs"));
  }
  ColorFitter fitter;
  for (size_t i = 0; i < renders.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(fitter.Add(renders[i], truths[i], MaskOf(masks, i)));
  }
  CorrectedPsnr result;
  LITAGS_ASSIGN_OR_RETURN(result.fit, fitter.Fit());
  for (size_t i = 0; i < renders.size(); ++i) {
    const Planes render = ToPlanes(renders[i]), truth = ToPlanes(truths[i]);
    LITAGS_ASSIGN_OR_RETURN(const double corrected,
                            Psnr(result.fit.Apply(render), truth, MaskOf(masks, i)));
    result.corrected_db += corrected / renders.size();
  }
  return result;
}

}  // namespace litags
