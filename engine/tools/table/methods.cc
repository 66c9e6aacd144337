#include "engine/tools/table/methods.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/tools/evaluation/method_options.h"

namespace litags {
namespace {

using Group = TableMethod::Group;

// The paper's Table 3.
struct Ablation {
  const char* name;
  bool pdm, depth, prior;  // kept
};
constexpr Ablation kAblations[] = {{"litags-no-pdm", false, true, true},
                                   {"litags-no-depth", true, false, true},
                                   {"litags-no-prior", true, true, false},
                                   {"litags-no-pdm-depth-prior", false, false, false}};

// Plain 3DGS on the photos as it is given them.
ReconstructOptions Plain(ReconstructOptions options) {
  options.method = Method::k3dgs;
  options.tone = Tone::kNone;
  return options;
}

}  // namespace

std::vector<std::string> AllMethods(const std::vector<std::string>& enhancers) {
  std::vector<std::string> names = {"3dgs-normal", "3dgs"};
  for (const std::string& e : enhancers) names.push_back(absl::StrCat("3dgs+", e));
  for (const std::string& e : enhancers) names.push_back(absl::StrCat(e, "+3dgs"));
  for (const Ablation& ablation : kAblations) names.push_back(ablation.name);
  names.insert(names.end(), {"litags-paper", "litags"});
  return names;
}

absl::StatusOr<TableMethod> ParseMethod(const std::string& name, const ReconstructOptions& base,
                                        const std::vector<std::string>& enhancers) {
  TableMethod method;
  method.name = method.trained_as = name;
  method.options = base;
  method.options.method = Method::kLitaGs;
  if (name == "litags") return method;
  if (name == "litags-paper") {
    method.options = PaperSettings(base);
    return method;
  }
  for (const Ablation& ablation : kAblations) {
    if (name != ablation.name) continue;
    method.group = Group::kAblation;
    method.options.use_pdm = base.use_pdm && ablation.pdm;
    method.options.noise_filter = base.noise_filter && ablation.pdm;
    method.options.use_depth = base.use_depth && ablation.depth;
    method.options.dense_start = base.dense_start && ablation.depth;
    method.options.use_prior = base.use_prior && ablation.prior;
    return method;
  }

  method.options = Plain(base);
  method.group = Group::kVanilla;
  if (name == "3dgs") return method;
  if (name == "3dgs-normal") {
    method.group = Group::kReference;
    method.normal_light = true;
    return method;
  }
  for (const std::string& e : enhancers) {
    if (name == absl::StrCat(e, "+3dgs")) {
      method.group = Group::kBefore;
      method.before = e;
      return method;
    }
    if (name == absl::StrCat("3dgs+", e)) {
      method.group = Group::kAfter;
      method.after = e;
      method.trained_as = "3dgs";
      return method;
    }
  }
  return InvalidInput("UNKNOWN_METHOD", "--methods",
                      absl::StrCat("--methods: there is no ", name, "; choose from all, ",
                                   absl::StrJoin(AllMethods(enhancers), ", ")));
}

}  // namespace litags
