#include "engine/pipeline/even_response.h"

#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/target/lamp_light.h"
#include "engine/target/response.h"
#include "engine/target/tone.h"
#include "engine/target/white_balance.h"

namespace litags {
namespace {

// Codes of light: sRGB is close to its power of 1 / 2.2.
constexpr double kCodePower = 1 / 2.2;

// What is common to the photos' colours once their own white balances are taken out.
std::array<double, 3> FindCast(absl::Span<const Photo> photos, absl::Span<const PlaneU8> masks,
                               const CaptureResponse& response, int threads) {
  std::vector<std::optional<Chromaticity>> found(photos.size());
  ParallelFor(threads, photos.size(),
              [&](size_t i, int) { found[i] = ChromaticityOf(photos[i], MaskOf(masks, i)); });
  std::vector<Chromaticity> chromaticities;
  for (size_t i = 0; i < photos.size(); ++i) {
    if (!found[i].has_value()) continue;
    const auto& gain = response.gains[i];
    chromaticities.push_back({(*found[i])[0] - std::log(gain[0] / gain[1]),
                              (*found[i])[1] - std::log(gain[2] / gain[1])});
  }
  return SceneWhiteBalance(chromaticities);
}

}  // namespace

Lamp EvenOutResponse(const Context& context, absl::Span<const Camera> cameras,
                     absl::Span<const PlaneU8> masks, double code_step,
                     std::vector<PointSighting>* sightings, std::vector<Photo>* photos,
                     std::vector<Brightening>* brightened) {
  brightened->assign(photos->size(), Brightening());
  if (context.recipe.tone.rule != Tone::kCapture) return {};
  const ReconstructOptions& options = context.options;
  std::vector<RadialFrame> frames;
  for (const Camera& c : cameras)
    frames.push_back({c.cx, c.cy, std::hypot(c.width, c.height) / 2.0});
  const std::vector<PointSample> samples =
      SamplePoints(*photos, *sightings, frames, masks, code_step);
  const CaptureResponse response =
      WithoutColorDrift(EstimateResponse(photos->size(), samples, context.cancel), samples);
  for (std::string& note : DescribeResponse(response)) context.Note(std::move(note));
  std::array<double, 3> cast = {1, 1, 1};
  if (options.white_balance == WhiteBalance::kScene) {
    cast = FindCast(*photos, masks, response, options.threads);
    if (std::string note = DescribeCast(cast); !note.empty()) context.Note(std::move(note));
  }
  ParallelFor(options.threads, photos->size(), [&](size_t i, int) {
    std::array<double, 3> gain = response.gains[i];
    for (int c = 0; c < 3; ++c) gain[c] *= cast[c];
    Photo& photo = (*photos)[i];
    Photo stored = photo;
    ApplyResponse(gain, response.vignette, frames[i], &photo);
    if (IsBlack(photo, MaskOf(masks, i), context.recipe.tone.rule)) {
      photo = std::move(stored);
      return;
    }
    (*brightened)[i] = Brightening(gain, response.vignette, frames[i]);
  });
  for (PointSighting& s : *sightings) {
    s.lit = std::pow(response.lamp_distance / s.distance, response.lamp_power);
  }
  return {static_cast<float>(response.lamp_power), static_cast<float>(response.lamp_distance)};
}

Lamp LampOfTargets(const Context& context, const Lamp& lamp,
                   absl::Span<const PointSighting> sightings, absl::Span<const Photo> photos,
                   absl::Span<const double> exposures, CaptureFacts facts) {
  if (lamp.power == 0) return {};
  std::vector<std::vector<PointSighting>> seen(photos.size());
  for (const PointSighting& s : sightings) seen[s.photo].push_back(s);
  std::vector<LampLight> light;
  for (size_t i = 0; i < photos.size(); ++i) {
    light.emplace_back(seen[i], photos[i].width, photos[i].height);
  }
  const int threads = context.options.threads;
  const double lit = CaptureGain(photos, exposures, threads, facts);
  facts.lamps = light;
  const double brighter = CaptureGain(photos, exposures, threads, facts) / lit;
  return {static_cast<float>(kCodePower * lamp.power),
          static_cast<float>(lamp.distance * std::pow(brighter, -1 / lamp.power))};
}

}  // namespace litags
