#include "server/jobs/move.h"

#include <chrono>
#include <filesystem>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/placement.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

constexpr int kJobsPerPage = 200;
constexpr std::chrono::seconds kNoteEvery{1};

absl::Status CheckUnused(JobStore* store, const char* which) {
  LITAGS_ASSIGN_OR_RETURN(const Workforce workers, WorkersThere(store));
  LITAGS_ASSIGN_OR_RETURN(const bool leased, [&]() -> absl::StatusOr<bool> {
    // Looked at, not changed: the function refuses.
    const auto job = store->UpdateFirstLeasedBeyond(
        store->NowMs(), [](JobTransaction&) { return absl::CancelledError("leased"); });
    if (absl::IsCancelled(job.status())) return true;
    LITAGS_RETURN_IF_ERROR(job.status());
    return false;
  }());
  if (workers.empty() && !leased) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "SOURCE_IN_USE", which,
                   absl::StrCat("the job store of ", which, " is in use: ", workers.size(),
                                " workers were there within the last ", kWorkerSilenceMs / 1000,
                                " s", leased ? " and a job is running" : "",
                                "; stop all servers and workers, or wait until dead ones are "
                                "forgotten"));
}

absl::StatusOr<std::vector<std::string>> JobIds(JobStore* store) {
  std::vector<std::string> ids;
  int64_t time_ms = 0;
  std::string id;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const auto page, store->List(time_ms, id, kJobsPerPage));
    if (page.empty()) return ids;
    for (const JobRecord& job : page) ids.push_back(job.id);
    time_ms = page.back().create_time_ms;
    id = page.back().id;
  }
}

absl::Status TargetIsSource(const char* which) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "TARGET_NOT_EMPTY", which,
                   absl::StrCat("--", which,
                                " is the store that is moved, which would be there "
                                "once only; name another one"));
}

// Whether what is put into `to` is in `from`, however their URLs are written.
absl::StatusOr<bool> AreOneStore(BlobStore* from, BlobStore* to) {
  const std::string key = absl::StrCat("move/", RandomHex(8));
  LITAGS_RETURN_IF_ERROR(to->Put(key, "litags-server move looks whether this is its source.\n"));
  const absl::StatusOr<bool> has = from->Has(key);
  LITAGS_RETURN_IF_ERROR(to->RemoveFolder("move"));
  return has;
}

// Adds the keys of all blobs below a folder.
absl::Status AddKeys(BlobStore* blobs, const std::string& folder, std::set<std::string>* keys) {
  LITAGS_ASSIGN_OR_RETURN(const auto names, blobs->List(folder));
  for (const std::string& name : names) {
    const std::string key = absl::StrCat(folder, "/", name);
    if (IsDigest(name)) {
      keys->insert(key);
    } else {
      LITAGS_RETURN_IF_ERROR(AddKeys(blobs, key, keys));
    }
  }
  return absl::OkStatus();
}

class Mover {
 public:
  Mover(BlobStore* from, BlobStore* to, const DataDir& data,
        const std::function<void(const std::string&)>& note)
      : from_(from),
        to_(to),
        staging_(absl::StrCat(data.tmp(), "/move-", RandomHex(4))),
        copy_(staging_ + "-copy"),
        note_(note) {}
  ~Mover() {
    std::error_code error;
    fs::remove(staging_, error);
    fs::remove(copy_, error);
  }

  absl::Status MoveJob(const std::string& id) {
    const std::string folder = "jobs/" + id;
    std::set<std::string> wanted, there;
    LITAGS_RETURN_IF_ERROR(AddKeys(from_, folder, &wanted));
    LITAGS_RETURN_IF_ERROR(AddKeys(to_, folder, &there));
    for (const std::string& key : wanted) {
      if (!there.contains(key)) {
        LITAGS_RETURN_IF_ERROR(FetchChecked(from_, key, "source").status());
        LITAGS_RETURN_IF_ERROR(PutCopy(key));
        ++summary.blobs_copied;
      }
      // What came earlier may have been damaged since; what came now is read back.
      LITAGS_ASSIGN_OR_RETURN(const int64_t bytes, FetchChecked(to_, key, "target"));
      ++summary.blobs;
      summary.blob_bytes += bytes;
      Note();
    }
    return absl::OkStatus();
  }

  MoveSummary summary;

 private:
  // Makes the blob the file staging_; its size.
  absl::StatusOr<int64_t> FetchChecked(BlobStore* blobs, const std::string& key,
                                       const char* which) {
    std::error_code error;
    fs::remove(staging_, error);
    LITAGS_RETURN_IF_ERROR(blobs->Fetch(key, staging_));
    LITAGS_ASSIGN_OR_RETURN(const FileDigest found, DigestOfFile(staging_));
    if (found.sha256 != key.substr(key.rfind('/') + 1)) {
      return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", which,
                       absl::StrCat("the blob ", key, " of the ", which, " has the digest ",
                                    found.sha256, "; put it back from a backup"));
    }
    return found.bytes;
  }

  // Stores staging_ with bytes of its own: it may be another name of the source's file.
  absl::Status PutCopy(const std::string& key) {
    std::error_code ignored;
    if (fs::hard_link_count(staging_, ignored) == 1) return to_->PutFile(key, staging_);
    fs::remove(copy_, ignored);
    if (const int error = CopyFile(staging_, copy_)) return FileError("copy", staging_, error);
    return to_->PutFile(key, copy_);
  }

  void Note() {
    if (SteadyClock::now() - noted_ < kNoteEvery) return;
    noted_ = SteadyClock::now();
    note_(absl::StrCat(summary.blobs, " blobs, ", summary.blob_bytes >> 20, " MiB"));
  }

  BlobStore* const from_;
  BlobStore* const to_;
  const std::string staging_, copy_;
  const std::function<void(const std::string&)>& note_;
  SteadyClock::time_point noted_;  // long ago
};

}  // namespace

absl::StatusOr<MoveSummary> MoveInstallation(const StorePlaces& from, const StorePlaces& to,
                                             const DataDir& data,
                                             const std::function<void(const std::string&)>& note) {
  std::error_code error;  // opening says what is wrong
  if (!from.UsesPostgres() && !fs::exists(from.SqlitePath(data), error) && !error) {
    return InvalidInput("SOURCE_NOT_FOUND", "data",
                        absl::StrCat("there is no job store ", from.SqlitePath(data),
                                     " to move; name the installation's --data or --store"));
  }
  LITAGS_RETURN_IF_ERROR(CheckJobStore(from, data));
  LITAGS_ASSIGN_OR_RETURN(const auto store, OpenJobStore(from, data));
  LITAGS_RETURN_IF_ERROR(CheckUnused(store.get(), "store"));
  LITAGS_ASSIGN_OR_RETURN(const auto target_store, OpenJobStore(to, data));
  LITAGS_RETURN_IF_ERROR(CheckUnused(target_store.get(), "to-store"));
  LITAGS_ASSIGN_OR_RETURN(const bool same_jobs, AreOneJobStore(from, to, data));
  if (same_jobs) return TargetIsSource("to-store");
  LITAGS_ASSIGN_OR_RETURN(const auto source, OpenBlobStore(from, data));
  LITAGS_RETURN_IF_ERROR(CheckBlobsAreOurs(from, data, source.get()));
  LITAGS_ASSIGN_OR_RETURN(const auto target, OpenBlobStore(to, data));
  // By the id that the target's job store will have, too.
  LITAGS_RETURN_IF_ERROR(ClaimBlobs(to, data, store.get(), target.get()).status());
  LITAGS_ASSIGN_OR_RETURN(const bool same_blobs, AreOneStore(source.get(), target.get()));
  if (same_blobs) return TargetIsSource("to-blobs");
  LITAGS_ASSIGN_OR_RETURN(const RowSums rows, ReadRowSums(from, data));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> ids, JobIds(store.get()));
  Mover mover(source.get(), target.get(), data, note);
  for (const std::string& id : ids) LITAGS_RETURN_IF_ERROR(mover.MoveJob(id));
  LITAGS_ASSIGN_OR_RETURN(mover.summary.rows, CopyRows(from, to, data, rows));
  LITAGS_RETURN_IF_ERROR(CheckUnused(store.get(), "store"));
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data.uploads()));
  mover.summary.partial_jobs = static_cast<int64_t>(partials.size());
  return mover.summary;
}

}  // namespace litags
