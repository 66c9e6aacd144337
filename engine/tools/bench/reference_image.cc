// Cases of whole images: "prior", "losses" (image and depth) and "metrics".
#include <cmath>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/eval/metrics.h"
#include "engine/prior/structure_prior.h"
#include "engine/tools/bench/reference_case.h"
#include "engine/train/depth_loss.h"
#include "engine/train/losses.h"

namespace litags {
namespace {

template <typename T>
T OrThrow(absl::StatusOr<T> result) {
  if (!result.ok()) throw CaseError(std::string(result.status().message()));
  return *std::move(result);
}

// ---- prior ----

struct PriorVariant {
  const char* array;
  const char* input = "rgb_u8";
  double exposure = 1;
  double floor = 0;  // negative: the case's own
};

constexpr double kCaseFloor = -1;

const PriorVariant kPriorVariants[] = {
    {.array = "P_eps0"},
    {.array = "P_floor", .floor = kCaseFloor},
    {.array = "P_floor_exp0p1", .exposure = 0.1, .floor = kCaseFloor},
    {.array = "P_floor1_exp0p1_q8", .input = "rgb_u8_exp0p1_q8", .floor = 1.0 / 255.0},
};

// ---- losses ----

class LossComparer {
 public:
  LossComparer(const ReferenceCase& reference, CaseReport* report)
      : reference_(reference), report_(report) {}

  void Value(const std::string& name, double actual) const {
    const double expected = reference_.Value(name);
    report_->Add(name, std::abs(actual - expected),
                 reference_.Tolerance("value_rel") * std::abs(expected));
  }
  void Gradient(const std::string& array, const Planes& actual) const {
    const auto expected = reference_.Doubles(array);
    report_->Add(array, MaxAbsError(actual.data, expected),
                 reference_.Tolerance("gradient_rel_to_max") * MaxAbs(expected));
  }

  // A loss of one image: `loss` takes the gradient planes to add to.
  template <typename Loss>
  double Run(const std::string& gradient, const Planes& like, const Loss& loss) const {
    Planes v(like.channels, like.height, like.width);
    const double value = loss(PlanesSpan(v));
    Gradient(gradient, v);
    return value;
  }

 private:
  const ReferenceCase& reference_;
  CaseReport* report_;
};

void RunImageLosses(const ReferenceCase& reference, CaseReport* report) {
  const LossComparer compare(reference, report);
  const Planes x = reference.ReadPlanes("x"), y = reference.ReadPlanes("y");
  const Planes x_prev = reference.ReadPlanes("x_prev"), i_in = reference.ReadPlanes("i_in");
  const Planes illum = reference.ReadPlanes("illum");
  // The engine makes this target from the photo's bytes; the case's photo is not in bytes.
  const Planes target = reference.ReadPlanes("exposure_target");
  LossWorkspace ws;

  compare.Value("l1",
                compare.Run("grad_l1", x, [&](PlanesSpan v) { return L1Loss(x, y, 1, v, ws); }));
  compare.Value("mse", compare.Run("grad_mse", x,
                                   [&](PlanesSpan v) { return MseLoss(x, x_prev, 1, v, {}, ws); }));
  // The case has SSIM itself, the engine the loss 1 - SSIM.
  compare.Value("ssim", 1 - SsimLoss(x, y, 1, {}, ws));
  compare.Run("grad_ssim", x, [&](PlanesSpan v) { return SsimLoss(x, y, -1, v, ws); });
  compare.Value("rec", compare.Run("grad_rec", x, [&](PlanesSpan v) {
    return ReconstructionLoss(x, y, 1, v, ws);
  }));
  compare.Value("tv_sq", compare.Run("grad_tv_sq", x, [&](PlanesSpan v) {
    return TvLoss(x, TvNorm::kSquared, 1, v, ws);
  }));
  compare.Value("tv_abs", compare.Run("grad_tv_abs", x, [&](PlanesSpan v) {
    return TvLoss(x, TvNorm::kAbsolute, 1, v, ws);
  }));
  compare.Value("exposure", compare.Run("grad_exposure", x,
                                        [&](PlanesSpan v) { return L1Loss(x, target, 1, v, ws); }));

  Planes v_x(x.channels, x.height, x.width), v_illum = v_x;
  compare.Value("product_rec", ProductReconstructionLoss(x, illum, i_in, 1, v_x, v_illum, ws));
  compare.Gradient("grad_product_rec_x", v_x);
  compare.Gradient("grad_product_rec_illum", v_illum);
}

void RunDepthLosses(const ReferenceCase& reference, CaseReport* report) {
  const LossComparer compare(reference, report);
  const Planes rendered = reference.ReadPlanes("rendered"), target = reference.ReadPlanes("target");
  const int size = static_cast<int>(reference.Param("patch"));
  const std::vector<double> corners = reference.ParamList("patches_y0_x0");
  std::vector<PixelRect> patches;
  for (size_t i = 0; i + 1 < corners.size(); i += 2) {
    patches.push_back({static_cast<int>(corners[i + 1]), static_cast<int>(corners[i]), size, size});
  }
  LossWorkspace ws;
  Planes v_global(1, rendered.height, rendered.width), v_local = v_global;
  const double global = DepthLoss(rendered, target, {}, {}, 1, v_global, ws).Sum();
  const DepthLossTerms both = DepthLoss(rendered, target, {}, patches, 1, v_local, ws);
  // The second call adds both gradients up; take the first one off again.
  for (size_t i = 0; i < v_local.data.size(); ++i) v_local.data[i] -= v_global.data[i];

  const double tolerance = reference.Tolerance("value_abs");
  report->Add("global", std::abs(global - reference.Value("global")), tolerance);
  report->Add("local", std::abs(both.local - reference.Value("local")), tolerance);
  compare.Gradient("grad_global", v_global);
  compare.Gradient("grad_local", v_local);
}

}  // namespace

void RunPriorCase(const ReferenceCase& reference, CaseReport* report) {
  for (const PriorVariant& variant : kPriorVariants) {
    if (!reference.Has(variant.array)) continue;
    Planes rgb = ToPlanes(reference.ReadImage(variant.input));
    for (float& v : rgb.data) v = static_cast<float>(v * variant.exposure);

    const double floor = variant.floor == kCaseFloor ? reference.Param("floor") : variant.floor;
    const Planes prior = OrThrow(StructurePrior(rgb, reference.Param("sigma"), floor));
    const auto expected = reference.Doubles(variant.array);
    report->Add(variant.array, MaxAbsError(prior.data, expected),
                reference.Tolerance("P_rel_to_max") * MaxAbs(expected));
  }
}

void RunLossesCase(const ReferenceCase& reference, CaseReport* report) {
  if (reference.Has("rendered")) {
    RunDepthLosses(reference, report);
  } else {
    RunImageLosses(reference, report);
  }
}

void RunMetricsCase(const ReferenceCase& reference, CaseReport* report) {
  const ImageU8 a = reference.ReadImage("a"), b = reference.ReadImage("b");
  auto compare = [&](const char* name, double actual, const char* tolerance) {
    report->Add(name, std::abs(actual - reference.Value(name)), reference.Tolerance(tolerance));
  };
  compare("psnr_db", OrThrow(Psnr(a, b)), "psnr_db_abs");
  compare("ssim", OrThrow(Ssim(a, b, SsimBorder::kValid)), "ssim_abs");
  compare("ssim_zero_padded", OrThrow(Ssim(a, b, SsimBorder::kZero)), "ssim_abs");
}

}  // namespace litags
