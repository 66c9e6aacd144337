// LIME: a photo divided by its illumination, which is max(R, G, B) made smooth except at edges.
// Source: Guo, Li, Ling, "LIME: Low-Light Image Enhancement via Illumination Map Estimation", IEEE
// TIP 2017. Eq. (3) initial map, eq. (18)-(19) the sped-up solver, strategy III for its weights.
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "engine/enhance/enhance.h"

namespace litags {
namespace {

// alpha, gamma and strategy III (sigma 2 px) as in the paper's experiments.
constexpr double kAlpha = 0.15, kGamma = 0.8, kSigmaPx = 2, kEpsilon = 1e-3;
constexpr double kMaxPixels = 1 << 18;  // of the map, 591x443; Choice

using Plane = cv::Mat_<double>;

Plane LargestChannel(const ImageU8& photo) {
  Plane t(photo.height, photo.width);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const uint8_t* p = photo.pixel(x, y);
      t(y, x) = std::max({p[0], p[1], p[2]}) / 255.0;
    }
  }
  return t;
}

// Weight of the squared difference between each pixel and the next one in direction (dx, dy); 0
// past the border: 1 / (|blurred difference| + eps) / (|difference| + eps).
Plane Smoothness(const Plane& t, int dx, int dy) {
  Plane difference = Plane::zeros(t.size());
  const cv::Rect here(0, 0, t.cols - dx, t.rows - dy), next(dx, dy, t.cols - dx, t.rows - dy);
  Plane(t(next) - t(here)).copyTo(difference(here));
  Plane blurred;
  cv::GaussianBlur(difference, blurred, cv::Size(), kSigmaPx);
  Plane weight = Plane::zeros(t.size());
  for (int y = 0; y < here.height; ++y) {
    for (int x = 0; x < here.width; ++x) {
      weight(y, x) =
          1 / ((std::abs(blurred(y, x)) + kEpsilon) * (std::abs(difference(y, x)) + kEpsilon));
    }
  }
  return weight;
}

// argmin_t sum (t - t0)^2 + alpha sum_d w_d (difference_d t)^2.
Plane Refine(const Plane& t0) {
  const int n = t0.rows * t0.cols, width = t0.cols;
  const Plane across = Smoothness(t0, 1, 0), down = Smoothness(t0, 0, 1);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(size_t{3} * n);
  std::vector<double> diagonal(n, 1.0);
  const auto couple = [&](int i, int j, double w) {
    if (w == 0) return;
    diagonal[i] += kAlpha * w;
    diagonal[j] += kAlpha * w;
    entries.emplace_back(j, i, -kAlpha * w);  // j > i: the lower triangle
  };
  for (int y = 0, i = 0; y < t0.rows; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      couple(i, i + 1, across(y, x));
      couple(i, i + width, down(y, x));
    }
  }
  for (int i = 0; i < n; ++i) entries.emplace_back(i, i, diagonal[i]);
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());

  const Eigen::Map<const Eigen::VectorXd> b(t0[0], n);
  // Exact: weights span six decades, which is too much for conjugate gradients.
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  Plane t(t0.size());
  Eigen::Map<Eigen::VectorXd>(t[0], n) = solver.solve(b);
  return t;
}

// The refined illumination map. That of a large photo is found at kMaxPixels and enlarged: it is
// smooth, and the solver's time and memory grow faster than the photo.
Plane Illumination(const ImageU8& photo) {
  const Plane t0 = LargestChannel(photo);
  const double scale = std::sqrt(kMaxPixels / t0.total());
  if (scale >= 1) return Refine(t0);
  Plane small, out;
  cv::resize(t0, small, cv::Size(), scale, scale, cv::INTER_AREA);
  cv::resize(Refine(small), out, t0.size(), 0, 0, cv::INTER_LINEAR);
  return out;
}

ImageU8 Negative(ImageU8 image) {
  for (uint8_t& code : image.data) code = static_cast<uint8_t>(255 - code);
  return image;
}

ImageU8 Brighten(const ImageU8& photo) {
  const Plane t = Illumination(photo);
  ImageU8 out = photo;
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const double gain = std::pow(std::clamp(t(y, x), 1.0 / 255, 1.0), -kGamma);
      uint8_t* p = out.pixel(x, y);
      for (int c = 0; c < 3; ++c) p[c] = cv::saturate_cast<uint8_t>(gain * p[c]);
    }
  }
  return out;
}

}  // namespace

ImageU8 EnhanceLime(const ImageU8& photo) {
  double mean = 0;
  for (const uint8_t code : photo.data) mean += code / (255.0 * photo.data.size());
  return mean > kEnhancedMean ? Negative(Brighten(Negative(photo))) : Brighten(photo);
}

}  // namespace litags
