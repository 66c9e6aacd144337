#include "server/store/upload_chunks.h"

#include <charconv>
#include <limits>
#include <map>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr char kRoot[] = "uploads";

std::string FolderOf(std::string_view job_id) {
  return absl::StrCat(kRoot, "/", std::string(job_id));
}
std::string FolderOf(std::string_view job_id, std::string_view key) {
  return absl::StrCat(FolderOf(job_id), "/", std::string(key));
}

}  // namespace

absl::StatusOr<std::vector<UploadChunks::Piece>> UploadChunks::Chain(std::string_view job_id,
                                                                     std::string_view key) const {
  std::vector<Piece> chain;
  if (!blobs_) return chain;
  LITAGS_ASSIGN_OR_RETURN(const auto names, blobs_->List(FolderOf(job_id, key)));
  std::map<int64_t, int64_t> ends;  // by their beginnings
  for (const std::string& name : names) {
    Piece piece{-1, -1};
    const char* const last = name.data() + name.size();
    const auto first = std::from_chars(name.data(), last, piece.first);
    if (first.ptr != last) std::from_chars(first.ptr + 1, last, piece.end);
    if (piece.first < piece.end) ends[piece.first] = std::max(ends[piece.first], piece.end);
  }
  for (auto it = ends.find(0); it != ends.end(); it = ends.find(it->second)) {
    chain.push_back({it->first, it->second});
  }
  return chain;
}

absl::StatusOr<int64_t> UploadChunks::Size(std::string_view job_id, std::string_view key) const {
  LITAGS_ASSIGN_OR_RETURN(const auto chain, Chain(job_id, key));
  return chain.empty() ? 0 : chain.back().end;
}

absl::Status UploadChunks::Put(std::string_view job_id, std::string_view key, int64_t first,
                               std::string_view bytes) const {
  const auto end = first + static_cast<int64_t>(bytes.size());
  return blobs_->Put(absl::StrCat(FolderOf(job_id, key), "/", first, "-", end), bytes);
}

absl::Status UploadChunks::Read(std::string_view job_id, std::string_view key, int64_t from,
                                absl::FunctionRef<absl::Status(std::string_view)> take) const {
  LITAGS_ASSIGN_OR_RETURN(const auto chain, Chain(job_id, key));
  for (const Piece& piece : chain) {
    if (piece.end <= from) continue;
    const auto bytes =
        blobs_->Get(absl::StrCat(FolderOf(job_id, key), "/", piece.first, "-", piece.end));
    if (absl::IsNotFound(bytes.status())) break;  // the upload has ended elsewhere
    LITAGS_RETURN_IF_ERROR(bytes.status());
    const auto skipped = static_cast<size_t>(std::max<int64_t>(0, from - piece.first));
    LITAGS_RETURN_IF_ERROR(take(std::string_view(*bytes).substr(skipped)));
  }
  return absl::OkStatus();
}

absl::Status UploadChunks::Remove(std::string_view job_id, std::string_view key) const {
  return blobs_ ? blobs_->RemoveFolder(FolderOf(job_id, key)) : absl::OkStatus();
}

absl::Status UploadChunks::RemoveJob(std::string_view job_id) const {
  return blobs_ ? blobs_->RemoveFolder(FolderOf(job_id)) : absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> UploadChunks::Jobs() const {
  if (!blobs_) return std::vector<std::string>();
  return blobs_->List(kRoot);
}

absl::StatusOr<double> UploadChunks::QuietSeconds(std::string_view job_id) const {
  if (!blobs_) return std::numeric_limits<double>::infinity();
  return blobs_->QuietSeconds(FolderOf(job_id));
}

}  // namespace litags
