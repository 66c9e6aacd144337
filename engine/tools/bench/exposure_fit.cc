#include "engine/tools/bench/exposure_fit.h"

#include <Eigen/Dense>
#include <cmath>

namespace litags {
namespace {

constexpr int kBands = ExposureRule::kBands;
constexpr double kRidge = 0.003, kBlur = 0.3, kWindow = 5, kStep = 0.25;  // stops
constexpr int kFolds = 5;

using Vector = Eigen::Matrix<double, kBands, 1>;
using Matrix = Eigen::Matrix<double, kBands, kBands>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, kBands>;  // one row a gain

struct Example {
  Rows shares;             // ln(share + least)
  Eigen::VectorXd scores;  // that do not depend on the weights
};

int Gains() { return static_cast<int>(std::lround(2 * kWindow / kStep)) + 1; }

double GainAt(int i) { return -kWindow + kStep * i; }

Eigen::VectorXd Wanted() {
  Eigen::VectorXd wanted(Gains());
  for (int i = 0; i < Gains(); ++i) wanted[i] = std::exp(-0.5 * std::pow(GainAt(i) / kBlur, 2));
  return wanted / wanted.sum();
}

Example ExampleOf(const ExposureCase& one, double lightness) {
  const int every = static_cast<int>(std::lround(kStep * LightHistogram::kBinsPerStop));
  const int last = (Gains() - 1) / 2 * every;
  const std::vector<BandShares> rows = LogBandShares(one.light, -last, last);
  Example example{Rows(Gains(), kBands), Eigen::VectorXd(Gains())};
  for (int i = 0; i < Gains(); ++i) {
    example.shares.row(i) = Eigen::Map<const Vector>(rows[size_t(i) * every].data());
    example.scores[i] = LightnessScore(Lightness(one.light) + GainAt(i), lightness);
  }
  return example;
}

struct Loss {
  double value = 0;
  Vector gradient = Vector::Zero();
  Matrix hessian = Matrix::Zero();
};

// Cross entropy, mean over the examples, and the ridge on weights in units of the shares' spread.
Loss LossOf(const std::vector<Example>& examples, const Vector& weights, const Vector& variance) {
  const Eigen::VectorXd wanted = Wanted();
  Loss loss;
  for (const Example& example : examples) {
    const Eigen::VectorXd scores = example.shares * weights + example.scores;
    const double best = scores.maxCoeff();
    Eigen::VectorXd chosen = (scores.array() - best).exp();
    const double sum = chosen.sum();
    chosen /= sum;
    const Vector mean = example.shares.transpose() * chosen;
    loss.value += best + std::log(sum) - wanted.dot(scores);
    loss.gradient += mean - example.shares.transpose() * wanted;
    loss.hessian +=
        example.shares.transpose() * chosen.asDiagonal() * example.shares - mean * mean.transpose();
  }
  const auto n = static_cast<double>(examples.size());
  const Vector ridge = kRidge * variance;
  loss.value = loss.value / n + 0.5 * weights.dot(ridge.cwiseProduct(weights));
  loss.gradient = loss.gradient / n + ridge.cwiseProduct(weights);
  loss.hessian /= n;
  loss.hessian.diagonal() += ridge;
  return loss;
}

Vector VarianceOf(const std::vector<Example>& examples) {
  Vector sum = Vector::Zero(), squares = Vector::Zero();
  for (const Example& example : examples) {
    sum += example.shares.colwise().sum().transpose();
    squares += example.shares.array().square().matrix().colwise().sum().transpose();
  }
  const double n = double(examples.size()) * Gains();
  return squares / n - (sum / n).array().square().matrix();
}

// Newton's method with steps halved while they lead upward; the loss is convex.
Vector Minimize(const std::vector<Example>& examples) {
  const Vector variance = VarianceOf(examples);
  Vector weights = Vector::Zero();
  Loss loss = LossOf(examples, weights, variance);
  for (int iteration = 0; iteration < 50; ++iteration) {
    Vector step = loss.hessian.ldlt().solve(loss.gradient);
    Loss next;
    int halvings = 0;
    do {
      next = LossOf(examples, weights - step, variance);
      if (next.value <= loss.value) break;
      step /= 2;
    } while (++halvings < 30);
    if (next.value > loss.value) break;
    weights -= step;
    const bool done = loss.value - next.value < 1e-10;
    loss = next;
    if (done) break;
  }
  return weights;
}

}  // namespace

ExposureRule FitExposureRule(const ExposurePopulation& population,
                             const std::function<bool(const ExposureCase&)>& use) {
  ExposureRule rule = {};
  double photos = 0;
  for (const ExposureCase& one : population.cases) {
    if (one.kind != "plain" || !use(one)) continue;
    rule.lightness += Lightness(one.light);
    ++photos;
  }
  rule.lightness /= std::max(photos, 1.0);
  std::vector<Example> examples;
  for (const ExposureCase& one : population.cases) {
    if (one.fit && use(one)) examples.push_back(ExampleOf(one, rule.lightness));
  }
  const Vector weights = Minimize(examples);
  for (int band = 0; band < kBands; ++band) rule.weights[band] = weights[band];
  return rule;
}

std::vector<double> CrossValidate(const ExposurePopulation& population) {
  std::vector<double> errors(population.cases.size());
  for (int fold = 0; fold < kFolds; ++fold) {
    const ExposureRule rule = FitExposureRule(population, [&](const ExposureCase& one) {
      return one.photo % kFolds != static_cast<size_t>(fold);
    });
    for (size_t i = 0; i < errors.size(); ++i) {
      const ExposureCase& one = population.cases[i];
      if (one.photo % kFolds != static_cast<size_t>(fold)) continue;
      errors[i] = std::log2(ExposureGain(one.light, rule)) - one.stops;
    }
  }
  return errors;
}

}  // namespace litags
