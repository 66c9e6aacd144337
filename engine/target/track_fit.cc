#include "engine/target/track_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/quantile.h"

namespace litags {
namespace {

constexpr int kRounds = 12;            // of reweighted least squares
constexpr int kAbsoluteRounds = 5;     // the first of them: least absolute deviations
constexpr double kAbsoluteFrom = 0.3;  // deviations; smaller residuals count alike
constexpr double kTukey = 4.685;       // deviations; 95 % efficient on normal noise
constexpr double kLeastNoise = 0.01;   // of a logarithm: no sensor is better than 1 %
constexpr double kPriorValues = 1;     // that say that an offset is 0
constexpr double kLeastPivot = 1e-12;  // keeps columns of zeros solvable

// body(begin, end): indices of the values of every point that has two or more.
template <class Body>
void ForEachTrack(absl::Span<const TrackValue> values, const Body& body) {
  for (size_t begin = 0, end = 0; begin < values.size(); begin = end) {
    while (end < values.size() && values[end].point == values[begin].point) ++end;
    if (end - begin >= 2) body(begin, end);
  }
}

// The normal equations of offsets, then coefficients.
struct NormalEquations {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd moment;
};

// Adds the values of one point, whose own number is eliminated.
void AddTrack(absl::Span<const TrackValue> track, const double* weights, size_t photos,
              NormalEquations* equations) {
  double total = 0, sum = 0;
  std::array<double, kTrackColumns> means = {};
  for (size_t s = 0; s < track.size(); ++s) {
    total += weights[s];
    sum += weights[s] * track[s].value;
    for (int k = 0; k < kTrackColumns; ++k) means[k] += weights[s] * track[s].columns[k];
  }
  if (total <= 0) return;
  for (double& m : means) m /= total;
  const double mean = sum / total;
  const auto n = static_cast<Eigen::Index>(photos);
  for (size_t s = 0; s < track.size(); ++s) {
    const double w = weights[s], value = track[s].value - mean;
    if (w == 0) continue;
    const int i = track[s].photo;
    equations->matrix(i, i) += w;
    for (size_t t = 0; t < track.size(); ++t)
      equations->matrix(i, track[t].photo) -= w * weights[t] / total;
    equations->moment(i) += w * value;
    for (int k = 0; k < kTrackColumns; ++k) {
      const double x = track[s].columns[k] - means[k];
      equations->matrix(i, n + k) += w * x;
      equations->matrix(n + k, i) += w * x;
      equations->moment(n + k) += w * x * value;
      for (int l = 0; l < kTrackColumns; ++l)
        equations->matrix(n + k, n + l) += w * x * (track[s].columns[l] - means[l]);
    }
  }
}

NormalEquations Assemble(size_t photos, absl::Span<const TrackValue> values,
                         const std::vector<double>& weights) {
  const auto size = static_cast<Eigen::Index>(photos) + kTrackColumns;
  NormalEquations equations{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size)};
  ForEachTrack(values, [&](size_t begin, size_t end) {
    AddTrack(values.subspan(begin, end - begin), &weights[begin], photos, &equations);
  });
  for (size_t i = 0; i < photos; ++i) equations.matrix(i, i) += kPriorValues;
  for (int k = 0; k < kTrackColumns; ++k) equations.matrix(photos + k, photos + k) += kLeastPivot;
  return equations;
}

// What the solution leaves of every value; 0 of a point's only value.
std::vector<double> Residuals(size_t photos, absl::Span<const TrackValue> values,
                              const std::vector<double>& weights, const Eigen::VectorXd& x) {
  std::vector<double> residuals(values.size(), 0.0);
  ForEachTrack(values, [&](size_t begin, size_t end) {
    double sum = 0, total = 0;
    for (size_t s = begin; s < end; ++s) {
      residuals[s] = values[s].value - x(values[s].photo);
      for (int k = 0; k < kTrackColumns; ++k)
        residuals[s] -= x(static_cast<Eigen::Index>(photos) + k) * values[s].columns[k];
      sum += weights[s] * residuals[s];
      total += weights[s];
    }
    const double mean = total > 0 ? sum / total : 0;
    for (size_t s = begin; s < end; ++s) residuals[s] -= mean;
  });
  return residuals;
}

// Standard deviation of a value; points' numbers took some of the residuals.
double NoiseOf(absl::Span<const TrackValue> values, const std::vector<double>& residuals) {
  std::vector<double> sizes;
  double points = 0;
  ForEachTrack(values, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) sizes.push_back(std::abs(residuals[s]));
    ++points;
  });
  if (sizes.empty()) return kLeastNoise;
  const double n = static_cast<double>(sizes.size());
  return std::max(kLeastNoise, DeviationFromMagnitudes(sizes) * std::sqrt(n / (n - points)));
}

double Weight(double residual, int round) {
  const double size = std::max(std::abs(residual), 1e-9);
  if (round < kAbsoluteRounds) return std::min(1.0, kAbsoluteFrom / size);
  const double rest = 1 - size * size / (kTukey * kTukey);
  return rest > 0 ? rest * rest : 0;
}

using Coefficients = Eigen::Matrix<double, kTrackColumns, 1>;

// The normal equations without the offsets. Those of the offsets are positive definite by
// kPriorValues, so that they need no pivots, which take longer. Those of the coefficients are not,
// where columns are 0.
struct Elimination {
  Eigen::LLT<Eigen::MatrixXd> offsets;
  Eigen::MatrixXd cross;   // offsets^-1 times the coefficients' columns
  Eigen::VectorXd moment;  // offsets^-1 times the offsets' moment
  Eigen::Matrix<double, kTrackColumns, kTrackColumns> information;  // of the coefficients
  Coefficients column_moment;
};

Elimination EliminateOffsets(size_t photos, const NormalEquations& equations) {
  const auto n = static_cast<Eigen::Index>(photos);
  const Eigen::MatrixXd cross = equations.matrix.topRightCorner(n, kTrackColumns);
  Elimination out;
  out.offsets.compute(equations.matrix.topLeftCorner(n, n));
  out.cross = out.offsets.solve(cross);
  out.moment = out.offsets.solve(equations.moment.head(n));
  out.information = equations.matrix.bottomRightCorner(kTrackColumns, kTrackColumns) -
                    cross.transpose() * out.cross;
  out.column_moment = equations.moment.tail(kTrackColumns) - cross.transpose() * out.moment;
  return out;
}

// Offsets, then coefficients.
Eigen::VectorXd SolutionOf(const Elimination& elimination) {
  const Coefficients columns = elimination.information.ldlt().solve(elimination.column_moment);
  Eigen::VectorXd x(elimination.moment.size() + kTrackColumns);
  x << elimination.moment - elimination.cross * columns, columns;
  return x;
}

// Standard errors of offsets from their mean. What all have in common no value tells.
std::vector<double> ErrorsOf(const Elimination& elimination, double noise) {
  const Eigen::Index n = elimination.moment.size();
  if (n == 0) return {};
  // The covariance is f f' + cross of_columns.
  const Eigen::MatrixXd f = elimination.offsets.matrixU().solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd of_columns =
      elimination.information.ldlt().solve(elimination.cross.transpose());
  const Eigen::VectorXd mean = Eigen::VectorXd::Constant(n, 1.0 / static_cast<double>(n));
  const Eigen::VectorXd with_mean =
      f * (f.transpose() * mean) + elimination.cross * (of_columns * mean);
  std::vector<double> errors;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double own = f.row(i).squaredNorm() + elimination.cross.row(i).dot(of_columns.col(i));
    const double variance = own - 2 * with_mean(i) + with_mean.mean();
    errors.push_back(noise * std::sqrt(std::max(0.0, variance)));
  }
  return errors;
}

ColumnEquations ColumnsOf(const Elimination& elimination) {
  ColumnEquations out;
  for (int k = 0; k < kTrackColumns; ++k) {
    out.moment[k] = elimination.column_moment(k);
    for (int l = 0; l < kTrackColumns; ++l) out.information[k][l] = elimination.information(k, l);
  }
  return out;
}

}  // namespace

TrackFit FitTracks(size_t photos, absl::Span<const TrackValue> values, const CancelToken& cancel) {
  for (size_t s = 0; s < values.size(); ++s) {
    LITAGS_CHECK(std::isfinite(values[s].value));
    LITAGS_CHECK(s == 0 || values[s - 1].point <= values[s].point);
  }
  TrackFit fit;
  fit.weights.assign(values.size(), 0.0);
  ForEachTrack(values, [&](size_t begin, size_t end) {
    std::fill(fit.weights.begin() + begin, fit.weights.begin() + end, 1.0);
  });
  Elimination solved = EliminateOffsets(photos, Assemble(photos, values, fit.weights));
  Eigen::VectorXd x = SolutionOf(solved);
  for (int round = 0; round < kRounds && !cancel.IsCancelled(); ++round) {
    const std::vector<double> residuals = Residuals(photos, values, fit.weights, x);
    fit.noise = NoiseOf(values, residuals);
    ForEachTrack(values, [&](size_t begin, size_t end) {
      for (size_t s = begin; s < end; ++s) {
        fit.weights[s] = Weight(residuals[s] / fit.noise, round);
      }
    });
    solved = EliminateOffsets(photos, Assemble(photos, values, fit.weights));
    x = SolutionOf(solved);
  }
  fit.offsets.assign(x.data(), x.data() + photos);
  fit.errors = ErrorsOf(solved, fit.noise);
  fit.columns = ColumnsOf(solved);
  return fit;
}

std::vector<ColumnEquations> EquationsOfGroups(absl::Span<const TrackValue> values,
                                               const TrackFit& fit, absl::Span<const int> group,
                                               int groups) {
  std::vector<ColumnEquations> out(groups);
  ForEachTrack(values, [&](size_t begin, size_t end) {
    double total = 0, mean = 0;
    std::array<double, kTrackColumns> means = {};
    for (size_t s = begin; s < end; ++s) {
      const double w = fit.weights[s];
      total += w;
      mean += w * (values[s].value - fit.offsets[values[s].photo]);
      for (int k = 0; k < kTrackColumns; ++k) means[k] += w * values[s].columns[k];
    }
    if (total <= 0) return;
    ColumnEquations& of_group = out[group[begin]];
    for (size_t s = begin; s < end; ++s) {
      const double w = fit.weights[s];
      const double value = values[s].value - fit.offsets[values[s].photo] - mean / total;
      for (int k = 0; k < kTrackColumns; ++k) {
        const double x = values[s].columns[k] - means[k] / total;
        of_group.moment[k] += w * x * value;
        for (int l = 0; l < kTrackColumns; ++l)
          of_group.information[k][l] += w * x * (values[s].columns[l] - means[l] / total);
      }
    }
  });
  return out;
}

}  // namespace litags
