#include "server/main/preflight.h"

#include <sys/statvfs.h>
#include <unistd.h>

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/file_ruleset.h"
#include "engine/core/sandbox.h"
#include "engine/io/file_util.h"
#include "engine/sfm/colmap_version.h"
#include "server/auth/authenticator.h"
#include "server/auth/tls.h"
#include "server/jobs/placement.h"
#include "server/jobs/webhook.h"
#include "server/main/serve_web.h"
#include "server/store/data_dir.h"
#include "server/store/file_error.h"
#include "server/store/open_stores.h"
#include "server/worker/hardening.h"

namespace litags {
namespace {

// A capture of 50 photos with its scene takes some hundred megabytes.
constexpr int64_t kAmpleFreeBytes = int64_t{1} << 30;

using Finding = absl::StatusOr<std::string>;  // what was found, for humans

Finding CheckStore(const ServerFlags& flags, bool* is_full) {
  LITAGS_ASSIGN_OR_RETURN(const DataDir data, DataDir::Open(flags.data));
  const std::string probe = absl::StrCat(data.tmp(), "/check-", getpid());
  const absl::Status written = WriteFileAtomically(probe, "check\n");
  unlink(probe.c_str());
  *is_full = HasReason(written, "DISK_FULL");
  if (!*is_full) LITAGS_RETURN_IF_ERROR(written);
  LITAGS_RETURN_IF_ERROR(CheckJobStore(flags.places, data));
  // Looks into a store on another machine when it is opened.
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, OpenBlobStore(flags.places, data));
  LITAGS_RETURN_IF_ERROR(CheckBlobsAreOurs(flags.places, data, blobs.get()));
  // A server that runs holds the lock: no reason to fail, but to say so.
  const bool used = !DataDirLock::Take(data).ok();
  return absl::StrCat(
      data.root,
      *is_full ? " is on a full disk: jobs can be deleted, all else needs room (DISK_FULL)"
               : " can be written",
      used ? "; a server is using it now" : "; no server is using it",
      data.OthersMayEnter() ? "; others may enter it: chmod 700 keeps them out" : "");
}

Finding CheckColmap(const ServerFlags& flags) {
  return AskColmapVersion(flags.colmap, 0, CancelToken());
}

Finding CheckTls(const ServerFlags& flags) {
  if (!flags.server.tls.enabled()) return std::string("off");
  LITAGS_ASSIGN_OR_RETURN(const TlsMaterial tls, LoadTls(flags.server.tls));
  return absl::StrCat("the certificate is in force until ", tls.expires,
                      tls.client_ca.empty() ? "" : "; clients must show one");
}

Finding CheckAuthentication(const ServerFlags& flags) {
  AuthOptions auth = flags.server.auth;
  auth.client_certificates = !flags.server.tls.client_ca.empty();
  LITAGS_RETURN_IF_ERROR(Authenticator::Make(auth).status());
  return std::string(auth.enabled() ? "clients are asked who they are" : "off: all are operators");
}

Finding CheckAddress(const ServerFlags& flags) {
  LITAGS_RETURN_IF_ERROR(CheckListening(flags.server));
  LITAGS_RETURN_IF_ERROR(
      CheckMetricsListening(flags.metrics_listen, flags.metrics_for_all || flags.server.insecure));
  LITAGS_RETURN_IF_ERROR(CheckWebListening(flags));
  return absl::StrCat(flags.server.listen,
                      IsLoopback(flags.server.listen) ? ", for this machine only" : "");
}

void Print(const char* word, const char* what, const std::string& text) {
  std::printf("%-4s %-14s %s\n", word, what, text.c_str());
}

bool Report(const char* what, const Finding& finding) {
  Print(finding.ok() ? "ok" : "FAIL", what,
        finding.ok() ? *finding : MessageWithReason(finding.status()));
  return finding.ok();
}

// A server on a full disk starts: jobs can be deleted only while it runs.
bool ReportStore(const ServerFlags& flags) {
  bool is_full = false;
  const Finding found = CheckStore(flags, &is_full);
  if (!found.ok() || !is_full) return Report("store", found);
  Print("note", "store", *found);
  return true;
}

// A server with little space starts, too.
bool ReportSpace(const StorePlaces::Folder& folder) {
  struct statvfs info = {};
  if (statvfs(folder.path.c_str(), &info) != 0) {
    return Report("space",
                  MakeError(absl::StatusCode::kFailedPrecondition, "SPACE_UNKNOWN", folder.flag,
                            absl::StrCat("cannot ask for the free space of ", folder.path)));
  }
  const int64_t free = static_cast<int64_t>(info.f_bavail) * static_cast<int64_t>(info.f_frsize);
  const std::string text = absl::StrCat(free >> 20, " MiB free in ", folder.path);
  if (free >= kAmpleFreeBytes) {
    Print("ok", "space", text);
  } else {
    Print("note", "space",
          absl::StrCat(text, ", fewer than ", kAmpleFreeBytes >> 20,
                       ": large jobs may fail; free some, or choose another ", folder.flag));
  }
  return true;
}

// What a kernel lacks is for the operator to judge: nothing fails.
void ReportConfinement() {
  if (SyscallFilter::Supported()) {
    Print("ok", "confinement", "COLMAP and readers of files have no sockets (seccomp)");
  } else {
    Print("note", "confinement",
          "this kernel or container filters no system calls (seccomp): COLMAP and readers of files "
          "are not kept from the network; run on Linux 3.17 or later, with seccomp allowed");
  }
  if (FileRuleset::Supported()) {
    Print("ok", "confinement", "COLMAP opens no files but the job's and programs (Landlock)");
  } else {
    Print("note", "confinement",
          "this kernel or container keeps no program from files (Landlock): COLMAP may read all "
          "that this user may; run on Linux 5.13 or later, with Landlock allowed");
  }
}

}  // namespace

absl::Status CheckPrograms(const ServerFlags& flags, const std::string& worker_program) {
  if (flags.workers > 0 && access(worker_program.c_str(), X_OK) != 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "WORKER_NOT_FOUND", "--workers",
                     absl::StrCat(worker_program,
                                  " is not there or not executable; install it beside "
                                  "litags-server, or start with --workers 0"));
  }
  // A worker that is started with these ends at once.
  HardeningOptions hardening;
  hardening.max_memory_bytes = flags.worker_memory_bytes;
  if (const absl::Status valid = hardening.Validate(); !valid.ok()) {
    return InvalidInput("OUT_OF_RANGE", "--worker-memory",
                        absl::StrCat("--worker-memory: ", std::string(valid.message())));
  }
  LITAGS_RETURN_IF_ERROR(CheckLabels(flags.worker_labels, "--worker-labels"));
  LITAGS_ASSIGN_OR_RETURN(const DepthNetwork network,
                          DepthNetwork::Parse(flags.depth_model, "--depth-model"));
  if (!network.path.empty() && access(network.path.c_str(), R_OK) != 0) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "DEPTH_MODEL_NOT_FOUND",
                     "--depth-model", absl::StrCat(network.path, " is not there or not readable"));
  }
  LITAGS_RETURN_IF_ERROR(CheckWebhookHosts(flags.webhooks.hosts));
  if (flags.webhook_ca.empty()) return absl::OkStatus();
  return CheckCertificates(flags.webhook_ca, "--webhook-ca");
}

bool Preflight(const ServerFlags& flags, const std::string& worker_program) {
  const absl::Status programs = CheckPrograms(flags, worker_program);
  bool well = ReportStore(flags);
  for (const auto& folder : flags.places.LocalFolders({flags.data})) well &= ReportSpace(folder);
  well &= Report("programs", programs.ok() ? Finding(worker_program) : Finding(programs));
  well &= Report("colmap", CheckColmap(flags));
  ReportConfinement();
  well &= Report("address", CheckAddress(flags));
  well &= Report("tls", CheckTls(flags));
  well &= Report("authentication", CheckAuthentication(flags));
  std::fflush(stdout);
  return well;
}

}  // namespace litags
