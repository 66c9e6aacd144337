// Cases of the rasteriser: "splat_forward" and "splat_backward".
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/camera.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"
#include "engine/tools/bench/reference_case.h"

namespace litags {
namespace {

Camera ReadCamera(const ReferenceCase& reference) {
  Camera camera;
  camera.width = static_cast<int>(reference.Param("width"));
  camera.height = static_cast<int>(reference.Param("height"));
  camera.fx = reference.Param("fx");
  camera.fy = reference.Param("fy");
  camera.cx = reference.Param("cx");
  camera.cy = reference.Param("cy");
  const auto values = reference.Doubles("viewmat");
  std::array<double, 16> viewmat;
  if (values.size() != viewmat.size()) throw CaseError("viewmat is not [4,4]");
  std::copy(values.begin(), values.end(), viewmat.begin());
  camera.SetViewmat(viewmat);
  const absl::Status status = camera.Validate("camera");
  if (!status.ok()) throw CaseError(std::string(status.message()));
  return camera;
}

void ReadRows(const ReferenceCase& reference, const char* array, int row, int count,
              Splats* splats) {
  const auto values = reference.Floats(array);
  if (values.size() != splats->size() * count) throw CaseError(std::string(array) + ": wrong size");
  for (size_t i = 0; i < values.size(); ++i) splats->at(i / count, row + i % count) = values[i];
}

// Row that feature c is kept in: harmonics of degree 0, then the LITA attributes.
int FeatureRow(int c) {
  if (c >= kChannelNoise) return kNoise + c - kChannelNoise;
  if (c >= kChannelIllumination) return kIllumination + c - kChannelIllumination;
  static_assert(kStructure - kShDc == kChannelStructure && kDepth - kShDc == kChannelDepth);
  return kShDc + c;
}

int NumChannels(const ReferenceCase& reference) {
  return static_cast<int>(reference.Param("channels"));
}
bool HasSh(const ReferenceCase& reference) { return reference.HasParam("sh_degree"); }
int ShDegree(const ReferenceCase& reference) {
  return HasSh(reference) ? static_cast<int>(reference.Param("sh_degree")) : 0;
}

Splats ReadSplats(const ReferenceCase& reference) {
  Splats splats(static_cast<size_t>(reference.Param("n")));
  ReadRows(reference, "means", kMean, 3, &splats);
  ReadRows(reference, "log_scales", kLogScale, 3, &splats);
  ReadRows(reference, "raw_quats", kRawQuat, 4, &splats);
  ReadRows(reference, "logit_opacities", kLogitOpacity, 1, &splats);
  if (HasSh(reference)) {
    const auto sh = reference.Floats("sh");  // [N,16,3]
    for (size_t i = 0; i < sh.size(); ++i) {
      splats.at(i / 48, ShRow(i % 48 / 3, i % 3)) = sh[i];
    }
    return splats;
  }
  const int channels = NumChannels(reference);
  const auto features = reference.Floats("features");  // [N,C]
  if (features.size() != splats.size() * channels) throw CaseError("features: wrong size");
  for (size_t i = 0; i < features.size(); ++i) {
    const int c = static_cast<int>(i % channels);
    splats.at(i / channels, FeatureRow(c)) =
        c < 3 ? static_cast<float>((features[i] - 0.5) / kSh0) : features[i];
  }
  return splats;
}

RenderSettings ReadSettings(const ReferenceCase& reference) {
  RenderSettings settings;
  settings.num_channels = NumChannels(reference);
  settings.sh_degree = ShDegree(reference);
  settings.near_plane = static_cast<float>(reference.Param("near_plane"));
  const auto background = reference.ParamList("background");
  if (background.size() > settings.background.size()) throw CaseError("too many channels");
  std::copy(background.begin(), background.end(), settings.background.begin());
  return settings;
}

double LargestFeature(const ReferenceCase& reference) {
  if (!HasSh(reference)) return MaxAbs(reference.Doubles("features"));
  return MaxAbs(reference.Doubles(absl::StrCat("colours_deg", ShDegree(reference))));
}

// Compares planes [C,H,W] with `array` [H,W,C] or [H,W]: fragile pixels with their own bound.
class ImageComparer {
 public:
  ImageComparer(const ReferenceCase& reference, CaseReport* report)
      : reference_(reference), report_(report), fragile_(reference.Array("fragile").bytes) {}

  // The tolerances are for features up to 1 and grow with the largest.
  void Compare(const std::string& array, const Planes& actual, int first_channel,
               double largest_feature, const char* tolerance) const {
    const auto expected = reference_.Doubles(array);
    const size_t pixels = fragile_.size();
    const size_t channels = expected.size() / pixels;
    if (actual.plane_size() != pixels || actual.channels < first_channel + int(channels)) {
      throw CaseError(array + ": wrong size");
    }
    std::vector<float> ours[2];
    std::vector<double> theirs[2];
    for (size_t i = 0; i < expected.size(); ++i) {
      const bool fragile = fragile_[i / channels] != 0;
      ours[fragile].push_back(actual.plane(first_channel + i % channels)[i / channels]);
      theirs[fragile].push_back(expected[i]);
    }
    const double scale = std::max(1.0, largest_feature);
    report_->Add(array, MaxAbsError(ours[0], theirs[0]), scale * reference_.Tolerance(tolerance));
    if (!ours[1].empty()) {
      report_->Add(array + " (fragile)", MaxAbsError(ours[1], theirs[1]),
                   scale * reference_.Tolerance("image_abs_fragile"));
    }
  }

 private:
  const ReferenceCase& reference_;
  CaseReport* report_;
  std::vector<uint8_t> fragile_;
};

// Lengths of the vectors xy [N,2].
std::vector<float> Lengths(const std::vector<double>& xy) {
  std::vector<float> norms(xy.size() / 2);
  for (size_t i = 0; i < norms.size(); ++i) {
    norms[i] = static_cast<float>(std::hypot(xy[2 * i], xy[2 * i + 1]));
  }
  return norms;
}

// Compares one gradient array as a whole: largest error against the largest entry, and direction.
class GradientComparer {
 public:
  GradientComparer(const ReferenceCase& reference, CaseReport* report)
      : reference_(reference), report_(report) {}

  void Compare(const std::string& name, const std::vector<float>& actual,
               const std::vector<double>& expected) const {
    report_->Add(name, MaxAbsError(actual, expected),
                 reference_.Tolerance("rel_to_max_abs") * MaxAbs(expected));
    double dot = 0, norm_a = 0, norm_e = 0;
    for (size_t i = 0; i < actual.size(); ++i) {
      dot += actual[i] * expected[i];
      norm_a += double{actual[i]} * actual[i];
      norm_e += expected[i] * expected[i];
    }
    report_->Add(name + " 1-cosine", 1 - dot / std::sqrt(norm_a * norm_e),
                 1 - reference_.Tolerance("cosine_min"));
  }

  // `count` rows from `row` on of every Gaussian, times `scale`.
  void CompareRows(const std::string& array, const Splats& grads, int row, int count) const {
    std::vector<float> actual;
    for (size_t i = 0; i < grads.size(); ++i) {
      for (int k = 0; k < count; ++k) actual.push_back(grads.at(i, row + k));
    }
    Compare(array, actual, reference_.Doubles(array));
  }

 private:
  const ReferenceCase& reference_;
  CaseReport* report_;
};

void CompareShGradients(const ReferenceCase& reference, const GradientComparer& compare,
                        const Splats& grads) {
  std::vector<float> actual;
  for (size_t i = 0; i < grads.size(); ++i) {
    for (int k = 0; k < 16; ++k) {
      for (int c = 0; c < 3; ++c) actual.push_back(grads.at(i, ShRow(k, c)));
    }
  }
  compare.Compare("grad_sh", actual, reference.Doubles("grad_sh"));
}

void CompareFeatureGradients(const ReferenceCase& reference, const GradientComparer& compare,
                             int channels, const Splats& grads) {
  std::vector<float> actual;
  for (size_t i = 0; i < grads.size(); ++i) {
    for (int c = 0; c < channels; ++c) {
      const double g = grads.at(i, FeatureRow(c));
      actual.push_back(static_cast<float>(c < 3 ? g / kSh0 : g));
    }
  }
  compare.Compare("grad_features", actual, reference.Doubles("grad_features"));
}

}  // namespace

void RunSplatForwardCase(const ReferenceCase& reference, CaseReport* report) {
  const Splats splats = ReadSplats(reference);
  const Camera camera = ReadCamera(reference);
  RenderSettings settings = ReadSettings(reference);
  const ImageComparer compare(reference, report);
  const double largest = LargestFeature(reference);
  Renderer renderer;
  Planes image, alpha;
  for (int degree = 0; degree <= ShDegree(reference); ++degree) {
    settings.sh_degree = degree;
    renderer.Forward(splats, camera, settings, &image, &alpha);
    const std::string array = HasSh(reference) ? absl::StrCat("image_deg", degree) : "image";
    compare.Compare(array, image, kChannelColor, largest, "image_abs_not_fragile");
  }
  compare.Compare("alpha", alpha, 0, 1, "alpha_abs_not_fragile");

  settings.num_channels = kNumChannels;
  settings.depth_source = DepthSource::kCameraZ;
  settings.background = {};
  renderer.Forward(splats, camera, settings, &image, &alpha);
  compare.Compare("depth_sum", image, kChannelDepth, MaxAbs(reference.Doubles("depths")),
                  "image_abs_not_fragile");
}

void RunSplatBackwardCase(const ReferenceCase& reference, CaseReport* report) {
  const ReferenceCase forward(reference.folder() + "/../" + reference.ParamText("forward_case"));
  const Splats splats = ReadSplats(forward);
  const RenderSettings settings = ReadSettings(forward);
  Renderer renderer;
  Planes image, alpha;
  renderer.Forward(splats, ReadCamera(forward), settings, &image, &alpha);

  Splats grads(splats.size());
  renderer.Backward(splats, reference.ReadHwc("w_image"), reference.ReadPlanes("w_alpha"),
                    [&](size_t block, const float* rows, uint32_t) {
                      std::copy_n(rows, Splats::kBlockFloats, grads.block(block));
                    });
  const GradientComparer compare(reference, report);
  compare.CompareRows("grad_means", grads, kMean, 3);
  compare.CompareRows("grad_log_scales", grads, kLogScale, 3);
  compare.CompareRows("grad_raw_quats", grads, kRawQuat, 4);
  compare.CompareRows("grad_logit_opacities", grads, kLogitOpacity, 1);
  if (HasSh(forward)) {
    CompareShGradients(reference, compare, grads);
  } else {
    CompareFeatureGradients(reference, compare, settings.num_channels, grads);
  }

  // Density control sees lengths only, and only of visible Gaussians.
  const ViewStats& stats = renderer.stats();
  std::vector<float> grad_means2d = stats.grad_means2d;
  for (size_t i = 0; i < grad_means2d.size(); ++i) {
    if (!stats.visible[i]) grad_means2d[i] = 0;
  }
  const std::vector<float> norms = Lengths(reference.Doubles("grad_means2d"));
  compare.Compare("|grad_means2d|", grad_means2d, {norms.begin(), norms.end()});
}

}  // namespace litags
