#include "engine/tools/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/core/mask.h"
#include "engine/eval/metrics.h"
#include "engine/io/file_util.h"
#include "engine/io/picture_io.h"
#include "engine/pipeline/capture_targets.h"
#include "engine/target/tone.h"
#include "engine/tools/evaluation/true_depth.h"

namespace litags {

namespace fs = std::filesystem;

namespace {

// The view at the size of a picture of it.
TestView AtSizeOf(const ImageU8& picture, TestView view) {
  Camera& camera = view.view.camera;
  if (camera.width == 0) {  // of any size
    camera.width = picture.width;
    camera.height = picture.height;
  } else {
    camera = camera.Scaled(picture.width, picture.height);
  }
  return view;
}

// Nothing where there is no map, or where the photo is distorted.
absl::StatusOr<std::optional<Planes>> TrueDepthOf(const TestView& view,
                                                  const std::string& depth_dir) {
  if (!view.distortion.IsZero()) return std::nullopt;
  return ReadTrueDepth(depth_dir, view.view);
}

}  // namespace

std::string Scores::ToJson() const {
  const auto json_of = [](const std::optional<double>& v) {
    return v.has_value() ? nlohmann::json(*v) : nlohmann::json();
  };
  nlohmann::json rows = nlohmann::json::array();
  for (const ViewScore& v : views) {
    rows.push_back(
        {{"view", v.name}, {"psnr", v.psnr}, {"ssim", v.ssim}, {"lpips", json_of(v.lpips)}});
  }
  return JsonText(nlohmann::json{{"views", rows},
                                 {"psnr", psnr},
                                 {"ssim", ssim},
                                 {"lpips", json_of(lpips)},
                                 {"psnr_affine", psnr_affine}},
                  2);
}

absl::Status Scorer::Add(const TestView& wanted, const ImageU8& picture) {
  const TestView view = AtSizeOf(picture, wanted);
  absl::StatusOr<ImageU8> truth = LoadPicture(truth_dir_, view);
  if (absl::IsNotFound(truth.status())) return absl::OkStatus();
  LITAGS_RETURN_IF_ERROR(truth.status());
  // Which pixels the photo shows.
  LITAGS_ASSIGN_OR_RETURN(PlaneU8 shown, MaskOfUndistorted(view.view.camera, view.distortion));
  ViewScore score;
  score.name = view.view.name;
  LITAGS_ASSIGN_OR_RETURN(score.psnr, Psnr(picture, *truth, shown));
  // Their sizes agree, so it fails only where they are too small for it.
  score.ssim = Ssim(picture, *truth, SsimBorder::kValid, shown)
                   .value_or(std::numeric_limits<double>::quiet_NaN());
  if (lpips_ != nullptr) {
    // It knows no masks: what the photo does not show is equal.
    ForMasked(shown, [&](size_t i) { std::copy_n(&picture.data[3 * i], 3, &truth->data[3 * i]); });
    LITAGS_ASSIGN_OR_RETURN(score.lpips, lpips_->Distance(picture, *truth));
  }
  views_.push_back(std::move(score));
  pictures_.push_back(picture);
  truths_.push_back(*std::move(truth));
  shown_.push_back(std::move(shown));
  return absl::OkStatus();
}

absl::StatusOr<Scores> Scorer::Finish() const {
  if (views_.empty()) {
    return MakeError(absl::StatusCode::kNotFound, "NO_TRUTH", "truth",
                     absl::StrCat("truth: no test view has a photo of its name",
                                  truth_dir_.empty() ? "" : absl::StrCat(" in ", truth_dir_)));
  }
  Scores scores;
  scores.views = views_;
  double ssim_views = 0;
  for (const ViewScore& v : views_) {
    scores.psnr += v.psnr / static_cast<double>(views_.size());
    if (!std::isnan(v.ssim)) {
      scores.ssim += v.ssim;
      ++ssim_views;
    }
    if (v.lpips.has_value()) {
      scores.lpips = scores.lpips.value_or(0) + *v.lpips / static_cast<double>(views_.size());
    }
  }
  scores.ssim /= ssim_views;
  LITAGS_ASSIGN_OR_RETURN(const CorrectedPsnr fit, AffineCorrectedPsnr(pictures_, truths_, shown_));
  scores.psnr_affine = fit.corrected_db;
  return scores;
}

absl::StatusOr<ImageU8> RenderPicture(const Scene& scene, const View& view, int threads) {
  RenderRequest request;
  request.camera = view.camera;
  request.threads = threads;
  LITAGS_ASSIGN_OR_RETURN(const Planes color, scene.Render(request));
  return ToImageU8(color);
}

std::vector<std::string> PictureStems(const std::vector<std::string>& names) {
  std::map<std::string, int> uses;  // a stem must be no other picture's name, either
  for (const std::string& name : names) {
    ++uses[Stem(name)];
    ++uses[name];
  }
  std::vector<std::string> stems;
  for (const std::string& name : names) {
    stems.push_back(uses[Stem(name)] == 1 ? Stem(name) : name);
  }
  return stems;
}

absl::Status WriteViews(const Scene& scene, const std::string& dir, int threads) {
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(dir, ignored);
  const std::vector<std::string> stems = PictureStems(NamesOf(scene.views()));
  for (size_t i = 0; i < stems.size(); ++i) {
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, RenderPicture(scene, scene.views()[i], threads));
    LITAGS_RETURN_IF_ERROR(WritePng(absl::StrCat(dir, "/", stems[i], ".png"), picture));
  }
  return absl::OkStatus();
}

absl::StatusOr<Scores> ScoreScene(const Scene& scene, const std::vector<TestView>& views,
                                  const std::string& truth_dir, const std::string& pictures_dir,
                                  int threads) {
  std::error_code ignored;  // writing reports what matters
  if (!pictures_dir.empty()) fs::create_directories(pictures_dir, ignored);
  Scorer scorer(truth_dir);
  const std::vector<std::string> stems = PictureStems(NamesOf(views));
  for (size_t i = 0; i < views.size(); ++i) {
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, RenderPicture(scene, views[i].view, threads));
    if (!pictures_dir.empty()) {
      LITAGS_RETURN_IF_ERROR(WritePng(absl::StrCat(pictures_dir, "/", stems[i], ".png"), picture));
    }
    LITAGS_RETURN_IF_ERROR(scorer.Add(views[i], picture));
  }
  return scorer.Finish();
}

absl::Status CheckTrueDepth(const std::vector<TestView>& views, const std::string& depth_dir) {
  for (const TestView& view : views) {
    LITAGS_RETURN_IF_ERROR(TrueDepthOf(view, depth_dir).status());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<DepthScores>> ScoreDepth(const Scene& scene,
                                                      const std::vector<TestView>& views,
                                                      const std::string& depth_dir, int threads) {
  DepthScores scores;
  for (const TestView& view : views) {
    LITAGS_ASSIGN_OR_RETURN(const std::optional<Planes> read, TrueDepthOf(view, depth_dir));
    if (!read.has_value()) continue;
    const Planes& truth = *read;
    RenderRequest request;
    request.camera = view.view.camera;
    request.channel = Channel::kDepth;
    request.threads = threads;
    LITAGS_ASSIGN_OR_RETURN(const Planes depth, scene.Render(request));
    double known = 0, near_2 = 0, near_10 = 0, far_20 = 0;
    for (size_t i = 0; i < truth.data.size(); ++i) {
      if (!(truth.data[i] > 0)) continue;
      const double error = depth.data[i] / truth.data[i] - 1;
      ++known;
      near_2 += std::abs(error) < 0.02;
      near_10 += std::abs(error) < 0.1;
      far_20 += error > 0.2;
    }
    if (known == 0) continue;
    ++scores.views;
    scores.within_2_percent += near_2 / known;
    scores.within_10_percent += near_10 / known;
    scores.beyond_20_percent += far_20 / known;
  }
  if (scores.views == 0) return std::nullopt;
  for (double* share :
       {&scores.within_2_percent, &scores.within_10_percent, &scores.beyond_20_percent}) {
    *share /= scores.views;
  }
  return scores;
}

absl::StatusOr<Scores> ScorePhotos(const std::string& photos_dir,
                                   const std::vector<TestView>& views, const std::string& truth_dir,
                                   const ReconstructOptions& options,
                                   std::vector<std::string>* black) {
  const Tone rule = options.ResolveRecipe().tone.rule;
  std::vector<const TestView*> found;
  std::vector<Photo> photos;
  for (const TestView& view : views) {
    absl::StatusOr<Photo> photo = LoadPhoto(photos_dir, view);
    if (absl::IsNotFound(photo.status())) continue;
    LITAGS_RETURN_IF_ERROR(photo.status());
    if (IsBlack(*photo, PlaneU8(), rule)) {
      black->push_back(view.view.name);
      continue;
    }
    found.push_back(&view);
    photos.push_back(*std::move(photo));
  }
  LITAGS_ASSIGN_OR_RETURN(const std::vector<ImageU8> targets, MakePseudoTargets(photos, options));
  Scorer scorer(truth_dir);
  for (size_t i = 0; i < found.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(scorer.Add(*found[i], targets[i]));
  }
  return scorer.Finish();
}

}  // namespace litags
