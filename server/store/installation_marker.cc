#include "server/store/installation_marker.h"

#include <algorithm>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr char kFolder[] = "installation";

// As JobStore::InstallationId() gives them. Other names in the folder are not ours.
bool IsInstallationId(const std::string& name) {
  return name.size() == 32 && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

absl::StatusOr<std::vector<std::string>> MarkersIn(BlobStore* blobs) {
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> names, blobs->List(kFolder));
  std::erase_if(names, [](const std::string& name) { return !IsInstallationId(name); });
  return names;
}

}  // namespace

InstallationMarker::InstallationMarker(std::string id, std::string place, BlobStore* blobs)
    : id_(std::move(id)), place_(std::move(place)), blobs_(blobs) {}

absl::Status InstallationMarker::Claim() const {
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> ids, MarkersIn(blobs_));
  if (ids.empty()) {
    LITAGS_RETURN_IF_ERROR(blobs_->Put(
        absl::StrCat(kFolder, "/", id_),
        "The blobs here belong to the litags installation that this is named after.\n"));
    // Another installation may have started at the same moment.
    LITAGS_ASSIGN_OR_RETURN(ids, MarkersIn(blobs_));
  }
  return CheckOthers(ids);
}

absl::Status InstallationMarker::Check() const {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> ids, MarkersIn(blobs_));
  LITAGS_RETURN_IF_ERROR(CheckOthers(ids));
  if (!ids.empty()) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "BLOBS_NOT_MARKED", "blobs",
                   absl::StrCat("the marker ", place_, "/", kFolder, "/", id_,
                                " of this installation is not there: is --blobs (or --data, "
                                "without it) the server's, and the volume mounted? A server puts "
                                "the marker back when it starts"));
}

absl::Status InstallationMarker::CheckOthers(const std::vector<std::string>& ids) const {
  const auto other =
      std::find_if(ids.begin(), ids.end(), [&](const std::string& id) { return id != id_; });
  if (other == ids.end()) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "BLOBS_OF_ANOTHER_INSTALLATION", "blobs",
      absl::StrCat("the blob store ", place_, " belongs to another installation, ", *other,
                   ", and this one is ", id_.empty() ? "new" : id_,
                   "; give this one a bucket, prefix or data folder of its own, or, if the other's "
                   "job store is gone for good and this one replaces it, remove the marker ",
                   place_, "/", kFolder, "/", *other));
}

}  // namespace litags
