#include "engine/tools/bench/reference.h"

#include <cstdio>
#include <filesystem>
#include <map>
#include <vector>

#include "engine/io/file_util.h"
#include "engine/tools/bench/reference_case.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

using Runner = void (*)(const ReferenceCase&, CaseReport*);

const std::map<std::string, Runner>& Runners() {
  static const auto* runners = new std::map<std::string, Runner>{
      {"conv", RunConvCase},
      {"conv_pdm", RunPdmCase},
      {"losses", RunLossesCase},
      {"metrics", RunMetricsCase},
      {"prior", RunPriorCase},
      {"splat_backward", RunSplatBackwardCase},
      {"splat_forward", RunSplatForwardCase},
  };
  return *runners;
}

std::vector<fs::path> FindCases(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "case.json", ignored)) return {folder};
  const auto names = ListNames(folder, "", [](const fs::directory_entry& entry) {
    std::error_code unseen;
    return fs::exists(entry.path() / "case.json", unseen);
  });
  std::vector<fs::path> cases;
  if (!names.ok()) return cases;
  for (const std::string& name : *names) cases.push_back(folder / name);
  return cases;
}

void PrintRow(std::ostream& out, const std::string& name, const Comparison& row) {
  char line[256];
  std::snprintf(line, sizeof line, "%-33s %-31s %10.2e %10.2e  %s\n", name.c_str(),
                row.quantity.c_str(), row.error, row.tolerance, row.Passed() ? "pass" : "FAIL");
  out << line;
}

void RunCase(const std::string& folder, std::ostream& out, ReferenceSummary* summary) {
  const ReferenceCase reference(folder);
  const std::string name = reference.name();
  const auto runner = Runners().find(reference.kind());
  if (runner == Runners().end()) throw CaseError("unknown kind \"" + reference.kind() + "\"");

  CaseReport report;
  runner->second(reference, &report);
  if (report.comparisons().empty()) throw CaseError("nothing in it to compare");
  for (const Comparison& row : report.comparisons()) {
    PrintRow(out, name, row);
    ++summary->comparisons;
    summary->failed += !row.Passed();
  }
  std::string unread;
  for (const std::string& array : reference.UnreadResults()) unread += " " + array;
  if (!unread.empty()) out << name << " not covered by the engine's interface:" << unread << "\n";
}

}  // namespace

ReferenceSummary RunReferenceCases(const std::string& folder, std::ostream& out) {
  ReferenceSummary summary;
  char header[128];
  std::snprintf(header, sizeof header, "%-33s %-31s %10s %10s\n", "case", "quantity", "error",
                "tolerance");
  out << header;
  for (const fs::path& path : FindCases(folder)) {
    ++summary.cases;
    try {
      RunCase(path.string(), out, &summary);
    } catch (const std::exception& error) {  // CaseError, or what nlohmann::json throws
      ++summary.unreadable;
      out << path.filename().string() << " UNREADABLE: " << error.what() << "\n";
    }
  }
  if (summary.cases == 0) out << "no case folders (with case.json) in " << folder << "\n";
  out << summary.cases << " cases, " << summary.comparisons << " comparisons, " << summary.failed
      << " past tolerance, " << summary.unreadable << " unreadable\n";
  return summary;
}

}  // namespace litags
