// How every program reads its command line, and what it says of one that is wrong: CLI11's own
// words are for programmers.
#ifndef LITAGS_PROTO_ARGUMENTS_ARGUMENTS_H_
#define LITAGS_PROTO_ARGUMENTS_ARGUMENTS_H_

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"

namespace litags {

// Reads it; the exit status where the program is to end: 0 after --help, 2 for bad usage, which a
// sentence on stderr describes.
std::optional<int> ParseArguments(CLI::App& app, int argc, char** argv);

// For the end of main(): `exit`, or `lost` where `exit` is 0 but not all of stdout could be
// written, as on a full disk, which it says on stderr.
int FlushOutput(int exit, int lost = 1);

// For main(): what `run` returns, or `thrown` after an exception, of which a line on stderr tells.
int RunProgram(const std::string& name, const std::function<int()>& run, int thrown = 1);

// With '?' in place of what steers a terminal, as names of files may hold it; lines stay lines.
std::string WithoutControls(std::string text);

// What is wrong, e.g. "--frames takes a whole number from 1 to 10000, not \"abc\"". `error` is of
// an option of `app`, or of its command that was given.
std::string DescribeUsageError(const CLI::App& app, const CLI::Error& error);

// Of numbers in a range; without `most` there is no upper end, and `above` leaves `least` out.
struct NumberRule {
  bool whole = false;
  double least = 0;
  std::optional<double> most;
  bool above = false;
};
CLI::Validator Numbers(const NumberRule& rule);

// For options of type T, whose own words these are.
template <typename T>
CLI::Validator Between(T least, T most) {
  return Numbers(
      {std::is_integral_v<T>, static_cast<double>(least), static_cast<double>(most), false});
}
template <typename T>
CLI::Validator AtLeastZero(const T& /*option*/) {
  return Numbers({std::is_integral_v<T>, 0, std::nullopt, false});
}
template <typename T>
CLI::Validator AboveZero(const T& /*option*/) {
  return Numbers({std::is_integral_v<T>, 0, std::nullopt, true});
}

CLI::Validator OneOf(std::vector<std::string> words);

// "512MiB" to its number of bytes; for transform().
CLI::Validator ByteSize();

}  // namespace litags

#endif  // LITAGS_PROTO_ARGUMENTS_ARGUMENTS_H_
