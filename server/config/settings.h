#ifndef LITAGS_SERVER_CONFIG_SETTINGS_H_
#define LITAGS_SERVER_CONFIG_SETTINGS_H_

#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace litags {

// The options of a program from four places. For each option the first place that names it wins:
// command line, environment, configuration file, default.
//
// The environment variable of --max-jobs is PREFIX_MAX_JOBS; one that is empty names nothing. The
// file is TOML: a line "max-jobs = 10" for each option, without sections.
class Settings {
 public:
  struct Rules {
    std::string env_prefix;
    // Second environment variables, by option: {"data", "LITAGS_DATA"}.
    std::map<std::string, std::string> other_env;
    std::set<std::string> command_line_only;  // options that belong to one run: "check"
    std::set<std::string> secret;             // options whose values are never shown
  };

  // `app` must outlive this; its options are set by Complete().
  Settings(CLI::App* app, Rules rules) : app_(app), rules_(std::move(rules)) {}

  // Call after app->parse(). `config_path` empty: no file. FAILED_PRECONDITION
  // (CONFIG_UNREADABLE); INVALID_ARGUMENT (CONFIG_INVALID, CONFIG_KEY_UNKNOWN, CONFIG_KEY_TWICE,
  // SETTING_INVALID), naming the place and the option, and no secret.
  absl::Status Complete(const std::string& config_path);

  // All settings, one a line, each with its place as a comment: a configuration file.
  std::string Print() const;

 private:
  absl::Status ReadFile(const std::string& path);
  absl::Status Apply(CLI::Option* option, const std::string& name);
  std::string EnvironmentName(const std::string& name) const;

  CLI::App* const app_;
  const Rules rules_;
  std::string config_path_;
  std::map<std::string, std::vector<std::string>> file_;  // values by option
  std::map<std::string, std::string> places_;             // by option
};

}  // namespace litags

#endif  // LITAGS_SERVER_CONFIG_SETTINGS_H_
