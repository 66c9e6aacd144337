#include "server/store/open_stores.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "server/store/file_error.h"
#include "server/store/postgres.h"
#include "server/store/postgres_migrations.h"
#include "server/store/sqlite.h"

namespace litags {
namespace {

constexpr std::string_view kSqlite = "sqlite://", kFile = "file://", kS3 = "s3://";
constexpr char kDefaultRegion[] = "us-east-1";
constexpr std::string_view kS3Variables[] = {
    "AWS_REGION=",        "AWS_ACCESS_KEY_ID=", "AWS_SECRET_ACCESS_KEY=",
    "AWS_SESSION_TOKEN=", "SSL_CERT_",          "http_proxy=",
    "https_proxy=",       "HTTPS_PROXY=",       "all_proxy=",
    "ALL_PROXY=",         "no_proxy=",          "NO_PROXY="};

bool IsPostgres(std::string_view url) {
  return url.starts_with("postgresql://") || url.starts_with("postgres://");
}

std::string Variable(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

// What follows the scheme, if it is an absolute path.
absl::StatusOr<std::string> PathOf(const std::string& url, std::string_view scheme,
                                   const char* field) {
  std::string path = url.substr(scheme.size());
  if (path.size() > 1 && path[0] == '/') return path;
  return InvalidInput("STORE_URL_INVALID", field,
                      absl::StrCat(url, " names no absolute path; write ", std::string(scheme),
                                   "/path, with three slashes"));
}

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};
using PgOptions = std::unique_ptr<PQconninfoOption, FreeOptions>;

// INVALID_ARGUMENT without the URL, which holds secrets.
absl::StatusOr<PgOptions> OptionsIn(const std::string& url) {
  char* error = nullptr;
  PgOptions options(PQconninfoParse(url.c_str(), &error));
  PQfreemem(error);
  if (options) return options;
  return InvalidInput("STORE_URL_INVALID", "store",
                      "the PostgreSQL URL cannot be read; write "
                      "postgresql://user@host:5432/database");
}

std::string ValueOf(const PQconninfoOption* option, std::string_view keyword) {
  for (; option && option->keyword; ++option) {
    if (option->keyword == keyword) return option->val ? option->val : "";
  }
  return "";
}

// Whether a list of libpq's hosts names anything but folders of Unix sockets.
bool NamesAMachine(const std::string& hosts) {
  const std::vector<std::string> names = absl::StrSplit(hosts, ',');
  return std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return !name.empty() && name[0] != '/' && name[0] != '@';
  });
}

absl::StatusOr<S3Options> S3OptionsOf(const StorePlaces& places) {
  S3Options options;
  const std::string rest = places.blobs.substr(kS3.size());
  const size_t slash = rest.find('/');
  options.bucket = rest.substr(0, slash);
  if (slash != std::string::npos) options.prefix = rest.substr(slash + 1);
  if (!options.prefix.empty() && options.prefix.back() != '/') options.prefix += '/';
  constexpr char kPlain[] = "abcdefghijklmnopqrstuvwxyz0123456789.-_/";
  if (options.bucket.empty() || rest.find_first_not_of(kPlain) != std::string::npos) {
    return InvalidInput("STORE_URL_INVALID", "blobs",
                        absl::StrCat(places.blobs,
                                     " is not s3://bucket or s3://bucket/prefix, of "
                                     "lower-case letters, digits, '.', '-', '_'"));
  }
  const std::string region = Variable("AWS_REGION");
  options.region = region.empty() ? kDefaultRegion : region;
  options.endpoint = places.s3_endpoint.empty()
                         ? absl::StrCat("https://s3.", options.region, ".amazonaws.com")
                         : places.s3_endpoint;
  while (options.endpoint.ends_with('/')) options.endpoint.pop_back();
  options.access_key = Variable("AWS_ACCESS_KEY_ID");
  options.secret_key = Variable("AWS_SECRET_ACCESS_KEY");
  options.session_token = Variable("AWS_SESSION_TOKEN");
  return options;
}

// Without the slash that may end it.
std::string PlaceOfBlobs(const StorePlaces& places, const DataDir& data) {
  std::string place = places.blobs.empty() ? data.blobs() : places.blobs;
  while (place.ends_with('/')) place.pop_back();
  return place;
}

// What a job store says, without changing it; as here if it is not there yet, or is of a version
// that had no ids.
struct KnownInstallation {
  std::string id;  // JobStore::InstallationId(); empty: not made yet
  bool has_files = false;
};
absl::StatusOr<KnownInstallation> ReadInstallation(const StorePlaces& places, const DataDir& data) {
  KnownInstallation known;
  std::unique_ptr<SqlSession> sql;
  std::string has_table;
  if (places.UsesPostgres()) {
    LITAGS_ASSIGN_OR_RETURN(sql, PgConnection::Open(places.jobs));
    has_table = "SELECT 1 WHERE to_regclass('installation') IS NOT NULL";
  } else {
    const std::string path = places.SqlitePath(data);
    if (std::error_code ignored; !std::filesystem::exists(path, ignored)) return known;
    LITAGS_ASSIGN_OR_RETURN(sql, SqliteConnection::Open(path));
    has_table = "SELECT 1 FROM sqlite_master WHERE name = 'installation'";
  }
  LITAGS_ASSIGN_OR_RETURN(const bool is_there, sql->Prepare(has_table)->Step());
  if (!is_there) return known;
  LITAGS_ASSIGN_OR_RETURN(known.has_files, sql->Prepare("SELECT 1 FROM files LIMIT 1")->Step());
  const auto row = sql->Prepare("SELECT id FROM installation");
  LITAGS_ASSIGN_OR_RETURN(const bool made, row->Step());
  if (made) known.id = row->Text(0);
  return known;
}

// The same for all URLs of one database, whatever host names they have.
absl::StatusOr<std::string> NameOfDatabase(const std::string& url) {
  LITAGS_ASSIGN_OR_RETURN(const auto sql, PgConnection::Open(url));
  const auto row = sql->Prepare(
      "SELECT concat_ws(' ', extract(epoch FROM pg_postmaster_start_time()), current_database(), "
      "current_schema())");
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return row->Text(0);
}

}  // namespace

absl::Status StorePlaces::Validate() const {
  if (jobs.starts_with(kSqlite)) {
    LITAGS_RETURN_IF_ERROR(PathOf(jobs, kSqlite, "store").status());
  } else if (IsPostgres(jobs)) {
    LITAGS_RETURN_IF_ERROR(OptionsIn(jobs).status());
  } else if (!jobs.empty()) {
    return InvalidInput("STORE_URL_INVALID", "store",
                        "the job store is neither sqlite:///path nor postgresql://...");
  }
  if (!s3_endpoint.empty() && !BlobsAreFar()) {
    return InvalidInput("SETTING_UNUSED", "s3-endpoint",
                        absl::StrCat("the S3 server ", s3_endpoint,
                                     " is given, and the blobs are not in S3; give --blobs "
                                     "s3://bucket/prefix, too, or leave it out"));
  }
  if (blobs.starts_with(kFile)) return PathOf(blobs, kFile, "blobs").status();
  if (blobs.starts_with(kS3)) return S3OptionsOf(*this).status();
  if (blobs.empty()) return absl::OkStatus();
  return InvalidInput("STORE_URL_INVALID", "blobs",
                      absl::StrCat(blobs, " is neither file:///path nor s3://bucket/prefix"));
}

bool StorePlaces::BlobsAreFar() const { return blobs.starts_with(kS3); }

bool StorePlaces::UsesPostgres() const { return IsPostgres(jobs); }

std::string StorePlaces::SqlitePath(const DataDir& data) const {
  return jobs.empty() ? data.database() : jobs.substr(kSqlite.size());
}

std::vector<StorePlaces::Folder> StorePlaces::LocalFolders(const DataDir& data) const {
  std::vector<Folder> folders = {{data.root, "--data"}};
  if (jobs.starts_with(kSqlite)) {
    folders.push_back({std::filesystem::path(SqlitePath(data)).parent_path(), "--store"});
  }
  if (blobs.starts_with(kFile)) folders.push_back({blobs.substr(kFile.size()), "--blobs"});
  return folders;
}

bool StorePlaces::NeedNetwork() const {
  if (BlobsAreFar()) return true;
  if (!IsPostgres(jobs)) return false;
  const auto given = OptionsIn(jobs);
  if (!given.ok()) return true;
  const PgOptions defaults(PQconndefaults());  // of the environment and its service
  const auto value = [&](std::string_view keyword) {
    const std::string in_url = ValueOf(given->get(), keyword);
    return in_url.empty() ? ValueOf(defaults.get(), keyword) : in_url;
  };
  return NamesAMachine(value("host")) || !value("hostaddr").empty() || !value("service").empty();
}

std::vector<std::string> StorePlaces::Environment() const {
  std::vector<std::string> environment = {"LITAGS_STORE=" + jobs, "LITAGS_BLOBS=" + blobs,
                                          "LITAGS_S3_ENDPOINT=" + s3_endpoint};
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view entry = *variable;
    const auto begins = [&](std::string_view beginning) { return entry.starts_with(beginning); };
    const bool of_s3 = std::any_of(std::begin(kS3Variables), std::end(kS3Variables), begins);
    const bool of_postgres = begins("PG") || begins("SSL_CERT_");
    if ((BlobsAreFar() && of_s3) || (UsesPostgres() && of_postgres)) {
      environment.emplace_back(entry);
    }
  }
  return environment;
}

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const StorePlaces& places,
                                                       const DataDir& data) {
  LITAGS_RETURN_IF_ERROR(places.Validate());
  if (IsPostgres(places.jobs)) return OpenPostgresJobStore(places.jobs);
  return OpenSqliteJobStore(places.SqlitePath(data));
}

absl::StatusOr<std::unique_ptr<BlobStore>> OpenBlobStore(const StorePlaces& places,
                                                         const DataDir& data) {
  LITAGS_RETURN_IF_ERROR(places.Validate());
  if (places.blobs.starts_with(kS3)) {
    LITAGS_ASSIGN_OR_RETURN(S3Options options, S3OptionsOf(places));
    return OpenS3BlobStore(std::move(options));
  }
  return OpenDiskBlobStore(places.blobs.empty() ? data.blobs() : places.blobs.substr(kFile.size()));
}

absl::StatusOr<std::unique_ptr<InstallationMarker>> MarkerOf(const StorePlaces& places,
                                                             const DataDir& data, JobStore* store,
                                                             BlobStore* blobs) {
  LITAGS_ASSIGN_OR_RETURN(const std::string id, store->InstallationId());
  return std::make_unique<InstallationMarker>(id, PlaceOfBlobs(places, data), blobs);
}

absl::StatusOr<std::unique_ptr<InstallationMarker>> ClaimBlobs(const StorePlaces& places,
                                                               const DataDir& data, JobStore* store,
                                                               BlobStore* blobs) {
  LITAGS_ASSIGN_OR_RETURN(auto marker, MarkerOf(places, data, store, blobs));
  LITAGS_RETURN_IF_ERROR(marker->Claim());
  return marker;
}

absl::Status CheckBlobsAreOurs(const StorePlaces& places, const DataDir& data, BlobStore* blobs) {
  LITAGS_ASSIGN_OR_RETURN(const KnownInstallation known, ReadInstallation(places, data));
  const std::string place = PlaceOfBlobs(places, data);
  const absl::Status marked = InstallationMarker(known.id, place, blobs).Check();
  if (!HasReason(marked, "BLOBS_NOT_MARKED")) return marked;
  if (!known.has_files) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> jobs, blobs->List("jobs"));
  if (!jobs.empty()) return absl::OkStatus();  // from before there were markers
  return MakeError(absl::StatusCode::kFailedPrecondition, "BLOBS_NOT_MARKED", "blobs",
                   absl::StrCat("the job store names files, and there is none in ", place,
                                ": is the volume mounted, and --blobs (or --data, without it) as "
                                "before? If they are lost for good, put any file at ",
                                place, "/jobs/lost/lost, and the server starts without them"));
}

absl::StatusOr<bool> AreOneJobStore(const StorePlaces& one, const StorePlaces& other,
                                    const DataDir& data) {
  if (one.UsesPostgres() != other.UsesPostgres()) return false;
  if (!one.UsesPostgres()) {
    std::error_code error;
    return std::filesystem::equivalent(one.SqlitePath(data), other.SqlitePath(data), error);
  }
  LITAGS_ASSIGN_OR_RETURN(const std::string first, NameOfDatabase(one.jobs));
  LITAGS_ASSIGN_OR_RETURN(const std::string second, NameOfDatabase(other.jobs));
  return first == second;
}

absl::Status CheckJobStore(const StorePlaces& places, const DataDir& data) {
  LITAGS_RETURN_IF_ERROR(places.Validate());
  if (IsPostgres(places.jobs)) {
    LITAGS_ASSIGN_OR_RETURN(const auto connection, PgConnection::Open(places.jobs));
    return CheckPostgresVersion(connection.get());
  }
  return CheckSqliteJobStore(places.SqlitePath(data));
}

}  // namespace litags
