#include "server/api/unpack.h"

#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/utf8.h"
#include "server/api/upload_files.h"

namespace litags {
namespace {

std::string PathIn(const ArchiveEntry& entry) {
  std::vector<std::string> parts = entry.folders;
  parts.push_back(entry.name);
  return ShownName(absl::StrJoin(parts, "/"));
}

// Whether the mask is of one of these photos, or of several.
bool MayBelong(const std::string& mask, const MaskMatcher& photos) {
  const absl::StatusOr<std::string> photo = photos.PhotoOf(mask);
  return photo.ok() || GetErrorDetail(photo.status())->reason == "MASK_AMBIGUOUS";
}

DatasetFile FileOf(const ArchiveEntry& entry, const std::optional<FileRole>& role) {
  DatasetFile file{absl::StrJoin(entry.folders, "/"), entry.name};
  if (role == FileRole::kPhoto) file.kind = DatasetFile::Kind::kPhoto;
  if (role == FileRole::kMask) file.kind = DatasetFile::Kind::kMask;
  if (role == FileRole::kDepth) file.kind = DatasetFile::Kind::kDepth;
  if (role == FileRole::kCameras) file.kind = DatasetFile::Kind::kCameras;
  if (role == FileRole::kColmap) file.kind = DatasetFile::Kind::kModel;
  return file;
}

}  // namespace

absl::StatusOr<bool> ArchiveSurvey::Begin(const ArchiveEntry& entry) {
  files_.push_back(FileOf(entry, RoleInArchive(entry)));
  // The bytes of its images tell the larger model.
  return files_.back().kind == DatasetFile::Kind::kModel && entry.name.starts_with("images.");
}

absl::Status ArchiveSurvey::Write(std::string_view bytes) {
  files_.back().bytes += static_cast<int64_t>(bytes.size());
  return absl::OkStatus();
}

void SkippedNames::Insert(size_t index, std::string name) {
  ++total_;
  if (index >= kMostNames) return;
  names_.insert(names_.begin() + static_cast<ptrdiff_t>(index), std::move(name));
  if (names_.size() > kMostNames) names_.pop_back();
}

void SkippedNames::Add(const SkippedNames& of_archive) {
  for (const std::string& name : of_archive.names_) Add(name);
  total_ += of_archive.total_ - static_cast<int>(of_archive.names_.size());
}

Unpacker::Unpacker(Jobs* jobs, FileReader* reader, std::string job_id, std::string field,
                   DatasetLayout layout, CancelToken cancel)
    : jobs_(jobs),
      reader_(reader),
      job_id_(std::move(job_id)),
      field_(std::move(field)),
      layout_(std::move(layout)),
      cancel_(std::move(cancel)),
      staging_path_(absl::StrCat(jobs->data().tmp(), "/unpack-", RandomHex(8))) {
  for (const std::string& note : layout_.Notes()) skipped_.Add(ShownName(note));
}

Unpacker::~Unpacker() { unlink(staging_path_.c_str()); }

absl::StatusOr<bool> Unpacker::Begin(const ArchiveEntry& entry) {
  const std::optional<FileRole> role = RoleInArchive(entry);
  const DatasetFile file = FileOf(entry, role);
  if (!layout_.Uses(file)) return false;  // a note tells
  if (!role) {
    skipped_.Add(PathIn(entry));
    return false;
  }
  const std::string name = layout_.NameOf(file);
  file_ = {name, *role, 0, "", 0, 0};
  const absl::Status named = CheckName(name, *role, FieldOf(*role, name));
  if (!named.ok()) {
    LITAGS_RETURN_IF_ERROR(LeaveOut(named, PathIn(entry)));
    return false;
  }
  const auto [first, added] = seen_.emplace(std::pair(*role, name), PathIn(entry));
  if (!added) {
    return InvalidInput("ARCHIVE_NAME_TWICE", field_,
                        absl::StrCat(field_, ": ", first->second, " and ", PathIn(entry),
                                     " have one name; pack one folder of photos, or those of a "
                                     "rig as images/cam0, images/cam1"));
  }
  sha_ = Sha256();
  out_ = std::ofstream(staging_path_, std::ios::binary | std::ios::trunc);
  return true;
}

absl::Status Unpacker::NoRoom() const {
  return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", field_,
                   absl::StrCat(field_,
                                ": the server cannot unpack it; free some space in its "
                                "data folder"));
}

absl::Status Unpacker::Write(std::string_view bytes) {
  sha_.Update(bytes);
  file_.size_bytes += static_cast<int64_t>(bytes.size());
  LITAGS_RETURN_IF_ERROR(CheckSize(file_.role, file_.size_bytes, jobs_->uploads().limits(),
                                   FieldOf(file_.role, file_.name)));
  if (out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return absl::OkStatus();
  return NoRoom();
}

void Unpacker::NoteLeftOut(const std::string& path, std::string_view why) {
  skipped_.AddFirst(absl::StrCat(path, " (", Utf8Prefix(why, 300), ")"));
}

absl::Status Unpacker::LeaveOut(const absl::Status& status, const std::string& path) {
  const auto detail = GetErrorDetail(status);
  if (!detail) return status;
  const bool photo = file_.role == FileRole::kPhoto;
  // The mask of a photo whose name is refused has such a name, too.
  const bool misnamed =
      detail->reason == "BAD_FILE_NAME" && (photo || file_.role == FileRole::kMask);
  const bool unreadable =
      photo && (detail->reason == "FILE_EMPTY" || detail->reason.starts_with("IMAGE_"));
  if (!misnamed && !unreadable) return status;
  if (unreadable) unreadable_.push_back(file_.name);
  NoteLeftOut(path, std::string(absl::StripPrefix(status.message(), detail->field + ": ")));
  return absl::OkStatus();
}

absl::Status Unpacker::Finish() {
  if (unreadable_.empty()) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, jobs_->Files(job_id_));
  std::vector<std::string> photos;
  for (const FileRecord& file : files) {
    if (file.role == FileRole::kPhoto) photos.push_back(file.name);
  }
  const MaskMatcher left_out(unreadable_), stored(photos);
  for (const auto& [key, path] : seen_) {
    const auto& [role, name] = key;
    if (role != FileRole::kMask || !MayBelong(name, left_out) || MayBelong(name, stored)) continue;
    LITAGS_RETURN_IF_ERROR(cancel_.Check());
    LITAGS_RETURN_IF_ERROR(jobs_->uploads().Remove(job_id_, role, name).status());
    NoteLeftOut(path, "its photo is left out");
  }
  return absl::OkStatus();
}

absl::Status Unpacker::End() {
  return LeaveOut(Store(), seen_.at(std::pair(file_.role, file_.name)));
}

absl::Status Unpacker::Store() {
  const std::string field = FieldOf(file_.role, file_.name);
  if (file_.size_bytes == 0) {
    // COLMAP's recipe for known poses makes one with nothing in it.
    if (file_.role == FileRole::kColmap && file_.name == "points3D.txt") return absl::OkStatus();
    return InvalidInput("FILE_EMPTY", field,
                        absl::StrCat(field, ": the file in ", field_,
                                     " has no bytes; leave it out or copy it from the camera "
                                     "again"));
  }
  out_.close();
  if (!out_) return NoRoom();
  file_.sha256 = sha_.HexDigest();
  LITAGS_ASSIGN_OR_RETURN(const bool known, jobs_->uploads().IsStored(job_id_, file_));
  if (known) {
    ++unchanged_;
    return absl::OkStatus();
  }
  LITAGS_ASSIGN_OR_RETURN(const bool adopted, jobs_->uploads().Adopt(job_id_, file_));
  if (!adopted) {
    LITAGS_RETURN_IF_ERROR(reader_->Check(staging_path_, field, &file_, cancel_));
    LITAGS_RETURN_IF_ERROR(jobs_->uploads().Add(job_id_, file_, staging_path_));
  }
  ++stored_;
  return absl::OkStatus();
}

}  // namespace litags
