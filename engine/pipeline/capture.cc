#include "engine/pipeline/capture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/camera_source.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/dense_start.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/even_response.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/pipeline/load_views.h"
#include "engine/pipeline/local_origin.h"
#include "engine/prior/structure_prior.h"
#include "engine/target/black_lift.h"
#include "engine/target/information.h"
#include "engine/target/photometric.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

constexpr double kEvenExposureStops = 0.5;  // see EvenOutPhotos(). Choice

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

// What is computed from all photos of a capture together, taken out of their views while this
// lives.
class PhotosTogether {
 public:
  explicit PhotosTogether(std::vector<TrainView>* views) : views_(views) {
    for (TrainView& v : *views) {
      photos.push_back(std::move(v.photo));
      masks.push_back(std::move(v.mask));
    }
  }
  ~PhotosTogether() {
    for (size_t i = 0; i < views_->size(); ++i) {
      (*views_)[i].photo = std::move(photos[i]);
      (*views_)[i].mask = std::move(masks[i]);
    }
  }
  PhotosTogether(const PhotosTogether&) = delete;
  PhotosTogether& operator=(const PhotosTogether&) = delete;

  std::vector<Photo> photos;
  std::vector<PlaneU8> masks;

 private:
  std::vector<TrainView>* views_;
};

// Where the photos saw the model's points, sorted by point.
std::vector<PointSighting> Sightings(const SparseModel& model, const LoadedViews& loaded) {
  std::vector<int> photo_of(model.views.size(), -1);
  for (size_t i = 0; i < loaded.model_view.size(); ++i)
    photo_of[loaded.model_view[i]] = static_cast<int>(i);
  std::vector<PointSighting> sightings;
  for (size_t p = 0; p < model.points.size(); ++p) {
    for (const TrackElement& element : model.points[p].track) {
      const int photo = photo_of[element.view];
      if (photo < 0) continue;
      const Camera& camera = loaded.views[photo].view.camera;
      const auto xyz = camera.CamFromWorld(model.points[p].xyz);
      if (xyz[2] <= 0) continue;
      sightings.push_back({static_cast<int>(p), photo, camera.fx * xyz[0] / xyz[2] + camera.cx,
                           camera.fy * xyz[1] / xyz[2] + camera.cy});
    }
  }
  return sightings;
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

// How pictures would be had black not cut off one half of the photos' noise.
std::optional<CodeCurve> CurveOfPictures(const ToneOptions& tone, double noise_at_black,
                                         double white) {
  // Noise is least in the dark, and the targets' curve has a slope of about 1 where most codes are.
  const double noise = std::min(noise_at_black, white / 255);
  if (tone.rule != Tone::kCapture || noise <= 0) return std::nullopt;
  return ChangeOfTargets(tone, [noise](double light) { return WithoutLift(light, noise); });
}

// What is known of the targets' noise once they are made.
struct TargetsMade {
  NoiseCurve rounding;    // what rounding leaves in them
  double noise_at_black;  // see NoiseAtBlack()
};

absl::StatusOr<TargetsMade> AddTargets(const Context& context, const SparseModel& model,
                                       LoadedViews* loaded) {
  const ToneOptions& tone = context.recipe.tone;
  const int threads = context.options.threads;
  const std::vector<PointSighting> sightings = Sightings(model, *loaded);
  std::vector<TrainView>& views = loaded->views;
  PhotosTogether all(&views);
  std::vector<Camera> cameras;
  for (const TrainView& v : views) cameras.push_back(v.view.camera);
  EvenOutResponse(context, sightings, cameras, all.masks, &all.photos);
  const std::vector<double> exposures =
      WithoutDrift(RelativeExposures(all.photos, sightings, all.masks), sightings);
  LITAGS_ASSIGN_OR_RETURN(std::vector<ToneTarget> targets,
                          MakeTargets(all.photos, exposures, tone, threads, all.masks));
  std::vector<double> gains;
  for (size_t i = 0; i < views.size(); ++i) {
    views[i].target = std::move(targets[i].image);
    views[i].exposure = exposures[i];
    gains.push_back(targets[i].gain);
    if (!targets[i].reached) {
      context.Note(absl::StrCat(views[i].view.name, " stays darker than wanted: no gain brings ",
                                "it there; leave it out, or mask what no light fell on"));
    }
  }
  TargetsMade made;
  made.noise_at_black = NoiseAtBlack(all.photos, gains, threads, all.masks);
  const auto median = gains.begin() + gains.size() / 2;
  std::nth_element(gains.begin(), median, gains.end());
  made.rounding = RoundingNoise(tone, *median);
  return made;
}

void AddInformation(std::vector<TrainView>* views) {
  const PhotosTogether all(views);
  std::vector<const Photo*> photos, targets;
  std::vector<double> exposures;
  for (size_t i = 0; i < views->size(); ++i) {
    photos.push_back(&all.photos[i]);
    targets.push_back(&(*views)[i].target);
    exposures.push_back((*views)[i].exposure);
  }
  std::vector<PlaneU8> weights = InformationWeights(photos, targets, exposures, all.masks);
  for (size_t i = 0; i < weights.size(); ++i) (*views)[i].information = std::move(weights[i]);
}

// L is one for all photos of a place: what R L is compared with is a photo as the median exposure
// would have taken it. Less than half a stop from that it made no difference that was measured, and
// photos stay what they are.
void EvenOutPhotos(std::vector<TrainView>* views) {
  for (TrainView& v : *views) {
    if (std::abs(std::log2(v.exposure)) < kEvenExposureStops) continue;
    v.photo = WithLinearGain(v.photo, 1 / v.exposure);
  }
}

absl::Status AddStructureMaps(const Context& context, std::vector<TrainView>* views) {
  // The prior's scale is one for the whole capture, so all photos go in together.
  const PhotosTogether all(views);
  LITAGS_ASSIGN_OR_RETURN(CapturePriors priors,
                          ComputeCapturePriors(all.photos, StructurePriorOptions(),
                                               context.options.threads, context.cancel, all.masks));
  for (size_t i = 0; i < views->size(); ++i) (*views)[i].structure = std::move(priors.maps[i]);
  return absl::OkStatus();
}

// Says what the masks do.
void NoteMasks(const std::vector<TrainView>& views, std::vector<std::string>* notes) {
  size_t masks = 0, pixels = 0, masked = 0;
  for (const TrainView& v : views) {
    if (v.mask.empty()) continue;
    ++masks;
    pixels += v.mask.data.size();
    masked += v.mask.data.size() - CountedPixels(v.mask, v.mask.data.size());
  }
  if (masks == 0) return;
  notes->push_back(
      absl::StrFormat("%d of %d photos have a mask; %.1f %% of their pixels do not count", masks,
                      views.size(), 100.0 * masked / pixels));
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

// What depth can be computed from.
std::string FingerprintOfViews(const std::vector<TrainView>& views,
                               const std::vector<SparsePoint>& points) {
  Fingerprint f;
  for (const TrainView& v : views) {
    f.Add(v.view.name.data(), v.view.name.size());
    f.Add(v.photo.data.data(), v.photo.data.size() * sizeof(int16_t));
    f.Add(v.target.data.data(), v.target.data.size() * sizeof(int16_t));
    f.Add(v.mask.data.data(), v.mask.data.size());
    f.Add(v.view.camera.Viewmat());
    for (double x : {v.view.camera.fx, v.view.camera.fy, v.view.camera.cx, v.view.camera.cy})
      f.Add(x);
  }
  AddPoints(points, &f);
  return f.Text();
}

// Depth maps are part of it, save those of stereo: they follow from the rest, but not to the last
// bit on every processor, and a job may be resumed on another one.
std::string MakeFingerprint(const Context& context, const std::string& inputs,
                            const std::vector<TrainView>& train) {
  const DepthOrigin depth = ResolveDepthOrigin(context);
  Fingerprint f;
  f.Add(inputs.data(), inputs.size());
  for (const TrainView& v : train) {
    if (!v.depth.has_value() || depth == DepthOrigin::kStereo) continue;
    f.Add(v.depth->depth.data.data(), v.depth->depth.data.size() * sizeof(float));
    f.Add(v.depth->confidence.data.data(), v.depth->confidence.data.size() * sizeof(float));
  }
  const std::string constants = absl::StrCat(
      FieldsText(context.recipe), FieldsText(context.options, /*shaping_only=*/true),
      "depth=", FieldText(depth), "\n", "schedule=", context.options.ScheduleIterations(), "\n");
  f.Add(constants.data(), constants.size());
  return f.Text();
}

}  // namespace

absl::StatusOr<Capture> LoadCapture(const Context& context, const std::string& colmap) {
  const ReconstructInput& input = context.input;
  const ReconstructOptions& options = context.options;
  const Recipe& recipe = context.recipe;
  std::vector<std::string>* const notes = &context.report->notes;
  context.progress(Stage::kLoading, "reading photos");
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> photos,
                          ListPhotos(input.images_dir, "images"));
  LITAGS_ASSIGN_OR_RETURN(std::string others, DescribeOtherPictures(input.images_dir, "images"));
  if (!others.empty()) context.Note(std::move(others));
  MaskPaths masks;
  if (!input.masks_dir.empty()) {
    LITAGS_ASSIGN_OR_RETURN(masks, FindMasks(input.masks_dir, photos));
  }
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, ObtainCameras(context, photos, masks, colmap));
  LITAGS_RETURN_IF_ERROR(context.cancel.Check());
  Capture capture;
  capture.origin = LocalOrigin(model.views);
  if (capture.origin != std::array<double, 3>{}) {
    TakeAsOrigin(capture.origin, &model);
    context.Note(DescribeOrigin(capture.origin));
  }

  context.progress(Stage::kPreparing, "pseudo-targets and structure maps");
  LITAGS_ASSIGN_OR_RETURN(LoadedViews loaded, LoadViews(context, model, masks));
  LITAGS_ASSIGN_OR_RETURN(const TargetsMade made, AddTargets(context, model, &loaded));
  std::vector<TrainView>& views = loaded.views;
  NoteMasks(views, notes);
  NoteExposures(views, recipe.tone.rule == Tone::kCapture, notes);
  if (recipe.lita && recipe.information_weights) AddInformation(&views);
  if (recipe.lita && recipe.use_prior) {
    LITAGS_RETURN_IF_ERROR(AddStructureMaps(context, &views));
  }

  LITAGS_RETURN_IF_ERROR(CheckScale(views, &model.points, notes));
  const std::string inputs = FingerprintOfViews(views, model.points);
  LimitPoints(options.max_gaussians, &model.points, context.report);
  capture.points = std::move(model.points);
  capture.point_views.assign(model.views.size(), -1);
  const int every = options.holdout_every;
  // Too few photos to spare any.
  const bool hold_out = every > 0 && static_cast<int>(views.size()) >= 2 * every;
  for (size_t i = 0; i < views.size(); ++i) {
    if (hold_out && static_cast<int>(i) % every == every / 2) {
      capture.holdout.push_back(std::move(views[i]));
    } else {
      capture.point_views[loaded.model_view[i]] = static_cast<int>(capture.train.size());
      capture.train.push_back(std::move(views[i]));
    }
  }
  capture.target_noise = MeasureNoise(capture.train, options.threads);
  capture.noise = NoiseOfPictures(made.rounding, capture.target_noise.white);
  capture.curve = CurveOfPictures(recipe.tone, made.noise_at_black, capture.target_noise.white);
  // Of the training photos alone: what is held out must not help.
  const std::string key =
      absl::StrCat(inputs, " points ", capture.points.size(), " holdout ", hold_out ? every : 0);
  LITAGS_RETURN_IF_ERROR(
      AddDepthMaps(context, capture.points, capture.point_views, key, &capture.train));
  LITAGS_RETURN_IF_ERROR(AddDenseStart(context, key, &capture));
  // Last, for stereo and structure want the photos as they are.
  if (recipe.lita && recipe.tone.rule == Tone::kCapture) EvenOutPhotos(&capture.train);
  capture.fingerprint = MakeFingerprint(context, inputs, capture.train);
  return capture;
}

absl::StatusOr<std::vector<ImageU8>> MakePseudoTargets(const std::vector<ImageU8>& photos,
                                                       const ReconstructOptions& options) {
  std::vector<Photo> precise;
  for (const ImageU8& photo : photos) precise.push_back(PhotoFromU8(photo));
  LITAGS_ASSIGN_OR_RETURN(std::vector<ToneTarget> targets,
                          MakeTargets(precise, std::vector<double>(photos.size(), 1.0),
                                      options.ResolveRecipe().tone, options.threads));
  std::vector<ImageU8> images;
  for (const ToneTarget& target : targets) images.push_back(PhotoToU8(target.image));
  return images;
}

}  // namespace litags
