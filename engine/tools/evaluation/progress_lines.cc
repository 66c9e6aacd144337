#include "engine/tools/evaluation/progress_lines.h"

#include <cmath>
#include <cstdio>

#include "absl/strings/str_format.h"

namespace litags {
namespace {

constexpr std::chrono::seconds kQuiet{10};  // at most so long

}  // namespace

void ProgressLines::OnProgress(const Progress& p) {
  const auto now = std::chrono::steady_clock::now();
  const bool iteration = p.stage == Stage::kTraining && p.message.empty();
  if (iteration && p.preview_png.empty() && now - last_ < kQuiet) return;
  last_ = now;
  if (!iteration) {
    std::fprintf(stderr, "%s: %s\n", std::string(StageName(p.stage)).c_str(), p.message.c_str());
    return;
  }
  const std::string psnr =
      std::isfinite(p.psnr_holdout) ? absl::StrFormat("  held-out %.2f dB", p.psnr_holdout) : "";
  std::fprintf(stderr, "iteration %d/%d  loss %.4f%s  %d Gaussians  %.1f it/s  %.0f s left\n",
               p.iteration, p.iterations, p.loss, psnr.c_str(), static_cast<int>(p.gaussians),
               p.iterations_per_second, p.eta_seconds);
}

}  // namespace litags
