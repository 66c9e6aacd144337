#include "server/worker/self_check.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>

#include "engine/core/error.h"
#include "server/store/file_error.h"
#include "server/worker/scratch_folder.h"

namespace litags {
namespace {

constexpr int64_t kRoomOfSmallJob = int64_t{64} << 20;

}  // namespace

absl::Status CheckWorker(const WorkerContext& context) {
  LITAGS_ASSIGN_OR_RETURN(const auto scratch, ScratchFolder::Make(context.data.scratch()));
  const std::string path = scratch->path() + "/room";
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) return FileError("create", path, errno);
  const int error = posix_fallocate(fd, 0, kRoomOfSmallJob);
  close(fd);
  if (error != 0) return FileError("write", path, error);
  const absl::Status read = context.blobs->Get("self-check").status();  // there is no such blob
  return absl::IsNotFound(read) ? absl::OkStatus() : read;
}

absl::Status CheckWorkerAfter(const absl::Status& error, const WorkerContext& context) {
  LITAGS_RETURN_IF_ERROR(CheckWorker(context));
  if (!HasReason(error, "BLOB_NOT_FOUND")) return absl::OkStatus();
  return context.marker->Check();
}

bool IsFaultOfWorker(const absl::Status& error, const WorkerContext& context) {
  return (HasReason(error, "DISK_FULL") || HasReason(error, "STORE_FAILED") ||
          HasReason(error, "BLOBS_DENIED") || HasReason(error, "BLOB_NOT_FOUND")) &&
         !CheckWorkerAfter(error, context).ok();
}

std::string TroubleInWords(const absl::Status& error) {
  if (HasReason(error, "DISK_FULL")) return "its disk is full";
  if (HasReason(error, "BLOBS_DENIED")) return "the blob store refuses its key";
  if (HasReason(error, "BLOB_NOT_FOUND")) return "it does not see the server's files";
  return "it cannot read or write its files";
}

}  // namespace litags
