#include "proto/arguments/arguments.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <new>
#include <utility>

#include "CLI/Validators.hpp"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace litags {
namespace {

// Begins the text of a value that an option does not take: its name goes before.
constexpr char kTakes[] = "takes ";

std::string Refusal(const std::string& rule, const std::string& value) {
  return absl::StrCat(kTakes, rule, ", not \"", value, "\"");
}

// "litags path", or "litags-train" where the program has no commands.
std::string CommandName(const CLI::App& app) {
  const std::string program = app.get_name().substr(app.get_name().rfind('/') + 1);
  const std::vector<CLI::App*> commands = app.get_subcommands();
  return commands.empty() ? program : absl::StrCat(program, " ", commands.front()->get_name());
}

const CLI::Option* FindOption(const CLI::App& app, const std::string& name) {
  for (const CLI::App* command : app.get_subcommands()) {
    if (const CLI::Option* option = command->get_option_no_throw(name)) return option;
  }
  return app.get_option_no_throw(name);
}

bool IsWhole(const std::string& text) {
  const size_t sign = text.starts_with("-") || text.starts_with("+") ? 1 : 0;
  return text.size() > sign && std::all_of(text.begin() + static_cast<std::ptrdiff_t>(sign),
                                           text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::string NumberText(double value) { return absl::StrFormat("%.10g", value); }

std::string RuleText(const NumberRule& rule) {
  std::string text = rule.whole ? "a whole number" : "a number";
  if (rule.most.has_value()) {
    absl::StrAppend(&text, " from ", NumberText(rule.least), " to ", NumberText(*rule.most));
  } else {
    absl::StrAppend(&text, rule.above ? " above " : " from ", NumberText(rule.least),
                    rule.above ? "" : " on");
  }
  return text;
}

// Of a value that is no number of the option's type.
std::string DescribeConversion(const CLI::App& app, const std::string& name,
                               const std::string& value) {
  const CLI::Option* option = FindOption(app, name);
  if (option != nullptr && option->get_items_expected_max() == 0) {
    return absl::StrCat(name, " takes true or false");
  }
  const std::string type = option != nullptr ? option->get_type_name() : "";
  if (!type.starts_with("INT") && !type.starts_with("UINT")) {
    return absl::StrCat(name, " ", Refusal("a number", value));
  }
  return IsWhole(value) ? absl::StrCat(name, ": ", value, " is too large a number")
                        : absl::StrCat(name, " ", Refusal("a whole number", value));
}

// Of an option with fewer values than it takes, or more.
std::string DescribeCount(const CLI::App& app, const std::string& name, const std::string& text) {
  const CLI::Option* option = FindOption(app, name);
  const int takes = option != nullptr ? option->get_items_expected_min() : 1;
  if (takes > 1) return absl::StrCat(name, " takes ", takes, " values");
  return absl::StrContains(text, "missing") ? absl::StrCat(name, " has no value")
                                            : absl::StrCat(name, " is given more than once");
}

// What was given that is not taken; CLI11 tells of it after what is missing: of
// "render x --out y.png" that --output is required. Empty: all that is given is known.
std::string DescribeUnknown(const CLI::App& app) {
  const std::vector<std::string> words = app.remaining(/*recurse=*/true);
  if (words.empty() || (app.get_require_subcommand_min() > 0 && app.get_subcommands().empty())) {
    return "";
  }
  const auto option = std::find_if(words.begin(), words.end(),
                                   [](const std::string& word) { return word.starts_with("-"); });
  const std::string command = CommandName(app);
  return option != words.end()
             ? absl::StrCat("there is no option ", *option, " of ", command)
             : absl::StrCat(command, " does not take: ", absl::StrJoin(words, " "));
}

// Without a command that there is: which there are.
std::string DescribeCommands(const CLI::App& app) {
  const std::vector<std::string> words = app.remaining();
  return absl::StrCat(
      words.empty() ? "no command is given"
                    : absl::StrCat("there is no command \"", words.front(), "\""),
      "; choose one of: ",
      absl::StrJoin(app.get_subcommands(nullptr), " ",
                    [](std::string* out, const CLI::App* c) { out->append(c->get_name()); }));
}

void Print(const std::string& text) { std::fprintf(stderr, "%s\n", WithoutControls(text).c_str()); }

}  // namespace

std::optional<int> ParseArguments(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::RuntimeError& error) {
    return error.get_exit_code();  // whoever throws it says why
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    const bool no_command = app.get_require_subcommand_min() > 0 && app.get_subcommands().empty();
    const std::string command = CommandName(app);
    if (no_command && (error.get_name() == "RequiredError" || error.get_name() == "ExtrasError")) {
      Print(DescribeCommands(app));
      Print(absl::StrCat(command, " --help and ", command, " COMMAND --help say more"));
    } else {
      Print(absl::StrCat(DescribeUsageError(app, error), "; ", command,
                         " --help says what there is"));
    }
    return 2;
  }
}

int FlushOutput(int exit, int lost) {
  // What was lost before, the last flush does not tell.
  const bool whole = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (whole) return exit;
  std::fprintf(stderr, "not all of the output could be written\n");
  return exit == 0 ? lost : exit;
}

int RunProgram(const std::string& name, const std::function<int()>& run, int thrown) {
  try {
    return run();
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory\n", name.c_str());
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), WithoutControls(e.what()).c_str());
  } catch (...) {
    std::fprintf(stderr, "%s: an exception of unknown kind\n", name.c_str());
  }
  return thrown;
}

std::string WithoutControls(std::string text) {
  for (size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const bool c1 =
        c == 0xC2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xA0;
    if (c1) text.erase(i, 1);
    if (c1 || (c < 0x20 && c != '\n') || c == 0x7F) text[i] = '?';
  }
  return text;
}

std::string DescribeUsageError(const CLI::App& app, const CLI::Error& error) {
  if (std::string unknown = DescribeUnknown(app); !unknown.empty()) return unknown;
  const std::string kind = error.get_name(), text = error.what();
  // The parts of the text before and after `words`; empty where it does not hold them.
  const auto around = [&text](const std::string& words) {
    const size_t at = text.find(words);
    return at == text.npos ? std::pair<std::string, std::string>()
                           : std::pair(text.substr(0, at), text.substr(at + words.size()));
  };
  if (const std::string could_not = "Could not convert: "; text.starts_with(could_not)) {
    const auto [name, value] = around(" = ");
    return DescribeConversion(app, name.substr(could_not.size()), value);
  }
  if (const auto name = around(":").first; kind == "ArgumentMismatch" && !name.empty()) {
    return DescribeCount(app, name, text);
  }
  if (const auto group = around("Exactly 1 option from [").second; !group.empty()) {
    return absl::StrCat(text.ends_with(" given") ? "give only one of " : "give one of ",
                        group.substr(0, group.find(']')));
  }
  if (const auto name = around(" is required").first; kind == "RequiredError" && !name.empty()) {
    return absl::StrCat(name, " is not given");
  }
  if (kind == "RequiresError") {
    const auto [name, other] = around(" requires ");
    return absl::StrCat(name, " needs ", other, ", too");
  }
  if (kind == "ExcludesError") {
    const auto [name, other] = around(" excludes ");
    return absl::StrCat(name, " and ", other, " exclude each other: leave one out");
  }
  if (const auto [name, rest] = around(absl::StrCat(": ", kTakes)); !name.empty()) {
    return absl::StrCat(name, " ", kTakes, rest);
  }
  return text;
}

CLI::Validator Numbers(const NumberRule& rule) {
  return CLI::Validator(
      [rule](std::string& text) -> std::string {
        double value = 0;
        const bool number = absl::SimpleAtod(text, &value) && std::isfinite(value) &&
                            (!rule.whole || IsWhole(text));
        const bool inside = number && (rule.above ? value > rule.least : value >= rule.least) &&
                            (!rule.most.has_value() || value <= *rule.most);
        return inside ? "" : Refusal(RuleText(rule), text);
      },
      rule.most.has_value()
          ? absl::StrCat(NumberText(rule.least), "..", NumberText(*rule.most))
          : absl::StrCat(rule.above ? "above " : "from ", NumberText(rule.least)));
}

CLI::Validator OneOf(std::vector<std::string> words) {
  const std::string rule = absl::StrJoin(words, " or ");
  const std::string choices = absl::StrJoin(words, "|");
  return CLI::Validator(
      [words = std::move(words), rule](std::string& text) -> std::string {
        const bool known = std::find(words.begin(), words.end(), text) != words.end();
        return known ? "" : Refusal(rule, text);
      },
      choices);
}

CLI::Validator ByteSize() {
  return CLI::Validator(
      [convert = CLI::AsSizeValue(/*kb_is_1000=*/false)](std::string& text) mutable -> std::string {
        const std::string given = text;
        std::string wrong = text.starts_with("-") ? "negative" : "";  // CLI11 makes it a large one
        try {
          if (wrong.empty()) wrong = convert(text);
        } catch (const CLI::ValidationError& error) {
          wrong = error.what();
        }
        return wrong.empty() ? "" : Refusal("a number of bytes, as 512MiB or 4GiB", given);
      },
      "bytes");
}

}  // namespace litags
