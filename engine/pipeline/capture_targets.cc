#include "engine/pipeline/capture_targets.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"
#include "engine/pipeline/even_response.h"
#include "engine/pipeline/photo_progress.h"
#include "engine/prior/structure_prior.h"
#include "engine/target/black_lift.h"
#include "engine/target/information.h"
#include "engine/target/photometric.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

// Where the photos saw the model's points, sorted by point.
std::vector<PointSighting> Sightings(const PosedPhotos& posed) {
  const SparseModel& model = posed.model;
  std::vector<int> photo_of(model.views.size(), -1);
  for (size_t i = 0; i < posed.size(); ++i) photo_of[posed.model_view[i]] = static_cast<int>(i);
  std::vector<PointSighting> sightings;
  for (size_t p = 0; p < model.points.size(); ++p) {
    for (const TrackElement& element : model.points[p].track) {
      const int photo = photo_of[element.view];
      if (photo < 0) continue;
      const Camera& camera = posed.views[photo].camera;
      const auto xyz = camera.CamFromWorld(model.points[p].xyz);
      if (xyz[2] <= 0) continue;
      const auto [x, y] = camera.Project(xyz);
      sightings.push_back({static_cast<int>(p), photo, x, y, std::hypot(xyz[0], xyz[1], xyz[2])});
    }
  }
  return sightings;
}

std::function<void(const std::string&)> Reporter(const Context& context) {
  return [&context](const std::string& line) { context.progress(Stage::kPreparing, line); };
}

absl::Status AddTargets(const Context& context, const PosedPhotos& posed, const CaptureFacts& facts,
                        CaptureTargets* out) {
  const ToneOptions& tone = context.recipe.tone;
  const int threads = context.options.threads;
  PhotoProgress made(Reporter(context), "targets", posed.size());
  const auto done = [&](int thread) { made.Done(thread); };
  LITAGS_ASSIGN_OR_RETURN(
      std::vector<ToneTarget> targets,
      MakeTargets(out->photos, out->exposures, tone, threads, facts, done, context.cancel));
  std::vector<double> gains;
  for (size_t i = 0; i < targets.size(); ++i) {
    out->targets.push_back(std::move(targets[i].image));
    gains.push_back(targets[i].gain);
    if (targets[i].reached) continue;
    context.Note(absl::StrCat(posed.views[i].name, " stays darker than wanted: no gain brings ",
                              "it there; leave it out, or mask what no light fell on"));
  }
  out->noise_at_black = NoiseAtBlack(out->photos, gains, threads, posed.masks, posed.noise_kept);
  out->rounding = RoundingNoise(tone, MedianInPlace(gains), posed.code_step);
  return absl::OkStatus();
}

std::vector<PlaneU8> Information(const Context& context, const CaptureTargets& made,
                                 const PosedPhotos& posed,
                                 absl::Span<const Brightening> brightened) {
  std::vector<const Photo*> photos, targets;
  for (const Photo& photo : made.photos) photos.push_back(&photo);
  for (const Photo& target : made.targets) targets.push_back(&target);
  return InformationWeights(photos, targets, made.exposures, posed.masks, brightened,
                            posed.code_step, context.options.threads, context.cancel);
}

// Photos of a rig were exposed at once: each gets the mean of theirs (in the log domain) by how
// many points they saw. Those of a rig that saw none stay as they are.
void ShareExposures(const RigViews& rigs, const std::vector<View>& views,
                    const std::vector<PointSighting>& sightings, std::vector<double>* exposures) {
  std::vector<double> points(views.size(), 0);
  for (const PointSighting& seen : sightings) ++points[seen.photo];
  struct Sum {
    double logs = 0, weight = 0;
  };
  std::map<std::string, Sum> sums;
  for (size_t i = 0; i < views.size(); ++i) {
    const auto view = rigs.find(views[i].name);
    if (view == rigs.end()) continue;
    Sum& sum = sums[view->second.rig];
    sum.logs += points[i] * std::log((*exposures)[i]);
    sum.weight += points[i];
  }
  for (size_t i = 0; i < views.size(); ++i) {
    const auto view = rigs.find(views[i].name);
    if (view == rigs.end()) continue;
    const Sum& sum = sums[view->second.rig];
    if (sum.weight > 0) (*exposures)[i] = std::exp(sum.logs / sum.weight);
  }
}

}  // namespace

absl::StatusOr<CaptureTargets> MakeCaptureTargets(const Context& context, const PosedPhotos& posed,
                                                  std::vector<Photo> photos) {
  const Recipe& recipe = context.recipe;
  std::vector<PointSighting> sightings = Sightings(posed);
  std::vector<Camera> cameras;
  for (const View& view : posed.views) cameras.push_back(view.camera);
  CaptureTargets made;
  std::vector<Brightening> brightened;
  const Lamp lamp = EvenOutResponse(context, cameras, posed.masks, posed.code_step, &sightings,
                                    &photos, &brightened);
  LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  made.photos = std::move(photos);
  made.exposures =
      WithoutDrift(RelativeExposures(made.photos, sightings, posed.masks, posed.stated_exposures,
                                     posed.code_step, context.options.threads, context.cancel),
                   sightings);
  ShareExposures(posed.rig_views, posed.views, sightings, &made.exposures);
  LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  const CaptureFacts facts = {
      .masks = posed.masks, .brightened = brightened, .noise_floor = posed.noise_floor};
  LITAGS_RETURN_IF_ERROR(AddTargets(context, posed, facts, &made));
  made.lamp = LampOfTargets(context, lamp, sightings, made.photos, made.exposures, facts);
  LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  if (recipe.lita && recipe.information_weights) {
    made.information = Information(context, made, posed, brightened);
    LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  }
  if (recipe.lita && recipe.use_prior) {
    // The prior's scale is one for the whole capture, so all photos go in together.
    PhotoProgress done(Reporter(context), "structure maps", posed.size());
    LITAGS_ASSIGN_OR_RETURN(
        CapturePriors priors,
        ComputeCapturePriors(made.photos, context.options.threads, context.cancel, posed.masks,
                             [&](int thread) { done.Done(thread); }));
    made.structure = std::move(priors.maps);
  }
  return made;
}

absl::StatusOr<std::vector<ImageU8>> MakePseudoTargets(const std::vector<Photo>& photos,
                                                       const ReconstructOptions& options) {
  LITAGS_ASSIGN_OR_RETURN(std::vector<ToneTarget> targets,
                          MakeTargets(photos, std::vector<double>(photos.size(), 1.0),
                                      options.ResolveRecipe().tone, options.threads));
  std::vector<ImageU8> images;
  for (const ToneTarget& target : targets) images.push_back(PhotoToU8(target.image));
  return images;
}

}  // namespace litags
