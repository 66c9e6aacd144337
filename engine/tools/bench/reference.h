// Runs the engine on reference cases and compares every number they give.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_H_

#include <ostream>
#include <string>

namespace litags {

struct ReferenceSummary {
  int cases = 0;
  int comparisons = 0;
  int failed = 0;      // comparisons past their tolerance
  int unreadable = 0;  // cases of an unknown kind, or that could not be read or run

  bool AllPassed() const { return comparisons > 0 && failed == 0 && unreadable == 0; }
};

// Every case folder (one that holds case.json) in `folder`, in order of name, or `folder` itself.
// Prints a table to `out`: case, quantity, largest error, tolerance, verdict; arrays of a case that
// the engine has no counterpart for are listed as not covered. A folder without cases fails.
ReferenceSummary RunReferenceCases(const std::string& folder, std::ostream& out);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_H_
