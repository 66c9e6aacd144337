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

// A method by name. What `options` does not set stays as the user has it.
struct Preset {
  const char* name;
  Group group;
  ReconstructOptions (*options)(ReconstructOptions base);
};

using Options = ReconstructOptions;
constexpr Preset kPresets[] = {
    {"litags-no-noise-filter", Group::kChange, WithoutNoiseFilter},
    {"litags-no-depth", Group::kChange, WithoutDepth},
    {"litags-no-noise-filter-depth", Group::kChange,
     [](Options base) { return WithoutNoiseFilter(WithoutDepth(base)); }},
    {"litags-with-pdm", Group::kChange, WithPdm},
    {"litags-prior-geometry", Group::kChange, WithPriorGeometry},
    // The paper's Table 3.
    {"litags-paper-no-pdm", Group::kPaperAblation,
     [](Options base) { return WithoutPdm(PaperSettings(base)); }},
    {"litags-paper-no-depth", Group::kPaperAblation,
     [](Options base) { return WithoutDepth(PaperSettings(base)); }},
    {"litags-paper-no-prior", Group::kPaperAblation,
     [](Options base) { return WithoutPrior(PaperSettings(base)); }},
    {"litags-paper-none", Group::kPaperAblation,
     [](Options base) { return WithoutPdm(WithoutDepth(WithoutPrior(PaperSettings(base)))); }},
    {"litags-paper", Group::kLita, PaperSettings},
    {"litags", Group::kLita, [](Options base) { return base; }},
};

// Plain 3DGS on the photos as it is given them.
ReconstructOptions Plain(ReconstructOptions options) {
  options.method = Method::k3dgs;
  options.tone = Tone::kNone;
  return options;
}

}  // namespace

std::vector<std::string> LitaMethods() {
  std::vector<std::string> names;
  for (const Preset& preset : kPresets) names.push_back(preset.name);
  return names;
}

std::vector<std::string> AllMethods(const std::vector<std::string>& enhancers) {
  std::vector<std::string> names = {"3dgs-normal", "3dgs"};
  for (const std::string& e : enhancers) names.push_back(absl::StrCat("3dgs+", e));
  for (const std::string& e : enhancers) names.push_back(absl::StrCat(e, "+3dgs"));
  for (const std::string& name : LitaMethods()) names.push_back(name);
  return names;
}

absl::StatusOr<TableMethod> ParseMethod(const std::string& name, const ReconstructOptions& base,
                                        const std::vector<std::string>& enhancers) {
  TableMethod method;
  method.name = method.trained_as = name;
  method.options = base;
  method.options.method = Method::kLitaGs;
  for (const Preset& preset : kPresets) {
    if (name != preset.name) continue;
    method.group = preset.group;
    method.options = preset.options(method.options);
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
