#include "engine/target/response.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "absl/strings/str_format.h"
#include "engine/core/check.h"
#include "engine/core/mask.h"
#include "engine/core/quantile.h"
#include "engine/target/track_fit.h"

namespace litags {
namespace {

constexpr double kStandardErrors = 3;  // a white balance is drawn to 1 by
constexpr double kSure = 4;            // standard errors of the vignette
constexpr int kGroups = 8;             // of points
constexpr double kSmooth = 1e-3;       // see SolveVignette()
constexpr double kSampledShare = 0.98;
constexpr double kStop = std::numbers::ln2;
constexpr float kNearWhite = 0.9f * kPhotoWhite;
constexpr double kLeastLight = 1e-9;  // of a channel: as good as none in a sum

// What the light of a sample falls by: three numbers of the vignette, and the lamp's power.
using Falloff = std::array<double, kTrackColumns>;
constexpr int kVignetteColumns = 3, kLampColumn = 3;
static_assert(kTrackColumns == kLampColumn + 1);

// Whether the sensor's range held the light of a patch, so that it tells the sum of the light.
bool Told(const PatchLight& patch, double code_step) {
  return patch.brightest < kTintedSample && TellsLight(patch, code_step);
}

// Whether it tells the light of every channel.
bool TellsColor(const PatchLight& patch, double code_step) {
  return AboveBlack(patch, code_step) &&
         std::all_of(patch.light.begin(), patch.light.end(), [](double y) { return y > 0; });
}

// ---- Vignette and lamp

// The slope of -log V, by t = r^2, is a sum of Bernstein polynomials of degree 2 with coefficients
// that are not negative, so that V falls. This is what the sum of each does to log V.
std::array<double, kVignetteColumns> VignetteColumns(double radius) {
  const double t = std::min(radius * radius, 1.0), u = 1 - t;
  return {-(1 - u * u * u) / 3, -t * t + 2 * t * t * t / 3, -t * t * t / 3};
}

Vignette VignetteOf(const Falloff& f) {
  return {-f[0], f[0] - f[1], -(f[0] - 2 * f[1] + f[2]) / 3};
}

// -log V
double VignetteAt(const Falloff& f, double radius) {
  const auto columns = VignetteColumns(radius);
  return -(f[0] * columns[0] + f[1] * columns[1] + f[2] * columns[2]);
}

// Solves the equations of some of the unknowns, the others are 0. Nothing if they are singular.
std::optional<Falloff> SolveSome(const ColumnEquations& e, unsigned chosen) {
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
  Falloff x;
  for (int k = 0; k < kTrackColumns; ++k) x[k] = m[k][kTrackColumns] / m[k][k];
  return x;
}

double Cost(const ColumnEquations& e, const Falloff& x) {
  double cost = 0;
  for (int k = 0; k < kTrackColumns; ++k) {
    cost -= e.moment[k] * x[k];
    for (int l = 0; l < kTrackColumns; ++l) cost += x[k] * e.information[k][l] * x[l] / 2;
  }
  return cost;
}

// Least squares without negative coefficients: the best of all choices of what is 0. The vignette's
// are drawn to a straight line, so that no radius without samples gets a wild one.
Falloff SolveFreely(ColumnEquations e) {
  constexpr std::array<double, kVignetteColumns> kBend = {1, -2, 1};
  double trace = 0;
  for (int k = 0; k < kVignetteColumns; ++k) trace += e.information[k][k];
  for (int k = 0; k < kVignetteColumns; ++k) {
    for (int l = 0; l < kVignetteColumns; ++l)
      e.information[k][l] += kSmooth * trace * kBend[k] * kBend[l];
  }
  Falloff best = {};
  double least = 0;  // of all 0
  for (unsigned chosen = 1; chosen < 1u << kTrackColumns; ++chosen) {
    const std::optional<Falloff> x = SolveSome(e, chosen);
    if (!x.has_value()) continue;
    if (std::any_of(x->begin(), x->end(), [](double v) { return !(v >= 0) || std::isinf(v); }))
      continue;
    const double cost = Cost(e, *x);
    if (cost < least) least = cost, best = *x;
  }
  return best;
}

// The same with the lamp's power given.
Falloff SolveVignette(ColumnEquations e, double power) {
  for (int k = 0; k < kTrackColumns; ++k) {
    e.moment[k] -= power * e.information[k][kLampColumn];
    e.information[k][kLampColumn] = e.information[kLampColumn][k] = 0;
  }
  e.moment[kLampColumn] = 0;
  e.information[kLampColumn][kLampColumn] = 1;
  Falloff f = SolveFreely(e);
  f[kLampColumn] = power;
  return f;
}

// The value that this share of the samples lie within.
template <class ValueOf>
double Quantile(absl::Span<const PointSample> samples, double share, const ValueOf& value_of) {
  std::vector<double> values;
  for (const PointSample& s : samples) values.push_back(value_of(s));
  return QuantileInPlace(values, share);
}

// Standard error of what `solve` makes of the equations, from groups of points, each of which tells
// it.
template <class Solve>
double ErrorOf(absl::Span<const TrackValue> values, const TrackFit& fit, const Solve& solve) {
  std::vector<int> group;
  for (const TrackValue& v : values)
    group.push_back((static_cast<uint32_t>(v.point) * 2654435761u) >> 29);
  static_assert(kGroups == 8, "three bits");
  double sum = 0, squares = 0;
  for (const ColumnEquations& e : EquationsOfGroups(values, fit, group, kGroups)) {
    const double result = solve(e);
    sum += result / kGroups;
    squares += result * result / kGroups;
  }
  return std::sqrt(std::max(0.0, squares - sum * sum) / (kGroups - 1));
}

// The lamp's power, 0 if samples do not show one for sure.
double EstimateLamp(absl::Span<const TrackValue> values, const TrackFit& fit,
                    absl::Span<const PointSample> samples) {
  const auto log_distance = [](const PointSample& s) { return s.log_distance; };
  const double spread = Quantile(samples, 0.9, log_distance) - Quantile(samples, 0.1, log_distance);
  const auto power_of = [](const ColumnEquations& e) { return SolveFreely(e)[kLampColumn]; };
  const double power = power_of(fit.columns);
  const double of_lamp = std::min(power, kMostLamp);
  if (!(of_lamp * spread >= kLeastLamp * kStop)) return 0;
  if (!(power >= kSure * ErrorOf(values, fit, power_of))) return 0;
  return of_lamp;
}

Vignette EstimateVignette(absl::Span<const TrackValue> values, const TrackFit& fit,
                          absl::Span<const PointSample> samples, double lamp_power) {
  const double sampled =
      Quantile(samples, kSampledShare, [](const PointSample& s) { return s.radius; });
  const double radius = std::min(sampled, 1.0);
  const auto falloff_of = [&](const ColumnEquations& e) {
    return VignetteAt(SolveVignette(e, lamp_power), radius);
  };
  const double falloff = falloff_of(fit.columns);
  if (!(falloff >= kLeastVignette * kStop)) return {};
  if (!(falloff >= kSure * ErrorOf(values, fit, falloff_of))) return {};
  Falloff f = SolveVignette(fit.columns, lamp_power);
  const double corner = VignetteAt(f, 1);
  for (double& p : f) p *= std::min(1.0, kMostVignette * kStop / corner);
  return VignetteOf(f);
}

// Sets all of the response but the gains.
void EstimateFalloff(size_t photos, absl::Span<const PointSample> samples,
                     const CancelToken& cancel, CaptureResponse* response) {
  std::vector<TrackValue> values;
  for (const PointSample& s : samples) {
    double light = 0;
    for (const double log : s.log_light) light += std::exp(log);
    const auto [a, b, c] = VignetteColumns(s.radius);
    values.push_back({s.point, s.photo, std::log(light), {a, b, c, -s.log_distance}});
  }
  TrackFit fit = FitTracks(photos, values, cancel);
  response->lamp_power = EstimateLamp(values, fit, samples);
  if (response->lamp_power == 0) {  // nor is there one that weighs samples
    for (TrackValue& v : values) v.columns[kLampColumn] = 0;
    fit = FitTracks(photos, values, cancel);
  }
  response->lamp_distance =
      std::exp(Quantile(samples, 0.5, [](const PointSample& s) { return s.log_distance; }));
  response->vignette = EstimateVignette(values, fit, samples, response->lamp_power);
}

// ---- White balance

// Log of a channel's gain relative to green's, per photo.
std::vector<double> EstimateColor(size_t photos, absl::Span<const PointSample> samples, int channel,
                                  const CancelToken& cancel) {
  std::vector<TrackValue> values;
  std::vector<int> samples_of(photos, 0);
  for (const PointSample& s : samples) {
    if (!s.tells_color) continue;
    values.push_back({s.point, s.photo, s.log_light[channel] - s.log_light[1], {}});
    ++samples_of[s.photo];
  }
  const TrackFit fit = FitTracks(photos, values, cancel);
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

// 1 / V of the pixel.
float EvenedLight(const Vignette& vignette, const RadialFrame& frame, int x, int y) {
  const double dx = x + 0.5 - frame.cx, dy = y + 0.5 - frame.cy;
  const double radius = std::sqrt(dx * dx + dy * dy) / frame.half_diagonal;
  return std::exp(static_cast<float>(-LogVignette(vignette, radius)));
}

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
                                      absl::Span<const PlaneU8> masks, double code_step) {
  LITAGS_CHECK(frames.size() == photos.size());
  std::vector<PointSample> samples;
  for (size_t begin = 0, end = 0; begin < sightings.size(); begin = end) {
    const size_t before = samples.size();
    bool told = true, tells_color = true;
    for (; end < sightings.size() && sightings[end].point == sightings[begin].point; ++end) {
      const PointSighting& s = sightings[end];
      const std::optional<PatchLight> patch =
          PatchLightAt(photos[s.photo], MaskOf(masks, s.photo), s.x, s.y);
      if (!patch.has_value()) continue;
      told = told && Told(*patch, code_step);
      if (!told) continue;
      tells_color = tells_color && TellsColor(*patch, code_step);
      const RadialFrame& frame = frames[s.photo];
      const double radius = std::hypot(s.x - frame.cx, s.y - frame.cy) / frame.half_diagonal;
      PointSample sample{s.point, s.photo, radius, {}, std::log(s.distance)};
      for (int c = 0; c < 3; ++c)
        sample.log_light[c] = std::log(std::max(patch->light[c], kLeastLight));
      samples.push_back(sample);
    }
    if (!told) samples.resize(before);
    for (size_t i = before; i < samples.size(); ++i) samples[i].tells_color = tells_color;
  }
  return samples;
}

CaptureResponse EstimateResponse(size_t photos, absl::Span<const PointSample> samples,
                                 const CancelToken& cancel) {
  std::vector<PointSample> finite;
  for (const PointSample& s : samples) {
    const auto ok = [](double x) { return std::isfinite(x) && std::abs(x) < 100; };
    if (ok(s.radius) && ok(s.log_distance) &&
        std::all_of(s.log_light.begin(), s.log_light.end(), ok))
      finite.push_back(s);
  }
  CaptureResponse response;
  EstimateFalloff(photos, finite, cancel, &response);
  response.gains =
      GainsOf(EstimateColor(photos, finite, 0, cancel), EstimateColor(photos, finite, 2, cancel));
  return response;
}

CaptureResponse WithoutColorDrift(const CaptureResponse& response,
                                  absl::Span<const PointSample> samples) {
  std::vector<PointSighting> sightings;
  for (const PointSample& s : samples) {
    if (s.tells_color) sightings.push_back({s.point, s.photo, 0, 0});
  }
  std::array<std::vector<double>, 3> logs;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> gains;
    for (const auto& gain : response.gains) gains.push_back(gain[c]);
    logs[c] = WithoutDrift(gains, sightings);
    for (double& x : logs[c]) x = std::log(x);
  }
  CaptureResponse out = response;
  out.gains = GainsOf(logs[0], logs[2]);
  return out;
}

Brightening::Brightening(const std::array<double, 3>& gain, const Vignette& vignette,
                         const RadialFrame& frame)
    : vignette_(vignette), frame_(frame) {
  for (int c = 0; c < 3; ++c) factor_[c] = static_cast<float>(1 / gain[c]);
  none_ = vignette == Vignette{} && *std::min_element(gain.begin(), gain.end()) >= 1;
}

std::array<float, 3> Brightening::At(int x, int y) const {
  std::array<float, 3> out = {1, 1, 1};
  if (none_) return out;
  const float light = EvenedLight(vignette_, frame_, x, y);
  for (int c = 0; c < 3; ++c) out[c] = std::max(1.0f, factor_[c] * light);
  return out;
}

Photo Brightening::Undone(const Photo& photo) const {
  constexpr int16_t kMost = std::numeric_limits<int16_t>::max();  // what is brighter is lost
  Photo out = photo;
  if (none_) return out;
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const std::array<float, 3> grew = At(x, y);
      int16_t* pixel = out.pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        if (grew[c] == 1) continue;
        pixel[c] = pixel[c] == kMost ? int16_t{kPhotoWhite}
                                     : SampleTable::Get()(LinearTable::Get()(pixel[c]) / grew[c]);
      }
    }
  }
  return out;
}

void ApplyResponse(const std::array<double, 3>& gain, const Vignette& vignette,
                   const RadialFrame& frame, Photo* photo) {
  const bool even = vignette == Vignette{};
  if (even && gain == std::array<double, 3>{1, 1, 1}) return;
  std::array<float, 3> factor;
  for (int c = 0; c < 3; ++c) factor[c] = static_cast<float>(1 / gain[c]);
  for (int y = 0; y < photo->height; ++y) {
    for (int x = 0; x < photo->width; ++x) {
      const float light = even ? 1 : EvenedLight(vignette, frame, x, y);
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
    notes.push_back(absl::StrFormat(
        "%s corners %.1f stops darker: compensated",
        response.lamp_power > 0 ? "the lens and the lamp's beam make" : "the lens makes",
        CornerStops(response.vignette)));
  }
  if (response.lamp_power > 0) {
    notes.push_back(absl::StrFormat(
        "light falls with the distance from the camera, to the power of %.1f, as that of a lamp "
        "that it carries: evened out",
        response.lamp_power));
  }
  return notes;
}

}  // namespace litags
