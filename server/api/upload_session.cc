#include "server/api/upload_session.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "proto/litags/v1/limits.h"
#include "server/api/convert.h"
#include "server/api/status.h"
#include "server/api/unpack.h"

namespace litags {
namespace {

// An error of the store that names no field is about this one.
absl::Status WithField(const absl::Status& status, const std::string& field) {
  const auto detail = GetErrorDetail(status);
  if (!detail || !detail->field.empty()) return status;
  return MakeError(status.code(), detail->reason, field,
                   absl::StrCat(field, ": ", std::string(status.message())));
}

absl::Status OutOfOrder(const char* message) {
  return InvalidInput("UPLOAD_ORDER", "part", message);
}

}  // namespace

absl::Status UploadSession::Handle(const v1::UploadImagesRequest& request) {
  if (request.part_case() == v1::UploadImagesRequest::kName) {
    if (!job_id_.empty()) return OutOfOrder("the job is named once, in the first message");
    LITAGS_ASSIGN_OR_RETURN(job_id_, ParseJobName(request.name()));
    return jobs_->uploads().Check(job_id_);
  }
  if (job_id_.empty()) return OutOfOrder("the first message must name the job");
  switch (request.part_case()) {
    case v1::UploadImagesRequest::kFile:
      return Begin(request.file());
    case v1::UploadImagesRequest::kChunk:
      return Append(request.chunk());
    default:
      return OutOfOrder("a message must hold a file's header or a chunk of its bytes");
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
      return absl::OkStatus();
    }
  }
  if (!known) {
    auto partial = jobs_->uploads().Open(job_id_, file.record, header.offset());
    if (!partial.ok()) return WithField(partial.status(), file.field);
    file.partial = *std::move(partial);
  }
  file_ = std::move(file);
  return whole ? Complete() : absl::OkStatus();
}

absl::Status UploadSession::Append(const std::string& chunk) {
  if (!file_) return OutOfOrder("bytes came before a file's header");
  if (chunk.empty() || chunk.size() > v1::kMaxChunkBytes) {
    return InvalidInput("CHUNK_SIZE_INVALID", file_->field,
                        absl::StrCat(file_->field, ": a chunk of ", chunk.size(),
                                     " bytes; chunks have 1 to ", v1::kMaxChunkBytes));
  }
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
  if (!file.partial) {
    ++unchanged_;
    return absl::OkStatus();
  }
  const absl::Status status = Store(file);
  if (absl::IsInvalidArgument(status)) {
    file.partial->Discard();  // the same bytes would be refused again
  }
  return status;
}

absl::Status UploadSession::Store(Incoming& file) {
  if (file.partial->HexDigest() != file.record.sha256) {
    return InvalidInput("FILE_DIGEST_MISMATCH", file.field,
                        absl::StrCat(file.field,
                                     ": the bytes do not have the announced SHA-256; "
                                     "they were damaged on the way, send them again"));
  }
  if (file.record.role == FileRole::kArchive) return Unpack(file);
  // A model's three files make sense together only: the engine checks them when the job runs.
  if (file.record.role != FileRole::kColmap) {
    LITAGS_RETURN_IF_ERROR(reader_->Check(file.partial->path(), file.field, &file.record, cancel_));
  }
  LITAGS_RETURN_IF_ERROR(jobs_->uploads().Add(job_id_, file.record, file.partial->path()));
  file.partial->Discard();  // what of it is left
  ++stored_;
  return absl::OkStatus();
}

absl::Status UploadSession::Unpack(Incoming& file) {
  ArchiveLimits limits;
  limits.max_entry_bytes = jobs_->uploads().limits().max_file_bytes;
  limits.max_total_bytes = jobs_->uploads().limits().max_job_bytes;
  Unpacker unpacker(jobs_, reader_, job_id_, file.field, cancel_);
  const absl::Status status =
      reader_->Extract(file.partial->path(), limits, file.field, &unpacker, cancel_);
  stored_ += unpacker.stored();
  unchanged_ += unpacker.unchanged();
  skipped_.insert(skipped_.end(), unpacker.skipped().begin(), unpacker.skipped().end());
  LITAGS_RETURN_IF_ERROR(status);
  LITAGS_RETURN_IF_ERROR(jobs_->uploads().NoteArchive(job_id_, file.record));
  file.partial->Discard();
  return absl::OkStatus();
}

absl::Status UploadSession::End(v1::UploadImagesResponse* response) {
  if (job_id_.empty()) return OutOfOrder("the first message must name the job");
  if (file_) {
    return InvalidInput("FILE_TRUNCATED", file_->field,
                        absl::StrCat(file_->field, ": the upload ended after ", file_->received,
                                     " of ", file_->record.size_bytes, " bytes; send the rest"));
  }
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, jobs_->Get(job_id_));
  LITAGS_ASSIGN_OR_RETURN(*response->mutable_job(), JobToProto(job));
  response->set_files_stored(stored_);
  response->set_files_unchanged(unchanged_);
  for (const std::string& name : skipped_) response->add_skipped(name);
  return absl::OkStatus();
}

}  // namespace litags
