#include "server/store/sql_files.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr char kFileColumns[] = "role, name, size_bytes, sha256, width, height, about";

// Order as kFileColumns.
FileRecord ReadFile(const SqlStatement& row) {
  FileRecord file;
  int c = 0;
  file.role = static_cast<FileRole>(row.Int(c++));
  file.name = row.Text(c++);
  file.size_bytes = row.Int(c++);
  file.sha256 = row.Text(c++);
  file.width = static_cast<int>(row.Int(c++));
  file.height = static_cast<int>(row.Int(c++));
  file.about = row.Text(c++);
  return file;
}

}  // namespace

absl::StatusOr<std::vector<FileRecord>> SelectFiles(SqlSession& sql, std::string_view id) {
  const auto row = sql.Prepare(
      absl::StrCat("SELECT ", kFileColumns, " FROM files WHERE job_id=?1 ORDER BY role, name"));
  row->Bind(id);
  return ReadAll(*row, ReadFile);
}

absl::StatusOr<std::vector<FileRecord>> SelectFilesOf(SqlSession& sql, std::string_view id,
                                                      FileRole role) {
  const auto row = sql.Prepare(absl::StrCat(
      "SELECT ", kFileColumns, " FROM files WHERE job_id=?1 AND role=?2 ORDER BY name"));
  row->Bind(id).Bind(static_cast<int64_t>(role));
  return ReadAll(*row, ReadFile);
}

absl::StatusOr<std::optional<FileRecord>> SelectFile(SqlSession& sql, std::string_view id,
                                                     FileRole role, std::string_view name) {
  const auto row = sql.Prepare(
      absl::StrCat("SELECT ", kFileColumns, " FROM files WHERE job_id=?1 AND role=?2 AND name=?3"));
  row->Bind(id).Bind(static_cast<int64_t>(role)).Bind(name);
  LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
  if (!found) return std::nullopt;
  return ReadFile(*row);
}

absl::StatusOr<FileTally> SelectTally(SqlSession& sql, std::string_view id, int64_t photos,
                                      std::string_view sha256) {
  // Photos, which are the most, are counted already, and have the first role.
  const auto row = sql.Prepare(
      "SELECT (SELECT COUNT(*) FROM files WHERE job_id=?1 AND role>1), "
      "(SELECT COUNT(*) FROM files WHERE sha256=?2 AND job_id=?1)");
  row->Bind(id).Bind(sha256);
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return FileTally{photos + row->Int(0), row->Int(1)};
}

absl::StatusOr<std::optional<JobFile>> SelectSameFile(SqlSession& sql, std::string_view id,
                                                      FileRole role, std::string_view sha256) {
  // In the job itself, then in the owner's others. Two texts: an order would read all copies.
  for (const char* where : {"job_id=?3",
                            "(SELECT owner FROM jobs WHERE id=job_id) = "
                            "(SELECT owner FROM jobs WHERE id=?3)"}) {
    const auto row = sql.Prepare(
        absl::StrCat("SELECT ", kFileColumns,
                     ", job_id FROM files WHERE sha256=?1 AND role=?2 AND ", where, " LIMIT 1"));
    row->Bind(sha256).Bind(static_cast<int64_t>(role)).Bind(id);
    LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
    if (found) return JobFile{row->Text(7), ReadFile(*row)};
  }
  return std::nullopt;
}

absl::Status UpsertFile(SqlSession& sql, std::string_view id, const FileRecord& file) {
  const auto upsert = sql.Prepare(
      "INSERT INTO files (job_id, role, name, size_bytes, sha256, width, height, "
      "about) VALUES (?1,?2,?3,?4,?5,?6,?7,?8) ON CONFLICT (job_id, role, name) DO UPDATE SET "
      "size_bytes=excluded.size_bytes, sha256=excluded.sha256, width=excluded.width, "
      "height=excluded.height, about=excluded.about");
  upsert->Bind(id)
      .Bind(static_cast<int64_t>(file.role))
      .Bind(file.name)
      .Bind(file.size_bytes)
      .Bind(file.sha256)
      .Bind(int64_t{file.width})
      .Bind(int64_t{file.height})
      .Bind(file.about);
  return upsert->Run().status();
}

absl::Status DeleteFile(SqlSession& sql, std::string_view id, FileRole role,
                        std::string_view name) {
  const auto remove = sql.Prepare("DELETE FROM files WHERE job_id=?1 AND role=?2 AND name=?3");
  remove->Bind(id).Bind(static_cast<int64_t>(role)).Bind(name);
  return remove->Run().status();
}

}  // namespace litags
