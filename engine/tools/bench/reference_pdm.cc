// Cases of the denoising module: "conv" (its network F alone) and "conv_pdm".
#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/denoise/pdm.h"
#include "engine/tools/bench/reference_case.h"

namespace litags {
namespace {

struct NetArray {
  const char* name;
  size_t begin, end;  // in the network's flat vector
};

std::vector<NetArray> NetArrays(int hidden) {
  const PdmNetLayout at(hidden);
  return {{"w1", at.w1, at.b1}, {"b1", at.b1, at.w2}, {"w2", at.w2, at.b2},
          {"b2", at.b2, at.w3}, {"w3", at.w3, at.b3}, {"b3", at.b3, at.size}};
}

std::string StageSuffix(const PdmOptions& options, size_t net) {
  return options.shared ? "" : absl::StrCat("_s", net);
}

PdmWeights ReadWeights(const ReferenceCase& reference, const PdmOptions& options) {
  PdmWeights weights = PdmWeights::Zeros(options);
  for (size_t k = 0; k < weights.nets.size(); ++k) {
    for (const NetArray& array : NetArrays(options.hidden)) {
      const auto values = reference.Floats(absl::StrCat(array.name, StageSuffix(options, k)));
      if (values.size() != array.end - array.begin) throw CaseError("wrong number of weights");
      std::copy(values.begin(), values.end(), weights.nets[k].begin() + array.begin);
    }
  }
  return weights;
}

void CompareOutput(const ReferenceCase& reference, const std::string& array, const Planes& actual,
                   CaseReport* report) {
  report->Add(array, MaxAbsError(actual.data, reference.Doubles(array)),
              reference.Tolerance("output_abs"));
}

// A gradient passes by either bound, so the wider one decides.
void CompareGradient(const ReferenceCase& reference, const std::string& array,
                     absl::Span<const float> actual, CaseReport* report) {
  const auto expected = reference.Doubles(array);
  report->Add(array, MaxAbsError(actual, expected),
              std::max(reference.Tolerance("gradient_abs"),
                       reference.Tolerance("gradient_rel_to_max") * MaxAbs(expected)));
}

void CompareWeightGradients(const ReferenceCase& reference, const PdmOptions& options,
                            const PdmWeights& v_weights, CaseReport* report) {
  for (size_t k = 0; k < v_weights.nets.size(); ++k) {
    for (const NetArray& array : NetArrays(options.hidden)) {
      CompareGradient(
          reference, absl::StrCat("grad_", array.name, StageSuffix(options, k)),
          absl::MakeSpan(v_weights.nets[k]).subspan(array.begin, array.end - array.begin), report);
    }
  }
}

void CheckOptions(const PdmOptions& options) {
  const absl::Status status = options.Validate();
  if (!status.ok()) throw CaseError(std::string(status.message()));
}

}  // namespace

// One stage with R_0 = 0 and N = 2x: Nhat_0 = x and R_1 = F(x) - x.
void RunConvCase(const ReferenceCase& reference, CaseReport* report) {
  PdmOptions options;
  options.stages = 1;
  options.hidden = static_cast<int>(reference.Param("hidden"));
  CheckOptions(options);
  const Planes x = reference.ReadPlanes("x"), w_out = reference.ReadPlanes("w_out");
  const Planes zero(x.channels, x.height, x.width);
  Planes noise = x;
  for (float& v : noise.data) v *= 2;

  Pdm pdm(options);
  pdm.Forward(ReadWeights(reference, options), zero, noise);
  Planes output = pdm.R(1);
  for (size_t i = 0; i < x.data.size(); ++i) output.data[i] += x.data[i];
  CompareOutput(reference, "output", output, report);

  Planes v_R0 = zero, v_N = zero;
  PdmWeights v_weights;
  pdm.Backward(w_out, Planes(), v_R0, v_N, &v_weights);
  CompareWeightGradients(reference, options, v_weights, report);
  Planes v_x = v_N;
  for (size_t i = 0; i < x.data.size(); ++i) v_x.data[i] = 2 * v_N.data[i] + w_out.data[i];
  CompareGradient(reference, "grad_x", v_x.data, report);
}

void RunPdmCase(const ReferenceCase& reference, CaseReport* report) {
  PdmOptions options;
  options.stages = static_cast<int>(reference.Param("stages"));
  options.hidden = static_cast<int>(reference.Param("hidden"));
  options.shared = reference.ParamFlag("shared");
  options.filter_size = static_cast<int>(reference.Param("filter_size"));
  options.filter_sigma = static_cast<float>(reference.Param("filter_sigma"));
  options.clamp_R = reference.ParamFlag("clamp_R");
  const std::string border = reference.ParamText("border");
  if (border != "zero" && border != "reflect101") throw CaseError("unknown border " + border);
  options.border = border == "zero" ? PdmBorder::kZero : PdmBorder::kReflect101;
  CheckOptions(options);

  Pdm pdm(options);
  pdm.Forward(ReadWeights(reference, options), reference.ReadPlanes("R0"),
              reference.ReadPlanes("N"));
  for (int k = 1; k <= options.stages; ++k) {
    CompareOutput(reference, absl::StrCat("R", k), pdm.R(k), report);
  }
  Planes v_R0 = reference.ReadPlanes("w_out"), v_N = v_R0;
  PdmWeights v_weights;
  pdm.Backward(v_R0, Planes(), v_R0, v_N, &v_weights);
  CompareGradient(reference, "grad_R0", v_R0.data, report);
  CompareGradient(reference, "grad_N", v_N.data, report);
  CompareWeightGradients(reference, options, v_weights, report);
}

}  // namespace litags
