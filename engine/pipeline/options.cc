#include "engine/pipeline/options.h"

namespace litags {

absl::Status ReconstructOptions::Validate() const {
  LITAGS_RETURN_IF_ERROR(CheckFields(*this, "options."));
  return ResolveRecipe().Validate();
}

Recipe ReconstructOptions::ResolveRecipe() const {
  Recipe resolved = recipe.has_value() ? *recipe : RecipeOf(method);
  if (tone.has_value()) resolved.tone.rule = *tone;
  return resolved;
}

}  // namespace litags
