#include "engine/tools/evaluation/method_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <type_traits>
#include <utility>

#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "proto/arguments/arguments.h"

namespace litags {

void AddMethodOptions(CLI::App* app, ReconstructOptions* options, std::vector<std::string>* set,
                      absl::Span<const std::string_view> without) {
  VisitFields(FieldsOf<ReconstructOptions>(), *options,
              [app, without](const char* name, auto& value, const FieldRule& rule) {
                if (absl::c_linear_search(without, name)) return;
                std::string flag = absl::StrCat("--", name);
                std::replace(flag.begin(), flag.end(), '_', '-');
                std::string help = rule.help;
                if (rule.zero != nullptr) absl::StrAppend(&help, "; 0: ", rule.zero);
                using T = std::remove_reference_t<decltype(value)>;
                if constexpr (std::is_same_v<T, bool>) {
                  app->add_flag(flag, value, help);
                } else if constexpr (std::is_arithmetic_v<T>) {
                  CLI::Option* option = app->add_option(flag, value, help)->capture_default_str();
                  // CLI11 would make -1 the largest number.
                  if constexpr (std::is_unsigned_v<T>) option->check(AtLeastZero(value));
                } else {
                  app->add_option_function<std::string>(
                         flag,
                         [flag, &value](const std::string& word) {
                           const absl::Status parsed = ParseField(flag, word, &value);
                           if (!parsed.ok()) {
                             throw CLI::ValidationError(std::string(parsed.message()));
                           }
                         },
                         help)
                      ->default_str(FieldText(value));
                }
              });
  app->add_option("--set", *set,
                  "NAME=VALUE: a constant of the method's recipe (engine/train/recipe.h), for "
                  "research; may be repeated")
      ->allow_extra_args(false);
}

absl::Status SetConstants(const std::vector<std::string>& set, ReconstructOptions* options) {
  if (set.empty()) return absl::OkStatus();
  Recipe recipe = options->recipe.has_value() ? *options->recipe : RecipeOf(options->method);
  for (const std::string& text : set) {
    const size_t equals = text.find('=');
    const absl::Status status =
        equals == std::string::npos
            ? InvalidInput("BAD_OPTION", "--set", absl::StrCat("\"", text, "\" is not NAME=VALUE"))
            : SetField(text.substr(0, equals), text.substr(equals + 1), &recipe);
    if (!status.ok()) {
      return InvalidInput(GetErrorDetail(status)->reason, "--set",
                          absl::StrCat("--set: ", std::string(status.message())));
    }
  }
  options->recipe = std::move(recipe);
  return absl::OkStatus();
}

}  // namespace litags
