#include "server/api/upload_session.h"

#include <chrono>

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "proto/litags/v1/limits.h"
#include "server/api/convert.h"
#include "server/api/status.h"
#include "server/api/unpack.h"

namespace litags {
namespace {

// Of a file on disk, hashed in a part of a second.
constexpr int64_t kCatchUpBytes = int64_t{64} << 20;

// An error of the store that names no field is about this one.
absl::Status WithField(const absl::Status& status, const std::string& field) {
  const auto detail = GetErrorDetail(status);
  if (!detail || !detail->field.empty()) return status;
  return MakeError(status.code(), detail->reason, field,
                   absl::StrCat(field, ": ", std::string(status.message())));
}

// Whether the bytes are those that were announced.
absl::Status CheckDigest(PartialFile* partial, const UploadHeader& file) {
  const absl::StatusOr<std::string> digest = partial->HexDigest();
  if (!digest.ok()) return WithField(digest.status(), file.field);
  if (*digest == file.record.sha256) return absl::OkStatus();
  return InvalidInput("FILE_DIGEST_MISMATCH", file.field,
                      absl::StrCat(file.field,
                                   ": the bytes do not have the announced SHA-256; "
                                   "they were damaged on the way, send them again"));
}

// The same bytes would be refused again.
void DiscardIfInvalid(const absl::Status& status, PartialFile& partial) {
  if (absl::IsInvalidArgument(status)) partial.Discard();
}

absl::Status OutOfOrder(const char* message) {
  return InvalidInput("UPLOAD_ORDER", "part", message);
}

// The job was there when the stream began.
bool IsJobGone(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail && detail->reason == "JOB_NOT_FOUND";
}

}  // namespace

absl::Status UploadSession::Handle(const v1::UploadImagesRequest& request) {
  const bool is_open = !job_id_.empty();
  const absl::Status status = Take(request);
  return is_open && IsJobGone(status) ? UploadTakenOver() : status;
}

absl::Status UploadSession::Take(const v1::UploadImagesRequest& request) {
  if (request.part_case() == v1::UploadImagesRequest::kName) {
    if (!job_id_.empty()) return OutOfOrder("the job is named once, in the first message");
    LITAGS_ASSIGN_OR_RETURN(job_id_, ParseJobName(request.name()));
    return jobs_->uploads().Check(job_id_);
  }
  if (job_id_.empty()) return OutOfOrder("the first message must name the job");
  if (ended_) return OutOfOrder("nothing may follow the end");
  switch (request.part_case()) {
    case v1::UploadImagesRequest::kFile:
      return Begin(request.file());
    case v1::UploadImagesRequest::kChunk:
      return Append(request.chunk());
    case v1::UploadImagesRequest::kEnd:
      return Conclude(request.end());
    default:
      return OutOfOrder("a message must hold a file's header, a chunk of its bytes, or the end");
  }
}

absl::Status UploadSession::Begin(const v1::FileHeader& header) {
  if (file_) {
    return InvalidInput(
        "FILE_TRUNCATED", file_->field,
        absl::StrCat(file_->field, ": ", file_->received, " of ", file_->record.size_bytes,
                     " bytes came before the next file; send the rest"));
  }
  LITAGS_ASSIGN_OR_RETURN(UploadHeader parsed, ParseFileHeader(header, jobs_->uploads().limits()));
  Incoming file{std::move(parsed), header.offset(), nullptr};
  const bool whole = file.received == file.record.size_bytes;  // no bytes will follow
  LITAGS_ASSIGN_OR_RETURN(const bool known, jobs_->uploads().IsStored(job_id_, file.record));
  if (!known && whole) {
    LITAGS_ASSIGN_OR_RETURN(const bool adopted, jobs_->uploads().Adopt(job_id_, file.record));
    if (adopted) {
      ++stored_;
      ++received_;
      return absl::OkStatus();
    }
  }
  if (!known) {
    auto partial = jobs_->uploads().Open(job_id_, file.record, header.offset());
    if (!partial.ok()) return WithField(partial.status(), file.field);
    file.partial = *std::move(partial);
  }
  file_ = std::move(file);
  catching_up_ = file_->partial && header.offset() > 0;
  return whole && !catching_up_ ? Complete() : absl::OkStatus();
}

void UploadSession::KeepJob() {
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> since = now - kept_;
  if (since.count() < jobs_->uploads().check_seconds()) return;
  kept_ = now;
  jobs_->uploads().Check(job_id_).IgnoreError();  // what is wrong shows when the file is whole
}

absl::Status UploadSession::Continue() {
  KeepJob();
  const absl::Status status = archive_     ? BeginUnpacking(*std::exchange(archive_, std::nullopt))
                              : unpacking_ ? UnpackNext()
                                           : CatchUp();
  return IsJobGone(status) ? UploadTakenOver() : status;
}

absl::Status UploadSession::CatchUp() {
  const absl::StatusOr<bool> done = file_->partial->CatchUp(kCatchUpBytes);
  if (!done.ok()) return WithField(done.status(), file_->field);
  catching_up_ = !*done;
  return *done && file_->received == file_->record.size_bytes ? Complete() : absl::OkStatus();
}

absl::Status UploadSession::Append(const std::string& chunk) {
  if (!file_) return OutOfOrder("bytes came before a file's header");
  if (chunk.empty() || chunk.size() > v1::kMaxChunkBytes) {
    return InvalidInput("CHUNK_SIZE_INVALID", file_->field,
                        absl::StrCat(file_->field, ": a chunk of ", chunk.size(),
                                     " bytes; chunks have 1 to ", v1::kMaxChunkBytes));
  }
  KeepJob();
  file_->received += static_cast<int64_t>(chunk.size());
  if (file_->received > file_->record.size_bytes) {
    return InvalidInput("FILE_SIZE_MISMATCH", file_->field,
                        absl::StrCat(file_->field, ": more bytes came than the ",
                                     file_->record.size_bytes, " announced; did the file change?"));
  }
  if (file_->partial) {
    const absl::Status written = file_->partial->Append(chunk);
    if (!written.ok()) return WithField(written, file_->field);
  }
  return file_->received == file_->record.size_bytes ? Complete() : absl::OkStatus();
}

absl::Status UploadSession::Complete() {
  Incoming file = *std::move(file_);
  file_.reset();
  ++received_;
  if (!file.partial) {
    ++unchanged_;
    return absl::OkStatus();
  }
  if (file.record.role == FileRole::kArchive) {
    archive_ = std::move(file);
    return absl::OkStatus();
  }
  const absl::Status status = Store(file);
  if (status.ok() || absl::IsFailedPrecondition(status)) return status;
  // Whatever else is wrong with a file that another stream works on, this one lost it.
  LITAGS_RETURN_IF_ERROR(WithField(file.partial->CheckHeld(), file.field));
  DiscardIfInvalid(status, *file.partial);
  return status;
}

absl::Status UploadSession::Store(Incoming& file) {
  LITAGS_RETURN_IF_ERROR(CheckDigest(file.partial.get(), file));
  // What another job has was decoded before.
  LITAGS_ASSIGN_OR_RETURN(const bool adopted, jobs_->uploads().Adopt(job_id_, file.record));
  if (!adopted) {
    {
      const Timer timer(&reading_seconds_);
      LITAGS_RETURN_IF_ERROR(
          reader_->Check(file.partial->path(), file.field, &file.record, cancel_));
    }
    LITAGS_RETURN_IF_ERROR(WithField(file.partial->SetAside(), file.field));
    LITAGS_RETURN_IF_ERROR(jobs_->uploads().Add(job_id_, file.record, file.partial->path()));
  }
  file.partial->Discard();  // what of it is left
  ++stored_;
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<ArchiveReader>> UploadSession::OpenArchive(const Incoming& file,
                                                                          ArchiveSink* sink) const {
  ArchiveLimits limits;
  limits.max_entry_bytes = MaxEntryBytes(jobs_->uploads().limits());
  limits.max_total_bytes = jobs_->uploads().limits().max_job_bytes;
  return reader_->OpenArchive(file.partial->path(), limits, file.field, sink, cancel_);
}

absl::Status UploadSession::BeginUnpacking(Incoming file) {
  const absl::Status status = [&]() -> absl::Status {
    LITAGS_RETURN_IF_ERROR(CheckDigest(file.partial.get(), file));
    auto survey = std::make_unique<ArchiveSurvey>();
    LITAGS_ASSIGN_OR_RETURN(auto archive, OpenArchive(file, survey.get()));
    unpacking_ = std::make_unique<Unpacking>(
        Unpacking{std::move(file), std::move(survey), nullptr, std::move(archive)});
    return absl::OkStatus();
  }();
  if (!status.ok()) DiscardIfInvalid(status, *file.partial);
  return status;
}

absl::Status UploadSession::BeginStoring() {
  Unpacking& now = *unpacking_;
  now.unpacker = std::make_unique<Unpacker>(jobs_, reader_, job_id_, now.file.field,
                                            now.survey->Layout(), cancel_);
  now.archive = nullptr;  // its process ends
  LITAGS_ASSIGN_OR_RETURN(now.archive, OpenArchive(now.file, now.unpacker.get()));
  now.survey = nullptr;
  return absl::OkStatus();
}

absl::StatusOr<bool> UploadSession::ReadNext() {
  const Timer timer(&reading_seconds_);
  LITAGS_ASSIGN_OR_RETURN(const bool more, unpacking_->archive->ReadNext());
  if (more || !unpacking_->survey) return more;
  LITAGS_RETURN_IF_ERROR(BeginStoring());
  return true;
}

void UploadSession::Count(const Unpacker& unpacker) {
  stored_ += unpacker.stored();
  unchanged_ += unpacker.unchanged();
  skipped_.Add(unpacker.skipped());
}

absl::Status UploadSession::UnpackNext() {
  absl::StatusOr<bool> more = ReadNext();
  if (more.ok() && *more) return absl::OkStatus();
  if (more.ok()) {
    if (const absl::Status done = unpacking_->unpacker->Finish(); !done.ok()) more = done;
  }
  const std::unique_ptr<Unpacking> done = std::move(unpacking_);
  if (done->unpacker) Count(*done->unpacker);
  DiscardIfInvalid(more.status(), *done->file.partial);
  LITAGS_RETURN_IF_ERROR(more.status());
  // Another stream may have written to the archive while it was read.
  LITAGS_RETURN_IF_ERROR(WithField(done->file.partial->CheckHeld(), done->file.field));
  LITAGS_RETURN_IF_ERROR(jobs_->uploads().NoteArchive(job_id_, done->file.record));
  done->file.partial->Discard();
  return absl::OkStatus();
}

absl::Status UploadSession::CheckWhole() const {
  if (!file_) return absl::OkStatus();
  return InvalidInput("FILE_TRUNCATED", file_->field,
                      absl::StrCat(file_->field, ": the upload ended after ", file_->received,
                                   " of ", file_->record.size_bytes, " bytes; send the rest"));
}

absl::Status UploadSession::Conclude(const v1::UploadEnd& end) {
  LITAGS_RETURN_IF_ERROR(CheckWhole());
  ended_ = true;
  if (end.files() == received_) return absl::OkStatus();
  return InvalidInput(
      "UPLOAD_INCOMPLETE", "end.files",
      absl::StrCat(Counted(end.files(), "file"), end.files() == 1 ? " was" : " were", " sent and ",
                   received_, " came; ask QueryUpload and send the others"));
}

absl::Status UploadSession::End(v1::UploadImagesResponse* response) {
  if (job_id_.empty()) return OutOfOrder("the first message must name the job");
  LITAGS_RETURN_IF_ERROR(CheckWhole());
  if (!ended_) {
    return InvalidInput(
        "UPLOAD_INCOMPLETE", "end",
        absl::StrCat("the stream stopped without its end, which says how many "
                     "files it had; ",
                     Counted(received_, "file"), " came; ask QueryUpload and send the others"));
  }
  const absl::StatusOr<JobRecord> job = jobs_->Get(job_id_);
  if (IsJobGone(job.status())) return UploadTakenOver();
  LITAGS_RETURN_IF_ERROR(job.status());
  LITAGS_ASSIGN_OR_RETURN(*response->mutable_job(), JobToProto(*job));
  response->set_files_stored(stored_);
  response->set_files_unchanged(unchanged_);
  response->set_files_received(received_);
  for (const std::string& name : skipped_.names()) response->add_skipped(name);
  response->set_skipped_total(skipped_.total());
  return absl::OkStatus();
}

}  // namespace litags
