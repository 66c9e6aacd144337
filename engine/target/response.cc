#include "engine/target/response.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "absl/strings/str_format.h"
#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/target/median.h"
#include "engine/target/track_fit.h"

namespace litags {
namespace {

constexpr double kDarkest = 2;                       // codes, of a patch's mean in every channel
constexpr int kBrightest = 250 * kPhotoWhite / 255;  // of a patch's samples
constexpr double kStandardErrors = 3;                // a white balance is drawn to 1 by
constexpr double kSure = 4;                          // standard errors of the vignette
constexpr int kGroups = 8;                           // of points
constexpr double kSmooth = 1e-3;                     // see SolveVignette()
constexpr double kSampledShare = 0.98;
constexpr double kStop = std::numbers::ln2;
constexpr float kNearWhite = 0.9f * kPhotoWhite;

using Profile = std::array<double, kTrackColumns>;

// Whether the sensor's range held the light of a patch, so that it tells the light.
bool Told(const PatchLight& patch) {
  if (patch.brightest >= kBrightest) return false;
  for (int c = 0; c < 3; ++c) {
    if (patch.codes[c] < kDarkest || !(patch.light[c] > 0)) return false;
  }
  return true;
}

// ---- Vignette

// The slope of -log V, by t = r^2, is a sum of Bernstein polynomials of degree 2 with coefficients
// that are not negative, so that V falls. This is what the sum of each does to log V.
Profile ColumnsAt(double radius) {
  const double t = std::min(radius * radius, 1.0), u = 1 - t;
  return {-(1 - u * u * u) / 3, -t * t + 2 * t * t * t / 3, -t * t * t / 3};
}

Vignette VignetteOf(const Profile& p) {
  return {-p[0], p[0] - p[1], -(p[0] - 2 * p[1] + p[2]) / 3};
}

double FalloffAt(const Profile& p, double radius) {
  const Profile columns = ColumnsAt(radius);
  return -(p[0] * columns[0] + p[1] * columns[1] + p[2] * columns[2]);
}

// Solves the equations of some of the unknowns, the others are 0. Nothing if they are singular.
std::optional<Profile> SolveSome(const ColumnEquations& e, unsigned chosen) {
  std::array<std::array<double, kTrackColumns + 1>, kTrackColumns> m = {};
  for (int k = 0; k < kTrackColumns; ++k) {
    const bool free = chosen >> k & 1;
    for (int l = 0; l < kTrackColumns; ++l)
      m[k][l] = free && (chosen >> l & 1) ? e.information[k][l] : double(k == l);
    m[k][kTrackColumns] = free ? e.moment[k] : 0;
  }
  // Gauss-Jordan: the matrix is positive definite, pivots need no search.
  for (int k = 0; k < kTrackColumns; ++k) {
    if (!(m[k][k] > 0)) return std::nullopt;
    for (int i = 0; i < kTrackColumns; ++i) {
      if (i == k) continue;
      const double factor = m[i][k] / m[k][k];
      for (int l = k; l <= kTrackColumns; ++l) m[i][l] -= factor * m[k][l];
    }
  }
  Profile x;
  for (int k = 0; k < kTrackColumns; ++k) x[k] = m[k][kTrackColumns] / m[k][k];
  return x;
}

double Cost(const ColumnEquations& e, const Profile& x) {
  double cost = 0;
  for (int k = 0; k < kTrackColumns; ++k) {
    cost -= e.moment[k] * x[k];
    for (int l = 0; l < kTrackColumns; ++l) cost += x[k] * e.information[k][l] * x[l] / 2;
  }
  return cost;
}

// Least squares without negative coefficients: the best of all choices of what is 0. Coefficients
// are drawn to a straight line, so that no radius without samples gets a wild one.
Profile SolveVignette(ColumnEquations e) {
  constexpr Profile kBend = {1, -2, 1};
  double trace = 0;
  for (int k = 0; k < kTrackColumns; ++k) trace += e.information[k][k];
  for (int k = 0; k < kTrackColumns; ++k) {
    for (int l = 0; l < kTrackColumns; ++l)
      e.information[k][l] += kSmooth * trace * kBend[k] * kBend[l];
  }
  Profile best = {};
  double least = 0;  // of all 0
  for (unsigned chosen = 1; chosen < 1u << kTrackColumns; ++chosen) {
    const std::optional<Profile> x = SolveSome(e, chosen);
    if (!x.has_value()) continue;
    if (std::any_of(x->begin(), x->end(), [](double v) { return !(v >= 0) || std::isinf(v); }))
      continue;
    const double cost = Cost(e, *x);
    if (cost < least) least = cost, best = *x;
  }
  return best;
}

// The radius that 98 % of the samples lie within.
double SampledRadius(absl::Span<const PointSample> samples) {
  std::vector<double> radii;
  for (const PointSample& s : samples) radii.push_back(s.radius);
  if (radii.empty()) return 0;
  const auto at = radii.begin() + static_cast<size_t>(kSampledShare * (radii.size() - 1));
  std::nth_element(radii.begin(), at, radii.end());
  return std::min(*at, 1.0);
}

// Standard error of the falloff, from groups of points, each of which tells it.
double FalloffError(absl::Span<const TrackValue> values, const TrackFit& fit, double radius) {
  std::vector<int> group;
  for (const TrackValue& v : values)
    group.push_back((static_cast<uint32_t>(v.point) * 2654435761u) >> 29);
  static_assert(kGroups == 8, "three bits");
  double sum = 0, squares = 0;
  for (const ColumnEquations& e : EquationsOfGroups(values, fit, group, kGroups)) {
    const double falloff = FalloffAt(SolveVignette(e), radius);
    sum += falloff / kGroups;
    squares += falloff * falloff / kGroups;
  }
  return std::sqrt(std::max(0.0, squares - sum * sum) / (kGroups - 1));
}

Vignette EstimateVignette(size_t photos, absl::Span<const PointSample> samples) {
  std::vector<TrackValue> values;
  for (const PointSample& s : samples) {
    double light = 0;
    for (const double log : s.log_light) light += std::exp(log);
    values.push_back({s.point, s.photo, std::log(light), ColumnsAt(s.radius)});
  }
  const TrackFit fit = FitTracks(photos, values);
  Profile profile = SolveVignette(fit.columns);
  const double radius = SampledRadius(samples);
  const double falloff = FalloffAt(profile, radius);
  if (!(falloff >= kLeastVignette * kStop)) return {};
  if (!(falloff >= kSure * FalloffError(values, fit, radius))) return {};
  const double corner = FalloffAt(profile, 1);
  for (double& p : profile) p *= std::min(1.0, kMostVignette * kStop / corner);
  return VignetteOf(profile);
}

// ---- White balance

// Log of a channel's gain relative to green's, per photo.
std::vector<double> EstimateColor(size_t photos, absl::Span<const PointSample> samples,
                                  int channel) {
  std::vector<TrackValue> values;
  std::vector<int> samples_of(photos, 0);
  for (const PointSample& s : samples) {
    values.push_back({s.point, s.photo, s.log_light[channel] - s.log_light[1], {}});
    ++samples_of[s.photo];
  }
  const TrackFit fit = FitTracks(photos, values);
  std::vector<double> told;
  for (size_t i = 0; i < photos; ++i) {
    if (samples_of[i] >= kMinSightings) told.push_back(fit.offsets[i]);
  }
  const double middle = Median(told);
  std::vector<double> logs(photos, 0.0);
  for (size_t i = 0; i < photos; ++i) {
    if (samples_of[i] < kMinSightings) continue;
    const double log = fit.offsets[i] - middle, size = std::abs(log);
    const double error = kStandardErrors * fit.errors[i];
    if (size > error) logs[i] = log * (1 - error * error / (size * size));
  }
  return logs;
}

// Gains from logs per channel; all 1 if they hardly differ.
std::vector<std::array<double, 3>> GainsOf(const std::vector<double>& red,
                                           const std::vector<double>& blue) {
  double most = 0;
  for (size_t i = 0; i < red.size(); ++i)
    most = std::max({most, std::abs(red[i]), std::abs(blue[i])});
  std::vector<std::array<double, 3>> gains(red.size(), {1, 1, 1});
  if (most < kLeastColor) return gains;
  for (size_t i = 0; i < red.size(); ++i) gains[i] = {std::exp(red[i]), 1, std::exp(blue[i])};
  return gains;
}

// ---- Application

int16_t Changed(int16_t sample, float factor) {
  if (factor < 1 && sample > kNearWhite) {
    const float near = std::min(1.0f, (sample - kNearWhite) / (kPhotoWhite - kNearWhite));
    factor += (1 - factor) * near;
  }
  return SampleTable::Get()(LinearTable::Get()(sample) * factor);
}

}  // namespace

double LogVignette(const Vignette& vignette, double radius) {
  const double t = std::min(radius * radius, 1.0);
  return t * (vignette[0] + t * (vignette[1] + t * vignette[2]));
}

double CornerStops(const Vignette& vignette) {
  return std::max(0.0, -LogVignette(vignette, 1) / kStop);
}

std::vector<PointSample> SamplePoints(absl::Span<const Photo> photos,
                                      absl::Span<const PointSighting> sightings,
                                      absl::Span<const RadialFrame> frames,
                                      absl::Span<const PlaneU8> masks) {
  LITAGS_CHECK(frames.size() == photos.size());
  std::vector<PointSample> samples;
  for (size_t begin = 0, end = 0; begin < sightings.size(); begin = end) {
    const size_t before = samples.size();
    bool told = true;
    for (; end < sightings.size() && sightings[end].point == sightings[begin].point; ++end) {
      const PointSighting& s = sightings[end];
      const std::optional<PatchLight> patch =
          PatchLightAt(photos[s.photo], MaskOf(masks, s.photo), s.x, s.y);
      if (!patch.has_value()) continue;
      told = told && Told(*patch);
      if (!told) continue;
      const RadialFrame& frame = frames[s.photo];
      const double radius = std::hypot(s.x - frame.cx, s.y - frame.cy) / frame.half_diagonal;
      const auto& light = patch->light;
      samples.push_back(
          {s.point, s.photo, radius, {std::log(light[0]), std::log(light[1]), std::log(light[2])}});
    }
    if (!told) samples.resize(before);
  }
  return samples;
}

CaptureResponse EstimateResponse(size_t photos, absl::Span<const PointSample> samples) {
  std::vector<PointSample> finite;
  for (const PointSample& s : samples) {
    const auto ok = [](double x) { return std::isfinite(x) && std::abs(x) < 100; };
    if (ok(s.radius) && std::all_of(s.log_light.begin(), s.log_light.end(), ok))
      finite.push_back(s);
  }
  CaptureResponse response;
  response.vignette = EstimateVignette(photos, finite);
  response.gains = GainsOf(EstimateColor(photos, finite, 0), EstimateColor(photos, finite, 2));
  return response;
}

CaptureResponse WithoutColorDrift(const CaptureResponse& response,
                                  absl::Span<const PointSample> samples) {
  std::vector<PointSighting> sightings;
  for (const PointSample& s : samples) sightings.push_back({s.point, s.photo, 0, 0});
  std::array<std::vector<double>, 3> logs;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> gains;
    for (const auto& gain : response.gains) gains.push_back(gain[c]);
    logs[c] = WithoutDrift(gains, sightings);
    for (double& x : logs[c]) x = std::log(x);
  }
  return {GainsOf(logs[0], logs[2]), response.vignette};
}

void ApplyResponse(const std::array<double, 3>& gain, const Vignette& vignette,
                   const RadialFrame& frame, Photo* photo) {
  const bool even = vignette == Vignette{};
  if (even && gain == std::array<double, 3>{1, 1, 1}) return;
  std::array<float, 3> factor;
  for (int c = 0; c < 3; ++c) factor[c] = static_cast<float>(1 / gain[c]);
  for (int y = 0; y < photo->height; ++y) {
    for (int x = 0; x < photo->width; ++x) {
      float light = 1;
      if (!even) {
        const double dx = x + 0.5 - frame.cx, dy = y + 0.5 - frame.cy;
        const double radius = std::sqrt(dx * dx + dy * dy) / frame.half_diagonal;
        light = std::exp(static_cast<float>(-LogVignette(vignette, radius)));
      }
      int16_t* pixel = photo->pixel(x, y);
      for (int c = 0; c < 3; ++c) pixel[c] = Changed(pixel[c], factor[c] * light);
    }
  }
}

std::vector<std::string> DescribeResponse(const CaptureResponse& response) {
  std::vector<std::string> notes;
  double most = 0;
  for (const auto& gain : response.gains) {
    for (const double g : gain) most = std::max(most, std::exp(std::abs(std::log(g))) - 1);
  }
  if (most > 0) {
    notes.push_back(absl::StrFormat(
        "the photos' white balance differs by up to %.0f %%: evened out", 100 * most));
  }
  if (response.vignette != Vignette{}) {
    notes.push_back(absl::StrFormat("the lens makes corners %.1f stops darker: compensated",
                                    CornerStops(response.vignette)));
  }
  return notes;
}

}  // namespace litags
