// One reference case on disk, and the comparisons made with it.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_CASE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_CASE_H_

#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/image.h"
#include "engine/io/npy.h"

namespace litags {

// A case that cannot be read or lacks something. Thrown by ReferenceCase and the runners below,
// caught by RunReferenceCases, which fails the case and goes on with the next.
struct CaseError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// case.json (keys: name, kind, params, values, tolerances, arrays) and its arrays.
class ReferenceCase {
 public:
  explicit ReferenceCase(const std::string& folder);
  ~ReferenceCase();
  ReferenceCase(ReferenceCase&&) noexcept;

  const std::string& folder() const { return folder_; }
  std::string name() const;
  std::string kind() const;

  // An entry of params, values or tolerances.
  double Param(const std::string& key) const;
  bool ParamFlag(const std::string& key) const;
  bool HasParam(const std::string& key) const;  // and it is not null
  std::string ParamText(const std::string& key) const;
  std::vector<double> ParamList(const std::string& key) const;
  double Value(const std::string& key) const;
  double Tolerance(const std::string& key) const;

  bool Has(const std::string& array) const;
  NpyArray Array(const std::string& array) const;
  std::vector<float> Floats(const std::string& array) const { return Array(array).ToFloats(); }
  std::vector<double> Doubles(const std::string& array) const { return Array(array).ToDoubles(); }
  Planes ReadPlanes(const std::string& array) const;  // [C,H,W], or [H,W] as one channel
  Planes ReadHwc(const std::string& array) const;     // [H,W,C] to [C,H,W]
  ImageU8 ReadImage(const std::string& array) const;  // bytes [H,W,3]

  // Outputs, gradients and intermediates that nobody has read.
  std::vector<std::string> UnreadResults() const;

 private:
  struct Json;
  std::string folder_;
  std::unique_ptr<Json> json_;
  mutable std::set<std::string> read_;
};

struct Comparison {
  std::string quantity;
  double error;
  double tolerance;
  bool Passed() const { return error <= tolerance; }  // false for NaN
};

// Comparisons of one case.
class CaseReport {
 public:
  void Add(const std::string& quantity, double error, double tolerance) {
    comparisons_.push_back({quantity, error, tolerance});
  }
  const std::vector<Comparison>& comparisons() const { return comparisons_; }

 private:
  std::vector<Comparison> comparisons_;
};

double MaxAbs(absl::Span<const double> values);
// Largest |actual - expected|; NaN if anything is. Throws CaseError if the sizes differ.
double MaxAbsError(absl::Span<const float> actual, absl::Span<const double> expected);

void RunConvCase(const ReferenceCase& reference, CaseReport* report);
void RunPdmCase(const ReferenceCase& reference, CaseReport* report);
void RunPriorCase(const ReferenceCase& reference, CaseReport* report);
void RunLossesCase(const ReferenceCase& reference, CaseReport* report);
void RunMetricsCase(const ReferenceCase& reference, CaseReport* report);
void RunSplatForwardCase(const ReferenceCase& reference, CaseReport* report);
// Reads the forward case of the same scene from the folder beside it.
void RunSplatBackwardCase(const ReferenceCase& reference, CaseReport* report);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_REFERENCE_CASE_H_
