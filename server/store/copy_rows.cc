#include "server/store/copy_rows.h"

#include <array>
#include <memory>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "server/store/digest.h"
#include "server/store/postgres.h"
#include "server/store/postgres_migrations.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_migrations.h"

namespace litags {
namespace {

constexpr int kJobsPerPage = 500;
// Of no use elsewhere: which workers are there now, and a database's own number of its layout.
constexpr const char* kNotCopied[] = {"workers", "litags_schema"};
constexpr char kInstallation[] = "installation";  // the one table whose rows are of no job

struct Column {
  std::string name;
  bool is_number = false;
  bool operator==(const Column&) const = default;
};
using Columns = std::vector<Column>;            // by name
using Layout = std::map<std::string, Columns>;  // by table

// A database of either kind.
class Database {
 public:
  static absl::StatusOr<std::unique_ptr<Database>> Open(const StorePlaces& places,
                                                        const DataDir& data) {
    auto database = std::make_unique<Database>();
    if (places.UsesPostgres()) {
      LITAGS_ASSIGN_OR_RETURN(database->postgres_, PgConnection::Open(places.jobs));
      LITAGS_RETURN_IF_ERROR(MigratePostgres(database->postgres_.get()));
      // The other side may need a while for its part.
      LITAGS_RETURN_IF_ERROR(
          database->postgres_->Execute("SET idle_in_transaction_session_timeout = 0"));
    } else {
      LITAGS_ASSIGN_OR_RETURN(database->sqlite_, SqliteConnection::Open(places.SqlitePath(data)));
      LITAGS_RETURN_IF_ERROR(MigrateSqlite(database->sqlite_.get()));
    }
    LITAGS_RETURN_IF_ERROR(database->ReadLayout());
    return database;
  }

  SqlSession& sql() {
    return postgres_ ? static_cast<SqlSession&>(*postgres_) : static_cast<SqlSession&>(*sqlite_);
  }
  const Layout& layout() const { return layout_; }

  absl::Status Begin() {
    return postgres_ ? postgres_->Begin() : sqlite_->Execute("BEGIN IMMEDIATE");
  }
  absl::Status Commit() { return postgres_ ? postgres_->Commit() : sqlite_->Execute("COMMIT"); }

 private:
  absl::Status ReadLayout() {
    const auto row = sql().Prepare(
        postgres_ ? "SELECT table_name, column_name, data_type FROM information_schema.columns "
                    "WHERE table_schema=current_schema() ORDER BY table_name, column_name"
                  : "SELECT t.name, c.name, c.type FROM sqlite_master AS t, "
                    "pragma_table_info(t.name) AS c WHERE t.type='table' AND t.name NOT LIKE "
                    "'sqlite_%' ORDER BY t.name, c.name");
    for (;;) {
      LITAGS_ASSIGN_OR_RETURN(const bool more, row->Step());
      if (!more) break;
      const std::string type = row->Text(2);
      const bool is_number = type == "INTEGER" || type == "bigint";
      if (!is_number && type != "TEXT" && type != "text") {
        return MakeError(absl::StatusCode::kInternal, "LAYOUTS_DIFFER", "store",
                         absl::StrCat("column ", row->Text(0), ".", row->Text(1), " is ", type,
                                      ", which CopyRows() does not know"));
      }
      layout_[row->Text(0)].push_back({row->Text(1), is_number});
    }
    for (const char* table : kNotCopied) layout_.erase(table);
    return absl::OkStatus();
  }

  std::unique_ptr<SqliteConnection> sqlite_;
  std::unique_ptr<PgConnection> postgres_;
  Layout layout_;
};

absl::Status CheckLayouts(const Layout& from, const Layout& to) {
  if (from == to) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "LAYOUTS_DIFFER", "store",
                   "the two job stores have other tables or columns, although both are of the "
                   "newest version; something else uses one of the databases");
}

std::string Names(const Columns& columns) {
  return absl::StrJoin(columns, ", ",
                       [](std::string* text, const Column& column) { text->append(column.name); });
}

// The digests of rows added up bit by bit: the same for any order, and no two rows are equal, since
// tables have keys.
class Sum {
 public:
  void Add(const Columns& columns, const SqlStatement& row) {
    Sha256 sha;
    for (size_t i = 0; i < columns.size(); ++i) {
      const int c = static_cast<int>(i);
      const std::string value = columns[i].is_number ? absl::StrCat(row.Int(c)) : row.Text(c);
      sha.Update(absl::StrCat(columns[i].name, " ", value.size(), " ", value, "\n"));
    }
    const std::string digest = absl::HexStringToBytes(sha.HexDigest());
    for (size_t i = 0; i < bits_.size(); ++i) bits_[i] ^= digest[i];
    ++rows_;
  }
  RowSum Result() const { return {rows_, ToHex(std::string_view(bits_.data(), bits_.size()))}; }

 private:
  std::array<char, 32> bits_ = {};
  int64_t rows_ = 0;
};

using EachRow = absl::FunctionRef<absl::Status(const std::string& table, const Columns& columns,
                                               const SqlStatement& row)>;

// Calls `each` for every row: the installation's, then job by job and the job's own row first, so
// that one job's rows are in memory at a time.
absl::Status ForEachRow(Database& database, EachRow each) {
  SqlSession& sql = database.sql();
  const auto visit = [&](const std::string& table, const char* key, std::string_view id) {
    const Columns& columns = database.layout().at(table);
    std::string select = absl::StrCat("SELECT ", Names(columns), " FROM ", table);
    if (key) absl::StrAppend(&select, " WHERE ", key, "=?1");
    const auto row = sql.Prepare(select);
    if (key) row->Bind(id);
    for (;;) {
      const auto more = row->Step();
      if (!more.ok() || !*more) return more.status();
      const absl::Status status = each(table, columns, *row);
      if (!status.ok()) return status;
    }
  };
  LITAGS_RETURN_IF_ERROR(visit(kInstallation, nullptr, ""));
  std::string last;
  for (;;) {
    std::vector<std::string> ids;
    {
      const auto page = sql.Prepare(
          absl::StrCat("SELECT id FROM jobs WHERE id > ?1 ORDER BY id LIMIT ", kJobsPerPage));
      page->Bind(last);
      for (;;) {
        LITAGS_ASSIGN_OR_RETURN(const bool more, page->Step());
        if (!more) break;
        ids.push_back(page->Text(0));
      }
    }
    if (ids.empty()) return absl::OkStatus();
    last = ids.back();
    for (const std::string& id : ids) {
      LITAGS_RETURN_IF_ERROR(visit("jobs", "id", id));
      for (const auto& [table, columns] : database.layout()) {
        if (table == "jobs" || table == kInstallation) continue;
        LITAGS_RETURN_IF_ERROR(visit(table, "job_id", id));
      }
    }
  }
}

absl::StatusOr<RowSums> SumsOf(Database& database) {
  std::map<std::string, Sum> sums;
  for (const auto& [table, columns] : database.layout()) sums[table];
  LITAGS_RETURN_IF_ERROR(ForEachRow(
      database, [&](const std::string& table, const Columns& columns, const SqlStatement& row) {
        sums[table].Add(columns, row);
        return absl::OkStatus();
      }));
  RowSums result;
  for (const auto& [table, sum] : sums) {
    result[table] = sum.Result();
    // Rows of no job would have been passed over.
    const auto count = database.sql().Prepare("SELECT COUNT(*) FROM " + table);
    LITAGS_RETURN_IF_ERROR(count->Step().status());
    if (count->Int(0) != result[table].rows) {
      return MakeError(absl::StatusCode::kDataLoss, "COPY_DIFFERS", "store",
                       absl::StrCat("table ", table, " has ", count->Int(0), " rows, ",
                                    result[table].rows, " of them of a job"));
    }
  }
  return result;
}

absl::Status Insert(Database& to, const std::string& table, const Columns& columns,
                    const SqlStatement& row) {
  std::string places;
  for (size_t i = 1; i <= columns.size(); ++i) absl::StrAppend(&places, i == 1 ? "?" : ",?", i);
  const auto insert = to.sql().Prepare(
      absl::StrCat("INSERT INTO ", table, " (", Names(columns), ") VALUES (", places, ")"));
  for (size_t i = 0; i < columns.size(); ++i) {
    const int c = static_cast<int>(i);
    if (columns[i].is_number) {
      insert->Bind(row.Int(c));
    } else {
      insert->Bind(row.Text(c));
    }
  }
  return insert->Run().status();
}

absl::Status SourceChanged() {
  return MakeError(absl::StatusCode::kDataLoss, "COPY_DIFFERS", "store",
                   "the source was changed meanwhile; stop who uses it, empty the target and try "
                   "again");
}

}  // namespace

absl::StatusOr<RowSums> ReadRowSums(const StorePlaces& places, const DataDir& data) {
  LITAGS_ASSIGN_OR_RETURN(const auto database, Database::Open(places, data));
  return SumsOf(*database);
}

absl::StatusOr<RowSums> CopyRows(const StorePlaces& from, const StorePlaces& to,
                                 const DataDir& data, const RowSums& wanted) {
  LITAGS_ASSIGN_OR_RETURN(const auto source, Database::Open(from, data));
  LITAGS_ASSIGN_OR_RETURN(const auto target, Database::Open(to, data));
  LITAGS_RETURN_IF_ERROR(CheckLayouts(source->layout(), target->layout()));
  LITAGS_ASSIGN_OR_RETURN(const RowSums before, SumsOf(*source));
  if (before != wanted) return SourceChanged();
  LITAGS_ASSIGN_OR_RETURN(RowSums found, SumsOf(*target));
  if (found.at("jobs").rows > 0 && found != wanted) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "TARGET_NOT_EMPTY", "to-store",
                     absl::StrCat("the target has ", found.at("jobs").rows,
                                  " jobs, which are not those of the source; name an empty one"));
  }
  if (found != wanted) {
    LITAGS_RETURN_IF_ERROR(target->Begin());
    // A server may have been started there, which made an id.
    LITAGS_RETURN_IF_ERROR(target->sql().Execute(absl::StrCat("DELETE FROM ", kInstallation)));
    LITAGS_RETURN_IF_ERROR(ForEachRow(
        *source, [&](const std::string& table, const Columns& columns, const SqlStatement& row) {
          return Insert(*target, table, columns, row);
        }));
    LITAGS_RETURN_IF_ERROR(target->Commit());
    LITAGS_ASSIGN_OR_RETURN(found, SumsOf(*target));
  }
  LITAGS_ASSIGN_OR_RETURN(const RowSums after, SumsOf(*source));
  if (after != wanted) return SourceChanged();
  if (found != wanted) {
    return MakeError(absl::StatusCode::kDataLoss, "COPY_DIFFERS", "to-store",
                     "what was read back differs from what was written");
  }
  return found;
}

}  // namespace litags
