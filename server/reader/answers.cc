#include "server/reader/answers.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/camera.h"
#include "engine/core/error.h"
#include "server/reader/channel.h"
#include "server/reader/file_findings.h"

namespace litags {

absl::Status CheckFailed(const std::string& field, const std::string& how) {
  return InvalidInput("FILE_CHECK_FAILED", field,
                      absl::StrCat(field, ": the process that read it ", how,
                                   "; leave it out, or save it anew with another program"));
}

absl::Status ParseVerdict(std::string_view packet, const std::string& field, FileRecord* file) {
  const std::vector<std::string> texts = TextsOf(packet);
  int code = 0, width = 0, height = 0;
  if (packet.substr(0, 1) != std::string_view(&packet::kVerdict, 1) || texts.size() != 7 ||
      !absl::SimpleAtoi(texts[0], &code) || !absl::SimpleAtoi(texts[4], &width) ||
      !absl::SimpleAtoi(texts[5], &height) || width < 0 || width > kMaxImageSide || height < 0 ||
      height > kMaxImageSide ||
      (!texts[6].empty() && !ParsePhotoFindings(texts[6]) && !ParseVideoFindings(texts[6]) &&
       !ParseCameraFindings(texts[6]))) {
    return CheckFailed(field, "gave no answer");
  }
  if (code == 0) {
    file->width = width;
    file->height = height;
    file->about = texts[6];
    return absl::OkStatus();
  }
  const bool full = code == static_cast<int>(absl::StatusCode::kResourceExhausted);
  return MakeError(full ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInvalidArgument,
                   texts[1].empty() ? "FILE_CHECK_FAILED" : texts[1], texts[2], texts[3]);
}

absl::StatusOr<char> EntryReceiver::Take(std::string_view packet) {
  const char kind = packet.empty() ? '\0' : packet.front();
  const auto bytes = static_cast<int64_t>(packet.size()) - 1;
  if (kind == packet::kEntry && !open_ && ++entries_ <= limits_.max_entries) {
    ArchiveEntry entry;
    entry.folders = TextsOf(packet);
    entry.name = std::move(entry.folders.back());
    entry.folders.pop_back();
    entry_bytes_ = 0;
    LITAGS_ASSIGN_OR_RETURN(open_, sink_->Begin(entry));
    return open_ ? packet::kWanted : packet::kNotWanted;
  }
  if (kind == packet::kBytes && open_ && (entry_bytes_ += bytes) <= limits_.max_entry_bytes &&
      (total_bytes_ += bytes) <= limits_.max_total_bytes) {
    LITAGS_RETURN_IF_ERROR(sink_->Write(packet.substr(1)));
    return '\0';
  }
  if (kind == packet::kEndOfEntry && open_) {
    open_ = false;
    LITAGS_RETURN_IF_ERROR(sink_->End());
    return '\0';
  }
  return CheckFailed(field_, "gave no answer");
}

}  // namespace litags
