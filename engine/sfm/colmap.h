// COLMAP's commands, each as a supervised child program.
#ifndef LITAGS_ENGINE_SFM_COLMAP_H_
#define LITAGS_ENGINE_SFM_COLMAP_H_

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/subprocess.h"
#include "engine/sfm/photo_match.h"
#include "engine/sfm/photo_set.h"
#include "engine/sfm/sfm.h"

namespace litags {

// Fraction of the running command, 0..1, as read from its output.
using FractionFn = std::function<void(double)>;

// One database and the photos it is made of. Every command returns its wall-clock seconds. What
// the commands leave depends on the photos and options only, not on options.threads, the time or
// what else runs; see docs/experiments/cameras.md.
// Errors: FAILED_PRECONDITION COLMAP_NOT_FOUND; INTERNAL COLMAP_FAILED with COLMAP's last lines
// and the log's path, COLMAP_KILLED if it was ended from outside; DEADLINE_EXCEEDED
// PROGRAM_TIMEOUT; CANCELLED.
class Colmap {
 public:
  // Files of `dir`: images/ and masks/ (made by the caller), database.db, logs *.log.
  // `options` and `cancel` must outlive this.
  Colmap(const SfmOptions& options, std::string dir, const CancelToken& cancel);

  std::string images_dir() const { return dir_ + "/images"; }
  std::string masks_dir() const { return dir_ + "/masks"; }
  std::string database_path() const { return dir_ + "/database.db"; }

  // SIFT features of the copies of `photos`. Only those that miss their budget without them have
  // features of the finest scale, which are found at twice the photo's size.
  absl::StatusOr<double> ExtractFeatures(const std::vector<PhotoFile>& photos,
                                         const FractionFn& progress);
  // Checks the stored matches of these pairs against one relative pose each. Nothing to do for no
  // pairs.
  absl::StatusOr<double> Verify(const std::vector<NamePair>& pairs, const FractionFn& progress);
  // Models appear as models_dir/0, 1, ...; none at all is not an error here.
  // Lenses stay as they are if those of all photos are known.
  absl::StatusOr<double> Map(const std::string& models_dir, const std::vector<PhotoFile>& photos,
                             const FractionFn& progress);

 private:
  using OnLine = std::function<void(std::string_view)>;

  // The log is `dir`/`log_name`.log.
  absl::StatusOr<SubprocessResult> Run(std::vector<std::string> args, const std::string& log_name,
                                       const OnLine& on_line);
  absl::StatusOr<double> RunChecked(std::vector<std::string> args, const std::string& log_name,
                                    const OnLine& on_line);
  // `first_octave`: -1 doubles the photos' size, 0 takes them as they are.
  absl::StatusOr<double> ExtractPass(const std::vector<std::string>& copies, int budget,
                                     int first_octave, const std::string& log_name,
                                     const FractionFn& progress);
  absl::Status Failed(std::string_view reason, const std::string& command,
                      const std::string& log_name, const std::string& how) const;
  // One share of Verify, on a database of its own.
  absl::Status VerifyShare(const std::string& database, absl::Span<const NamePair> pairs,
                           const std::string& log_name);

  const SfmOptions& options_;
  const std::string dir_;
  const CancelToken& cancel_;
  const int threads_;
};

// SIFT features per photo: options.max_features, or as many of 1000..4000 as keep the matching of
// up to 100 photos near 40 CPU seconds (it grows with pairs times features squared). Above
// options.match_all_up_to photos 200,000 for all photos together, but 500 a photo at least.
int FeatureBudget(const SfmOptions& options, int num_photos);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_COLMAP_H_
