#include "client/text.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/report/text.h"

namespace litags::client {
namespace {

// "250/3000" while iterating, "" before.
std::string IterationText(const v1::Progress& progress) {
  if (progress.iterations() <= 0) return "";
  return absl::StrCat(progress.iteration(), "/", progress.iterations());
}

// The numbers known so far, the most wanted first.
std::vector<std::string> Numbers(const v1::Progress& progress) {
  std::vector<std::string> numbers;
  if (progress.loss() > 0) numbers.push_back(absl::StrFormat("loss %.4f", progress.loss()));
  if (progress.gaussians() > 0) {
    numbers.push_back(report::CountText(progress.gaussians()) + " Gaussians");
  }
  if (progress.iterations_per_second() > 0) {
    numbers.push_back(absl::StrFormat("%.1f it/s", progress.iterations_per_second()));
  }
  if (progress.has_eta()) {
    numbers.push_back("ETA " + report::DurationText(report::SecondsOf(progress.eta())));
  }
  if (progress.has_psnr_holdout()) {
    numbers.push_back(absl::StrFormat("PSNR %.2f dB", progress.psnr_holdout()));
  }
  if (!progress.message().empty()) numbers.push_back(report::Printable(progress.message()));
  return numbers;
}

// At most `columns` bytes, not ending inside a UTF-8 character.
std::string Cut(std::string text, size_t columns) {
  if (text.size() <= columns) return text;
  while (columns > 0 && (static_cast<unsigned char>(text[columns]) & 0xC0) == 0x80) --columns;
  text.resize(columns);
  return text;
}

// Of a job that has ended otherwise.
std::string FinishedText(const v1::Job& job) {
  if (!job.has_report()) return "";
  return absl::StrCat("  the finished scene of ", job.report().iterations(),
                      " iterations is still there\n");
}

std::string Bar(double fraction, size_t width) {
  const double clamped = std::clamp(fraction, 0.0, 1.0);
  const auto full = static_cast<size_t>(clamped * static_cast<double>(width));
  return absl::StrCat("[", std::string(full, '='), std::string(width - full, ' '), "]");
}

}  // namespace

std::string EventLine(const v1::JobEvent& event) {
  const std::string number = absl::StrCat("#", event.number(), " ");
  switch (event.event_case()) {
    case v1::JobEvent::kStateChange: {
      const auto& change = event.state_change();
      // The message of a job that enters the queue is "started", by StartJob, and it is not yet.
      const bool started = change.state() == v1::JOB_STATE_QUEUED && change.message() == "started";
      const std::string why = change.has_error() ? change.error().message()
                              : started          ? ""
                                                 : change.message();
      return absl::StrCat(number, report::StateText(change.state()), why.empty() ? "" : ": ",
                          absl::StrReplaceAll(report::Printable(why), {{"\n", " "}}));
    }
    case v1::JobEvent::kSnapshot:
      return absl::StrCat(number, "snapshot of iteration ", event.snapshot().iteration());
    case v1::JobEvent::kProgress: {
      std::vector<std::string> parts = {report::StageText(event.progress().stage())};
      if (const std::string at = IterationText(event.progress()); !at.empty()) {
        parts.push_back(at);
      }
      for (auto& part : Numbers(event.progress())) parts.push_back(std::move(part));
      return number + absl::StrReplaceAll(absl::StrJoin(parts, "  "), {{"\n", " "}});
    }
    case v1::JobEvent::EVENT_NOT_SET:
      break;
  }
  return number + "(an event of a newer server)";
}

std::string ProgressLine(const v1::Progress& progress, size_t columns) {
  std::string line = report::StageText(progress.stage());
  const std::string at = IterationText(progress);
  if (!at.empty()) absl::StrAppend(&line, "  ", at);
  std::string tail;
  for (const std::string& number : Numbers(progress)) {
    if (line.size() + tail.size() + 2 + number.size() <= columns) {
      absl::StrAppend(&tail, "  ", number);
    }
  }
  constexpr size_t kNarrowestBar = 10, kWidestBar = 30, kFrame = 4;  // "  [" and "]"
  const size_t used = line.size() + tail.size() + kFrame;
  if (!at.empty() && used + kNarrowestBar <= columns) {
    const double fraction = static_cast<double>(progress.iteration()) / progress.iterations();
    absl::StrAppend(&line, "  ", Bar(fraction, std::min(kWidestBar, columns - used)));
  }
  return Cut(absl::StrReplaceAll(line + tail, {{"\n", " "}}), columns);
}

std::string OutcomeText(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_FAILED) {
    const auto& detail = job.error().detail();
    std::string text = absl::StrCat(job.name(), " failed: ", job.error().message(), "\n");
    if (!detail.field().empty()) absl::StrAppend(&text, "  field:  ", detail.field(), "\n");
    if (!detail.reason().empty()) absl::StrAppend(&text, "  reason: ", detail.reason(), "\n");
    return report::Printable(text) + FinishedText(job);
  }
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    return absl::StrCat(report::Printable(job.name()), " is ", report::StateText(job.state()), "\n",
                        FinishedText(job));
  }
  const auto& result = job.report();
  std::string text = absl::StrCat(job.name(), " succeeded: ", report::CountText(result.gaussians()),
                                  " Gaussians after ", result.iterations(), " iterations in ",
                                  report::DurationText(report::SecondsOf(result.run_time())));
  if (result.has_psnr_holdout()) {
    absl::StrAppendFormat(&text, ", PSNR %.2f dB", result.psnr_holdout());
    if (result.has_ssim_holdout()) {
      absl::StrAppendFormat(&text, ", SSIM %.4f", result.ssim_holdout());
    }
    absl::StrAppend(&text, " on held-out views");
  }
  absl::StrAppend(&text, "\n  cameras found for ", result.registered(), " of ", result.photos(),
                  " photos (", result.sfm_preparation(), ")\n");
  if (result.dropped_size() > 0) {
    absl::StrAppend(&text, "  without a camera: ", absl::StrJoin(result.dropped(), ", "), "\n");
  }
  for (const std::string& note : result.notes()) absl::StrAppend(&text, "  note: ", note, "\n");
  return report::Printable(text);
}

}  // namespace litags::client
