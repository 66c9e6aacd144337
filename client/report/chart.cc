#include "client/report/chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/report/text.h"

namespace litags::report {
namespace {

// In units of the drawing, which are px where the page is as wide as that.
constexpr double kWidth = 420, kHeight = 215, kLeft = 52, kRight = 24, kTop = 26, kBottom = 44;
constexpr size_t kMostPoints = 400;  // nearly one a px
// Of a curve that is flat, or one point: the range of values around it, as a share of them.
constexpr double kLeastRange = 0.01;

// "0.25", "1.5k".
std::string Short(double value) {
  if (std::abs(value) >= 1000) return absl::StrFormat("%.4gk", value / 1000);
  return absl::StrFormat("%.4g", std::abs(value) < 1e-12 ? 0 : value);
}

// Where values stand in the drawing.
struct Scale {
  Scale(const std::vector<CurvePoint>& curve, double shown) {
    std::vector<double> values;
    for (const CurvePoint& point : curve) values.push_back(point.value);
    std::sort(values.begin(), values.end());
    const auto last = static_cast<double>(values.size() - 1);
    low = values.front();
    high = values[static_cast<size_t>(std::ceil(shown * last))];
    const double least = std::max(1e-6, kLeastRange * std::abs(high));
    if (high - low < least) std::tie(low, high) = std::pair(high - least / 2, high + least / 2);
    first = curve.front().iteration;
    end = std::max(curve.back().iteration, first + 1);
  }

  double X(double iteration) const {
    return kLeft + (iteration - first) / (end - first) * (kWidth - kLeft - kRight);
  }
  double Y(double value) const {
    const double share = (std::min(value, high) - low) / (high - low);
    return kHeight - kBottom - share * (kHeight - kTop - kBottom);
  }

  double low = 0, high = 1, first = 0, end = 1;
};

double SecondsAt(const std::vector<CurvePoint>& curve, double iteration) {
  const auto after = std::find_if(curve.begin(), curve.end(), [&](const CurvePoint& point) {
    return point.iteration >= iteration;
  });
  if (after == curve.begin()) return curve.front().seconds;
  if (after == curve.end()) return curve.back().seconds;
  const CurvePoint& before = *(after - 1);
  const double share = (iteration - before.iteration) / (after->iteration - before.iteration);
  return before.seconds + share * (after->seconds - before.seconds);
}

Html Text(double x, double y, const std::string& style, const std::string& text) {
  return El("text", {{"x", Px(x)}, {"y", Px(y)}, {"class", style}}, {text});
}

Html Axes(const std::vector<CurvePoint>& curve, const Scale& scale) {
  Html axes;
  for (const double value : Ticks(scale.low, scale.high, 4)) {
    const double y = scale.Y(value);
    axes += El("line", {{"x1", Px(kLeft)},
                        {"x2", Px(kWidth - kRight)},
                        {"y1", Px(y)},
                        {"y2", Px(y)},
                        {"class", "grid"}});
    axes += Text(kLeft - 6, y + 4, "tick end", Short(value));
  }
  for (const double iteration : Ticks(scale.first, scale.end, 5)) {
    if (iteration != std::round(iteration)) continue;
    const double x = scale.X(iteration);
    axes += Text(x, kHeight - 26, "tick mid", Short(iteration));
    axes += Text(x, kHeight - 10, "time mid", DurationText(SecondsAt(curve, iteration)));
  }
  return axes;
}

std::string Line(const std::vector<CurvePoint>& curve, const Scale& scale) {
  const size_t step = (curve.size() + kMostPoints - 1) / kMostPoints;
  std::string line;
  for (size_t i = 0; i < curve.size(); ++i) {
    if (i % step != 0 && i + 1 != curve.size()) continue;
    absl::StrAppend(&line, line.empty() ? "" : " ", Px(scale.X(curve[i].iteration)), ",",
                    Px(scale.Y(curve[i].value)));
  }
  return line;
}

}  // namespace

std::vector<double> Ticks(double low, double high, int count) {
  const double raw = (high - low) / count;
  std::vector<double> ticks;
  if (!(raw > 0) || !std::isfinite(raw)) return {low};
  const double power = std::pow(10, std::floor(std::log10(raw)));
  constexpr std::array<double, 4> kSteps = {1, 2, 5, 10};
  const double step = power * *std::find_if(kSteps.begin(), kSteps.end() - 1,
                                            [&](double s) { return s * power >= raw; });
  const double first = std::ceil(low / step - 1e-9);
  for (int i = 0; (first + i) * step <= high + 1e-9 * step; ++i)
    ticks.push_back((first + i) * step);
  return ticks;
}

Html Chart(const std::string& name, const std::string& unit, const std::vector<CurvePoint>& curve,
           double shown) {
  if (curve.empty()) return {};
  const Scale scale(curve, shown);
  const CurvePoint& last = curve.back();
  const std::string value = absl::StrCat(Short(last.value), unit.empty() ? "" : " ", unit);
  const std::string summary =
      absl::StrCat(name, ": ", value, " at iteration ", Short(last.iteration));
  return El(
      "svg",
      {{"class", "chart"},
       {"viewBox", absl::StrFormat("0 0 %g %g", kWidth, kHeight)},
       {"role", "img"},
       {"aria-label", summary}},
      {Text(0, 12, "name", name), Text(kWidth - kRight, 12, "value end", value), Axes(curve, scale),
       El("polyline", {{"points", Line(curve, scale)}, {"class", "curve"}}),
       El("circle", {{"cx", Px(scale.X(last.iteration))},
                     {"cy", Px(scale.Y(last.value))},
                     {"r", "3.5"},
                     {"class", "last"}})});
}

}  // namespace litags::report
