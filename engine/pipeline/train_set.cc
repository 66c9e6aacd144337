#include "engine/pipeline/train_set.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/capture_targets.h"
#include "engine/pipeline/dense_start.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/pipeline/held_out.h"
#include "engine/pipeline/posed_photos.h"
#include "engine/target/black_lift.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

constexpr double kEvenExposureStops = 0.5;  // see PhotoToLearn(). Choice

// At most `limit` points: those that most photos saw, in their old order.
void LimitPoints(int64_t limit, std::vector<SparsePoint>* points, ReconstructReport* report) {
  if (static_cast<int64_t>(points->size()) <= limit) return;
  std::vector<uint32_t> order(points->size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return (*points)[a].track_length() > (*points)[b].track_length();
  });
  order.resize(limit);
  std::sort(order.begin(), order.end());
  report->notes.push_back(absl::StrCat("of ", points->size(), " sparse points the ", limit,
                                       " seen most often were used (max_gaussians)"));
  std::vector<SparsePoint> kept;
  for (const uint32_t i : order) kept.push_back(std::move((*points)[i]));
  *points = std::move(kept);
}

// What noise of the photos pictures still have, of that of the targets. Choice
constexpr float kNoiseLeft = 0.25;

// Noise of pictures: what rounding leaves in them, which all photos have alike, and what is left of
// the targets' white noise, in codes of 255, which differs from photo to photo.
NoiseCurve NoiseOfPictures(const NoiseCurve& rounding, double white) {
  const float left = kNoiseLeft * static_cast<float>(white) / 255;
  NoiseCurve noise;
  for (size_t i = 0; i < noise.size(); ++i) noise[i] = std::hypot(rounding[i], left);
  return noise;
}

// How pictures would be had black not cut off one half of the photos' noise. `white`: their white
// noise before they were shrunk, codes of 255.
std::optional<CodeCurve> CurveOfPictures(const ToneOptions& tone, double noise_at_black,
                                         double white) {
  // Noise is least in the dark, and the targets' curve has a slope of about 1 where most codes are.
  const double noise = std::min(noise_at_black, white / 255);
  if (tone.rule != Tone::kCapture || noise <= 0) return std::nullopt;
  return ChangeOfTargets(tone, [noise](double light) { return WithoutLift(light, noise); });
}

// Says what the masks do.
void NoteMasks(const std::vector<PlaneU8>& all, std::vector<std::string>* notes) {
  size_t masks = 0, pixels = 0, masked = 0;
  for (const PlaneU8& mask : all) {
    if (mask.empty()) continue;
    ++masks;
    pixels += mask.data.size();
    masked += mask.data.size() - CountedPixels(mask, mask.data.size());
  }
  if (masks == 0) return;
  notes->push_back(
      absl::StrFormat("%d of %d photos have a mask; %.1f %% of their pixels do not count", masks,
                      all.size(), 100.0 * masked / pixels));
}

void AddPoints(const std::vector<SparsePoint>& points, Fingerprint* f) {
  for (const SparsePoint& point : points) {
    f->Add(point.xyz);
    f->Add(point.rgb);
    for (const TrackElement& e : point.track) {
      f->Add(e.view);
      f->Add(e.x);
      f->Add(e.y);
    }
  }
}

// Of the code that makes targets, information weights and structure maps of photos: where it
// changes so that a checkpoint must not go on with what it makes now, this is raised.
constexpr int kTargetsVersion = 6;

// What depth can be computed from. Not the targets: their last bits differ from one processor to
// another, and a job may be resumed on another one; what they are made from does not.
std::string FingerprintOfPhotos(const Context& context, const PosedPhotos& posed) {
  Fingerprint f;
  f.Add(kTargetsVersion);
  for (size_t i = 0; i < posed.size(); ++i) {
    const auto& [name, camera] = posed.views[i];
    f.Add(name.data(), name.size());
    f.Add(posed.sources[i].data(), posed.sources[i].size());
    f.Add(posed.stated_exposures[i]);
    f.Add(camera.width);
    f.Add(camera.height);
    f.Add(camera.Viewmat());
    for (double x : {camera.fx, camera.fy, camera.cx, camera.cy}) f.Add(x);
    f.Add(posed.distortions[i].Coefficients());
    f.Add(posed.distortions[i].fisheye);
  }
  f.Add(posed.code_step);
  AddPoints(posed.model.points, &f);
  const std::string tone =
      absl::StrCat(FieldsText(context.recipe.tone),
                   "white_balance=", FieldText(context.options.white_balance), "\n");
  f.Add(tone.data(), tone.size());
  return f.Text();
}

// The files that depth is made from, if it is not by stereo. Not the maps, as above. What cannot be
// read made no depth.
void AddDepthFiles(const ReconstructInput& input, DepthOrigin depth,
                   const std::vector<TrainView>& train, Fingerprint* f) {
  if (depth == DepthOrigin::kMaps) {
    for (const TrainView& v : train) {
      const std::string map = FindDepthMap(input.depth_dir, v.view.name);
      f->AddFileIfReadable(map, ImageLimits().max_bytes);
    }
  }
  if (depth == DepthOrigin::kNetwork) AddNetwork(input.depth_network, f).IgnoreError();
}

std::string MakeFingerprint(const Context& context, const std::string& inputs,
                            const std::vector<TrainView>& train) {
  const DepthOrigin depth = ResolveDepthOrigin(context);
  Fingerprint f;
  f.Add(inputs.data(), inputs.size());
  AddDepthFiles(context.input, depth, train, &f);
  const std::string constants = absl::StrCat(
      FieldsText(context.recipe), FieldsText(context.options, /*shaping_only=*/true),
      "depth=", FieldText(depth), "\n", "schedule=", context.options.ScheduleIterations(), "\n");
  f.Add(constants.data(), constants.size());
  return f.Text();
}

// Which photos are trained on, and the model's views as indices of those.
struct Split {
  std::vector<size_t> train, holdout;
  std::vector<int> point_views;  // -1: held out or left out
  int every = 0;                 // one photo in so many is held out; 0: none is
};

Split SplitPhotos(int every, const PosedPhotos& posed) {
  Split split;
  if (HoldsOut(posed.size(), every)) split.every = every;
  split.point_views.assign(posed.model.views.size(), -1);
  for (size_t i = 0; i < posed.size(); ++i) {
    if (IsHeldOut(i, posed.size(), every)) {
      split.holdout.push_back(i);
    } else {
      split.point_views[posed.model_view[i]] = static_cast<int>(split.train.size());
      split.train.push_back(i);
    }
  }
  return split;
}

// L is one for all photos of a place: what R L is compared with is a photo as the median exposure
// would have taken it. Less than half a stop from that it made no difference that was measured, and
// photos stay what they are.
Photo PhotoToLearn(const Recipe& recipe, Photo photo, double exposure) {
  const bool evened = recipe.lita && recipe.tone.rule == Tone::kCapture &&
                      std::abs(std::log2(exposure)) >= kEvenExposureStops;
  return evened ? WithLinearGain(photo, 1 / exposure) : std::move(photo);
}

// Takes the photo's parts out of the stages.
TrainView ViewOf(size_t i, PosedPhotos* posed, CaptureTargets* targets) {
  TrainView v;
  v.view = posed->views[i];
  v.distortion = posed->distortions[i];
  v.mask = std::move(posed->masks[i]);
  v.photo = std::move(targets->photos[i]);
  v.exposure = targets->exposures[i];
  v.lamp = targets->lamp;
  v.target = std::move(targets->targets[i]);
  if (!targets->information.empty()) v.information = std::move(targets->information[i]);
  if (!targets->structure.empty()) v.structure = std::move(targets->structure[i]);
  return v;
}

}  // namespace

absl::StatusOr<TrainSet> MakeTrainSet(const Context& context, const std::string& colmap) {
  const ReconstructOptions& options = context.options;
  const Recipe& recipe = context.recipe;
  std::vector<std::string>* const notes = &context.report->notes;
  LITAGS_ASSIGN_OR_RETURN(PosedPhotos posed, LoadPosedPhotos(context, colmap));
  LITAGS_ASSIGN_OR_RETURN(CaptureTargets targets,
                          MakeCaptureTargets(context, posed, std::move(posed.photos)));
  NoteMasks(posed.masks, notes);
  NoteExposures(posed.views, targets.exposures, recipe.tone.rule == Tone::kCapture, notes);
  const float near_plane = NearPlaneOf(posed.model);
  LITAGS_RETURN_IF_ERROR(CheckScale(posed.views, near_plane, &posed.model.points, notes));
  const std::string inputs = FingerprintOfPhotos(context, posed);

  TrainSet set;
  set.near_plane = near_plane;
  set.origin = posed.origin;
  set.points = std::move(posed.model.points);
  LimitPoints(options.max_gaussians, &set.points, context.report);
  Split split = SplitPhotos(options.holdout_every, posed);
  set.point_views = std::move(split.point_views);
  if (options.holdout_every > 0 && split.every == 0) {
    notes->push_back(absl::StrCat(
        "none of the ", posed.size(), " photos is held out to measure quality: with holdout_every ",
        options.holdout_every, " it takes ", LeastToHoldOut(options.holdout_every)));
  }

  // Of the training photos alone: what is held out must not help.
  std::vector<PosedPhoto> photos;
  for (const size_t i : split.train) {
    photos.push_back({&posed.views[i], &targets.photos[i], &targets.targets[i],
                      &posed.distortions[i], &posed.masks[i]});
  }
  const std::string key =
      absl::StrCat(inputs, " points ", set.points.size(), " holdout ", split.every);
  LITAGS_ASSIGN_OR_RETURN(DepthMaps depth,
                          MakeDepthMaps(context, photos, set.points, set.point_views, key));
  LITAGS_ASSIGN_OR_RETURN(
      const std::vector<SparsePoint> dense,
      DenseStartPoints(context, photos, depth, set.points, set.point_views, key));
  set.points.insert(set.points.end(), dense.begin(), dense.end());

  const auto view_of = [&](size_t i) {
    TrainView v = ViewOf(i, &posed, &targets);
    v.photo = PhotoToLearn(recipe, std::move(v.photo), v.exposure);
    return v;
  };
  for (size_t k = 0; k < split.train.size(); ++k) {
    TrainView& v = set.train.emplace_back(view_of(split.train[k]));
    if (!depth.empty()) v.depth = std::move(depth[k]);
  }
  for (const size_t i : split.holdout) set.holdout.push_back(view_of(i));
  set.target_noise = MeasureNoise(set.train, options.threads);
  set.noise = NoiseOfPictures(targets.rounding, set.target_noise.white);
  set.curve = CurveOfPictures(recipe.tone, targets.noise_at_black,
                              set.target_noise.white / posed.noise_kept);
  set.fingerprint = MakeFingerprint(context, inputs, set.train);
  return set;
}

}  // namespace litags
