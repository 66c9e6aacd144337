#include "server/api/upload_session.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/transforms_io.h"
#include "server/api/convert.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kMaxChunkBytes = size_t{1} << 20;

struct RoleRules {
  const char* field;                    // "images"
  std::vector<const char*> extensions;  // of names, lower case
};

RoleRules RulesOf(FileRole role) {
  switch (role) {
    case FileRole::kCameras:
      return {"cameras", {".json"}};
    case FileRole::kDepth:
      return {"depths", {".png", ".pfm", ".npy"}};
    case FileRole::kPhoto:
      break;
  }
  return {"images", {".jpg", ".jpeg", ".png"}};
}

absl::Status CheckName(const std::string& name, FileRole role, const std::string& field) {
  LITAGS_RETURN_IF_ERROR(ValidateFileName(name, field));
  std::string extension = std::filesystem::path(name).extension();
  if (role == FileRole::kPhoto) {  // the engine finds depth maps by their lower-case names
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return std::tolower(c); });
  }
  const auto allowed = RulesOf(role).extensions;
  if (name.front() != '.' &&
      std::any_of(allowed.begin(), allowed.end(), [&](const char* e) { return extension == e; })) {
    return absl::OkStatus();
  }
  std::string list;
  for (const char* e : allowed) absl::StrAppend(&list, list.empty() ? "" : ", ", e);
  return InvalidInput("BAD_FILE_NAME", field,
                      absl::StrCat(field, ": the name must end in one of ", list,
                                   " and not begin with a dot; rename the file"));
}

// Reads the file as what it says it is; sets a photo's size.
absl::Status CheckContent(const std::string& path, const std::string& field, FileRecord* file) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, file->size_bytes));
  switch (file->role) {
    case FileRole::kPhoto: {
      LITAGS_ASSIGN_OR_RETURN(const ImageU8 image, DecodeImage(bytes, field));
      file->width = image.width;
      file->height = image.height;
      return absl::OkStatus();
    }
    case FileRole::kCameras:
      return ParseTransforms(bytes, field).status();
    case FileRole::kDepth:
      return DecodeDepthMap(bytes, field).status();
  }
  return absl::OkStatus();
}

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

absl::StatusOr<UploadHeader> ParseFileHeader(const v1::FileHeader& header,
                                             const UploadLimits& limits) {
  if (!v1::FileRole_IsValid(header.role())) {
    return InvalidInput("FILE_ROLE_UNKNOWN", "file.role",
                        absl::StrCat("the server does not know file role ", header.role()));
  }
  UploadHeader file;
  file.record.name = header.name();
  file.record.size_bytes = header.size_bytes();
  file.record.sha256 = ToHex(header.sha256());
  file.record.role = header.role() == v1::FILE_ROLE_UNSPECIFIED
                         ? FileRole::kPhoto
                         : static_cast<FileRole>(header.role());
  file.field = absl::StrCat(RulesOf(file.record.role).field, "[", header.name(), "]");
  LITAGS_RETURN_IF_ERROR(CheckName(header.name(), file.record.role, file.field));
  if (header.size_bytes() <= 0) {
    return InvalidInput("FILE_EMPTY", file.field,
                        absl::StrCat(file.field,
                                     ": the file has no bytes; leave it out or copy it "
                                     "from the camera again"));
  }
  const int64_t limit =
      file.record.role == FileRole::kCameras ? limits.max_cameras_bytes : limits.max_file_bytes;
  if (header.size_bytes() > limit) {
    return MakeError(absl::StatusCode::kResourceExhausted, "FILE_TOO_LARGE", file.field,
                     absl::StrCat(file.field, ": ", header.size_bytes(), " bytes exceed ", limit,
                                  "; make the file smaller"));
  }
  if (header.sha256().size() != 32) {
    return InvalidInput("FILE_DIGEST_MISSING", file.field,
                        absl::StrCat(file.field, ": sha256 has ", header.sha256().size(),
                                     " bytes; it must have 32"));
  }
  if (header.offset() < 0) {
    return InvalidInput("OFFSET_NEGATIVE", file.field,
                        absl::StrCat(file.field, ": offset is ", header.offset(),
                                     "; it counts bytes from the start of the file"));
  }
  return file;
}

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
  if (chunk.empty() || chunk.size() > kMaxChunkBytes) {
    return InvalidInput("CHUNK_SIZE_INVALID", file_->field,
                        absl::StrCat(file_->field, ": a chunk of ", chunk.size(),
                                     " bytes; chunks have 1 to ", kMaxChunkBytes));
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
  if (status.ok()) {
    ++stored_;
  } else if (absl::IsInvalidArgument(status)) {
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
  LITAGS_RETURN_IF_ERROR(CheckContent(file.partial->path(), file.field, &file.record));
  return jobs_->uploads().Add(job_id_, file.record, file.partial->path());
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
  return absl::OkStatus();
}

}  // namespace litags
