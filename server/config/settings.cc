#include "server/config/settings.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

// "max-jobs" of --max-jobs; empty for what has no long name.
std::string NameOf(const CLI::Option* option) {
  return option->get_lnames().empty() ? "" : option->get_lnames().front();
}

bool IsTomlLiteral(const std::string& value) {
  if (value == "true" || value == "false") return true;
  char* end = nullptr;
  std::strtod(value.c_str(), &end);
  const bool plain =
      !value.empty() && (std::isdigit(static_cast<unsigned char>(value[0])) || value[0] == '-');
  return plain && *end == '\0';
}

// CLI11 ends a value at '#' even inside quotes.
bool HasQuotedHash(const std::string& text) {
  char quote = 0;  // the one that is open
  bool comment = false;
  for (const char c : text) {
    if (c == '\n') {
      quote = 0;
      comment = false;
    } else if (c == '#') {
      if (quote != 0) return true;
      comment = true;
    } else if (!comment && (c == quote || (quote == 0 && (c == '"' || c == '\'')))) {
      quote = quote == 0 ? c : 0;
    }
  }
  return false;
}

// Without its comment and the white space around.
std::string TextOf(const std::string& line) {
  const std::string text = CLI::detail::trim_copy(line.substr(0, line.find('#')));
  return text.starts_with(';') ? "" : text;  // a comment to CLI11
}

bool IsName(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_';
  });
}

// Whether `text` begins a setting: NAME = VALUE.
bool IsSetting(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos) return false;
  std::string name = text.substr(0, equals);
  return IsName(CLI::detail::remove_quotes(CLI::detail::trim(name)));
}

bool IsSection(const std::string& text) {
  return text.size() > 2 && text.front() == '[' && text.back() == ']' &&
         IsName(std::string_view(text).substr(1, text.size() - 2));
}

bool OpensList(const std::string& setting) {
  return CLI::detail::trim_copy(setting.substr(setting.find('=') + 1)).starts_with('[');
}

// The settings of a file for CLI11, each on a line with all of its list. CONFIG_INVALID names a
// line by its number alone: what stands where a name should may be a secret value.
absl::StatusOr<std::string> OneLineEach(const std::string& path, const std::string& file) {
  std::istringstream stream(file);
  std::string settings, line;
  for (int number = 1; std::getline(stream, line); ++number) {
    std::string text = TextOf(line);
    if (text.empty()) continue;
    if (!IsSetting(text) && !IsSection(text)) {
      return InvalidInput("CONFIG_INVALID", "--config",
                          absl::StrCat(path, ": line ", number,
                                       " is not NAME = VALUE; begin a value or list on the line of "
                                       "its name"));
    }
    const int first = number;
    while (!IsSection(text) && OpensList(text) && !text.ends_with(']')) {
      const bool ended = !std::getline(stream, line);
      const std::string more = ended ? "" : TextOf(line);
      if (ended || IsSetting(more)) {
        return InvalidInput("CONFIG_INVALID", "--config",
                            absl::StrCat(path, ": the list that begins on line ", first,
                                         " has no end; write a ] after it"));
      }
      text += more;
      ++number;
    }
    absl::StrAppend(&settings, text, "\n");
  }
  return settings;
}

std::string TomlValue(const std::string& value) {
  return IsTomlLiteral(value) ? value : absl::StrCat("\"", value, "\"");
}

std::string TomlValue(const std::vector<std::string>& values, bool is_list) {
  if (!is_list) return TomlValue(values.empty() ? "" : values.front());
  return absl::StrCat("[",
                      absl::StrJoin(values, ", ",
                                    [](std::string* out, const std::string& value) {
                                      out->append(TomlValue(value));
                                    }),
                      "]");
}

// What is wrong with an option's value, without its name: " takes json or text, not \"xml\"".
std::string AfterName(const std::string& name, const CLI::App& app, const CLI::Error& error) {
  const std::string text = DescribeUsageError(app, error);
  return text.starts_with(name) ? text.substr(name.size()) : ": " + text;
}

}  // namespace

std::string Settings::EnvironmentName(const std::string& name) const {
  std::string variable = absl::StrCat(rules_.env_prefix, "_", name);
  for (char& c : variable) c = c == '-' ? '_' : static_cast<char>(std::toupper(c));
  return variable;
}

absl::Status Settings::ReadFile(const std::string& path) {
  std::vector<CLI::ConfigItem> items;
  std::ifstream stream(path);
  std::stringstream file;
  stream.peek();  // a folder opens, but cannot be read
  file << stream.rdbuf();
  if (!stream) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "CONFIG_UNREADABLE", "--config",
                     absl::StrCat("cannot read ", path, "; check the path and who may read it"));
  }
  if (HasQuotedHash(file.str())) {
    return InvalidInput("CONFIG_INVALID", "--config",
                        absl::StrCat(path,
                                     ": a value in quotes holds a '#', which the reader would "
                                     "take for a comment; use another path, or a flag"));
  }
  LITAGS_ASSIGN_OR_RETURN(const std::string lines, OneLineEach(path, file.str()));
  std::istringstream settings(lines);
  try {
    items = CLI::ConfigTOML().from_config(settings);
  } catch (const CLI::Error& error) {
    return InvalidInput("CONFIG_INVALID", "--config", absl::StrCat(path, ": ", error.what()));
  }
  for (CLI::ConfigItem& item : items) {
    if (!item.parents.empty()) {
      return InvalidInput("CONFIG_KEY_UNKNOWN", item.parents[0],
                          absl::StrCat(path, " has a section [", item.parents[0],
                                       "]; settings stand without sections: remove that line"));
    }
    const CLI::Option* option = app_->get_option_no_throw("--" + item.name);
    if (!option || rules_.command_line_only.count(item.name) > 0) {
      return InvalidInput("CONFIG_KEY_UNKNOWN", item.name,
                          absl::StrCat(path, ": there is no setting \"", item.name,
                                       "\"; --print-config lists those there are"));
    }
    if (!file_.emplace(item.name, std::move(item.inputs)).second) {
      return InvalidInput("CONFIG_KEY_TWICE", item.name,
                          absl::StrCat(path, " sets \"", item.name, "\" twice; keep one line"));
    }
  }
  return absl::OkStatus();
}

absl::Status Settings::Apply(CLI::Option* option, const std::string& name) {
  std::string& place = places_[name];
  if (option->count() > 0) {
    place = "command line";
    return absl::OkStatus();
  }
  std::vector<std::string> variables = {EnvironmentName(name)};
  if (const auto other = rules_.other_env.find(name); other != rules_.other_env.end()) {
    variables.push_back(other->second);
  }
  std::vector<std::string> values;
  for (const std::string& variable : variables) {
    const char* value = std::getenv(variable.c_str());
    if (!value || !*value || !values.empty()) continue;
    values = {value};
    place = absl::StrCat("environment ", variable);
  }
  if (values.empty()) {
    const auto found = file_.find(name);
    if (found == file_.end()) {
      place = "default";
      return absl::OkStatus();
    }
    values = found->second;
    place = absl::StrCat("file ", config_path_);
    if (values.empty()) return absl::OkStatus();  // an empty list
  }
  try {
    option->add_result(values);
    option->run_callback();
  } catch (const CLI::Error& error) {
    const bool secret = rules_.secret.count(name) > 0;
    return InvalidInput(
        "SETTING_INVALID", "--" + name,
        absl::StrCat("--", name, " from ", place,
                     secret ? ": its value is not valid" : AfterName("--" + name, *app_, error)));
  }
  return absl::OkStatus();
}

absl::Status Settings::Complete(const std::string& config_path) {
  config_path_ = config_path;
  if (!config_path.empty()) LITAGS_RETURN_IF_ERROR(ReadFile(config_path));
  for (CLI::Option* option : app_->get_options()) {
    const std::string name = NameOf(option);
    if (name.empty() || name == "help" || rules_.command_line_only.count(name) > 0) continue;
    LITAGS_RETURN_IF_ERROR(Apply(option, name));
  }
  return absl::OkStatus();
}

std::string Settings::Print() const {
  std::string text;
  for (const auto& [name, place] : places_) {
    const CLI::Option* option = app_->get_option("--" + name);
    const bool is_list = option->get_items_expected_max() > 1;
    if (rules_.secret.count(name) > 0) {
      absl::StrAppend(&text, "# ", name, " = (", option->count(), " values, not shown)");
    } else if (option->count() > 0) {
      absl::StrAppend(&text, name, " = ", TomlValue(option->reduced_results(), is_list));
    } else if (option->get_items_expected_max() == 0) {  // a flag
      absl::StrAppend(&text, name, " = false");
    } else if (is_list) {
      absl::StrAppend(&text, name, " = []");
    } else {
      absl::StrAppend(&text, name, " = ", TomlValue(option->get_default_str()));
    }
    absl::StrAppend(&text, "  # ", place, "\n");
  }
  return text;
}

}  // namespace litags
