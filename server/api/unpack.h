#ifndef LITAGS_SERVER_API_UNPACK_H_
#define LITAGS_SERVER_API_UNPACK_H_

#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/dataset_layout.h"
#include "server/archive/extract.h"
#include "server/jobs/jobs.h"
#include "server/reader/file_reader.h"
#include "server/store/digest.h"

namespace litags {

// What files an archive holds, by their names: nothing of them is stored.
class ArchiveSurvey : public ArchiveSink {
 public:
  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override;
  absl::Status Write(std::string_view bytes) override;
  absl::Status End() override { return absl::OkStatus(); }

  DatasetLayout Layout() const { return DatasetLayout(files_); }

 private:
  std::vector<DatasetFile> files_;
};

// What of archives is not used. All are counted, the first hundred are named.
class SkippedNames {
 public:
  void Add(std::string name) { Insert(names_.size(), std::move(name)); }
  // Before those that Add() got.
  void AddFirst(std::string name) { Insert(first_++, std::move(name)); }
  void Add(const SkippedNames& of_archive);

  const std::vector<std::string>& names() const { return names_; }
  int total() const { return total_; }

 private:
  static constexpr size_t kMostNames = 100;

  void Insert(size_t index, std::string name);

  std::vector<std::string> names_;
  size_t first_ = 0;  // names of AddFirst()
  int total_ = 0;
};

// Stores the files of an uploaded archive in a job, each checked as if it had come by itself;
// photos that cannot be read are left out, and their masks. What a file is for follows from its
// name and folder. One at a time is on disk beside the archive.
class Unpacker : public ArchiveSink {
 public:
  // `layout`: which of the archive's files are used.
  Unpacker(Jobs* jobs, FileReader* reader, std::string job_id, std::string field,
           DatasetLayout layout, CancelToken cancel);
  ~Unpacker() override;

  // INVALID_ARGUMENT (ARCHIVE_NAME_TWICE): two files of one role have one name.
  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override;
  absl::Status Write(std::string_view bytes) override;
  absl::Status End() override;
  // After the last file: takes the masks of photos that were left out from the job, unless they
  // are of another one, too, that it has. CANCELLED.
  absl::Status Finish();

  int stored() const { return stored_; }
  int unchanged() const { return unchanged_; }
  // Photos that cannot be read, with the reason, and their masks; copies and cameras that the
  // layout leaves out; then files that no job has a use for.
  const SkippedNames& skipped() const { return skipped_; }

 private:
  absl::Status NoRoom() const;
  absl::Status Store();  // the file in hand
  // Before what else is not used.
  void NoteLeftOut(const std::string& path, std::string_view why);
  // OK and noted if `status` says that the file in hand, at `path`, is one that is left out.
  absl::Status LeaveOut(const absl::Status& status, const std::string& path);

  Jobs* const jobs_;
  FileReader* const reader_;
  const std::string job_id_;
  const std::string field_;  // the archive's
  const DatasetLayout layout_;
  const CancelToken cancel_;
  const std::string staging_path_;
  FileRecord file_;  // the one in hand
  Sha256 sha_;
  std::ofstream out_;
  // Where each file was, by role and name.
  std::map<std::pair<FileRole, std::string>, std::string> seen_;
  int stored_ = 0, unchanged_ = 0;
  std::vector<std::string> unreadable_;  // names of photos that were left out
  SkippedNames skipped_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UNPACK_H_
