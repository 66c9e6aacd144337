#include "engine/tools/table/methods.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/tools/evaluation/method_options.h"

namespace litags {
namespace {

using Group = TableMethod::Group;

struct Named {
  const char* name;
  Group group;
  Method method;
  Recipe (*change)(Recipe);  // null: the method as it is
};

constexpr Named kNamed[] = {
    {"litags-no-noise-filter", Group::kChange, Method::kLitags, WithoutNoiseFilter},
    {"litags-no-depth", Group::kChange, Method::kLitags, WithoutDepth},
    {"litags-no-noise-filter-depth", Group::kChange, Method::kLitags,
     [](Recipe r) { return WithoutNoiseFilter(WithoutDepth(r)); }},
    {"litags-with-pdm", Group::kChange, Method::kLitags, WithPdm},
    {"litags-prior-geometry", Group::kChange, Method::kLitags, WithPriorGeometry},
    // The paper's Table 3.
    {"litags-paper-no-pdm", Group::kPaperAblation, Method::kLitagsPaper, WithoutPdm},
    {"litags-paper-no-depth", Group::kPaperAblation, Method::kLitagsPaper, WithoutDepth},
    {"litags-paper-no-prior", Group::kPaperAblation, Method::kLitagsPaper, WithoutPrior},
    {"litags-paper-none", Group::kPaperAblation, Method::kLitagsPaper,
     [](Recipe r) { return WithoutPdm(WithoutDepth(WithoutPrior(r))); }},
    {"litags-paper", Group::kLita, Method::kLitagsPaper, nullptr},
    {"litags", Group::kLita, Method::kLitags, nullptr},
};

}  // namespace

std::vector<std::string> LitaMethods() {
  std::vector<std::string> names;
  for (const Named& named : kNamed) names.push_back(named.name);
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
                                        const std::vector<std::string>& enhancers,
                                        const std::vector<std::string>& set) {
  TableMethod method;
  method.name = method.trained_as = name;
  method.options = base;
  for (const Named& named : kNamed) {
    if (name != named.name) continue;
    method.group = named.group;
    method.options.method = named.method;
    LITAGS_RETURN_IF_ERROR(SetConstants(set, &method.options));
    if (named.change == nullptr) return method;
    // After `set`, which must not undo what the name says.
    method.options.recipe = named.change(method.options.recipe.value_or(RecipeOf(named.method)));
    return method;
  }

  method.options.method = Method::k3dgs;
  LITAGS_RETURN_IF_ERROR(SetConstants(set, &method.options));
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
