#include "client/text.h"

#include <openssl/asn1.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace litags::client {
namespace {

// "JOB_STATE_RUNNING" without prefix, in small letters, with '-' for '_'.
std::string EnumText(const std::string& name, size_t prefix_length) {
  std::string text = absl::AsciiStrToLower(name.substr(std::min(prefix_length, name.size())));
  std::replace(text.begin(), text.end(), '_', '-');
  return text;
}

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
    numbers.push_back(CountText(progress.gaussians()) + " Gaussians");
  }
  if (progress.iterations_per_second() > 0) {
    numbers.push_back(absl::StrFormat("%.1f it/s", progress.iterations_per_second()));
  }
  if (progress.has_eta()) numbers.push_back("ETA " + DurationText(SecondsOf(progress.eta())));
  if (progress.has_psnr_holdout()) {
    numbers.push_back(absl::StrFormat("PSNR %.2f dB", progress.psnr_holdout()));
  }
  if (!progress.message().empty()) numbers.push_back(Printable(progress.message()));
  return numbers;
}

struct Character {
  size_t length = 0;  // in bytes; 0: the first byte belongs to no character
  unsigned long code = 0;
};

Character FirstCharacter(std::string_view text) {
  Character first;
  const int length = UTF8_getc(reinterpret_cast<const unsigned char*>(text.data()),
                               static_cast<int>(std::min<size_t>(text.size(), 4)), &first.code);
  const bool surrogate = first.code >= 0xD800 && first.code < 0xE000;
  if (length > 0 && first.code <= 0x10FFFF && !surrogate)
    first.length = static_cast<size_t>(length);
  return first;
}

// Shows nothing, and changes how what is beside it shows: controls, line separators, and what
// steers the direction of text.
bool IsControl(unsigned long code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x061C || code == 0x200E ||
         code == 0x200F || (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
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

double SecondsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}

std::string DurationText(double seconds) {
  const auto total = static_cast<int64_t>(std::llround(std::clamp(seconds, 0.0, 1e9)));
  if (total < 60) return absl::StrFormat("%ds", total);
  if (total < 3600) return absl::StrFormat("%dm%02ds", total / 60, total % 60);
  return absl::StrFormat("%dh%02dm", total / 3600, total / 60 % 60);
}

std::string CountText(int64_t count) {
  const std::string digits = absl::StrCat(count);
  const size_t sign = count < 0 ? 1 : 0;
  std::string text;
  for (size_t i = 0; i < digits.size(); ++i) {
    if (i > sign && (digits.size() - i) % 3 == 0) text.push_back(',');
    text.push_back(digits[i]);
  }
  return text;
}

std::string BytesText(int64_t bytes) {
  if (bytes < 1000) return absl::StrCat(bytes, " B");
  double value = static_cast<double>(bytes);
  const char* const units[] = {"kB", "MB", "GB", "TB"};
  size_t unit = 0;
  for (value /= 1000; value >= 999.95 && unit + 1 < std::size(units); value /= 1000) ++unit;
  return absl::StrFormat("%.1f %s", value, units[unit]);
}

std::string StateText(v1::JobState state) {
  return EnumText(v1::JobState_Name(state), sizeof("JOB_STATE_") - 1);
}

std::string StageText(v1::Stage stage) {
  return EnumText(v1::Stage_Name(stage), sizeof("STAGE_") - 1);
}

std::string TimeText(const google::protobuf::Timestamp& time) {
  if (time.seconds() == 0) return "";
  const std::time_t seconds = time.seconds();
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%d %H:%M:%S", &parts);
  return text;
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const size_t length = FirstCharacter(text).length;
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string Printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const auto [length, code] = FirstCharacter(text);
    if (length == 0 || (IsControl(code) && code != '\n')) {
      result.push_back('?');
    } else {
      result.append(text.substr(0, length));
    }
    text.remove_prefix(std::max<size_t>(1, length));
  }
  return result;
}

std::string EventLine(const v1::JobEvent& event) {
  const std::string number = absl::StrCat("#", event.number(), " ");
  switch (event.event_case()) {
    case v1::JobEvent::kStateChange: {
      const auto& change = event.state_change();
      const std::string& why = change.has_error() ? change.error().message() : change.message();
      return absl::StrCat(number, StateText(change.state()), why.empty() ? "" : ": ",
                          absl::StrReplaceAll(Printable(why), {{"\n", " "}}));
    }
    case v1::JobEvent::kSnapshot:
      return absl::StrCat(number, "snapshot of iteration ", event.snapshot().iteration());
    case v1::JobEvent::kProgress: {
      std::vector<std::string> parts = {StageText(event.progress().stage())};
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
  std::string line = StageText(progress.stage());
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
    return Printable(text) + FinishedText(job);
  }
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    return absl::StrCat(Printable(job.name()), " is ", StateText(job.state()), "\n",
                        FinishedText(job));
  }
  const auto& report = job.report();
  std::string text = absl::StrCat(job.name(), " succeeded: ", CountText(report.gaussians()),
                                  " Gaussians after ", report.iterations(), " iterations in ",
                                  DurationText(SecondsOf(report.run_time())));
  if (report.has_psnr_holdout()) {
    absl::StrAppendFormat(&text, ", PSNR %.2f dB on held-out views", report.psnr_holdout());
  }
  absl::StrAppend(&text, "\n  cameras found for ", report.registered(), " of ", report.photos(),
                  " photos (", report.sfm_preparation(), ")\n");
  if (report.dropped_size() > 0) {
    absl::StrAppend(&text, "  without a camera: ", absl::StrJoin(report.dropped(), ", "), "\n");
  }
  for (const std::string& note : report.notes()) absl::StrAppend(&text, "  note: ", note, "\n");
  return Printable(text);
}

}  // namespace litags::client
