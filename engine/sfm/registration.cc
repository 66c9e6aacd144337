#include "engine/sfm/registration.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"

namespace litags {
namespace {

constexpr size_t kNamesShown = 5;

struct CauseText {
  DropCause cause;
  const char* one;
  const char* many;
};
constexpr CauseText kCauses[] = {
    {DropCause::kFewFeatures, "has too few features", "have too few features"},
    {DropCause::kNoMatches, "matches no other photo", "match no other photo"},
    {DropCause::kOtherGroup, "belongs to a separate group", "belong to separate groups"},
    {DropCause::kNotPlaced, "matches others too weakly to be placed",
     "match others too weakly to be placed"},
    {DropCause::kNoCamera, "has no given camera", "have no given camera"},
};

std::string ShortList(std::vector<std::string> names) {
  const size_t total = names.size();
  if (total > kNamesShown) names.resize(kNamesShown);
  std::string list = absl::StrJoin(names, ", ");
  if (total > kNamesShown) absl::StrAppend(&list, ", ", total - kNamesShown, " more");
  return list;
}

// Photos of the second largest group: models that share photos with the first come before smaller
// ones that share none. 0 if there is no second.
int SecondLargest(const std::vector<int>& groups) {
  return groups.size() > 1 ? *std::max_element(groups.begin() + 1, groups.end()) : 0;
}

absl::Status Refuse(std::string_view reason, const std::string& message) {
  return MakeError(absl::StatusCode::kFailedPrecondition, reason, "images", message);
}

}  // namespace

int NeededPhotos(int num_photos, const SfmOptions& options) {
  // A hair below, so that 0.7 of 10 photos is 7 despite rounding.
  const int fraction = static_cast<int>(std::ceil(options.min_registered * num_photos - 1e-9));
  return std::min(num_photos, std::max<int>(kMinPhotos, fraction));
}

std::string SummarizeDrops(const std::vector<SfmPhoto>& photos) {
  std::vector<std::string> parts;
  for (const CauseText& text : kCauses) {
    std::vector<std::string> names;
    for (const SfmPhoto& photo : photos) {
      if (photo.drop == text.cause) names.push_back(photo.name);
    }
    if (names.empty()) continue;
    parts.push_back(absl::StrCat(names.size(), " ", names.size() == 1 ? text.one : text.many, " (",
                                 ShortList(names), ")"));
  }
  return absl::StrJoin(parts, "; ");
}

std::string SummarizeCameras(const std::vector<PhotoFile>& photos) {
  std::map<std::string, int> count;
  for (const PhotoFile& photo : photos) ++count[photo.camera];
  if (count.size() < 2) return "";
  std::vector<std::string> parts;
  for (const auto& [camera, n] : count) {
    parts.push_back(absl::StrCat(Counted(n, "photo"), " of ", camera));
  }
  return absl::StrCat(count.size(), " cameras: ", ShortList(parts));
}

std::string SummarizeSharedSizes(const std::vector<PhotoFile>& photos) {
  std::map<std::string, std::pair<PhotoFile, PhotoFile>> ends;  // smallest, largest by camera
  const auto size = [](const PhotoFile& photo) { return std::pair(photo.width, photo.height); };
  for (const PhotoFile& photo : photos) {
    auto& [least, most] = ends.emplace(photo.camera, std::pair(photo, photo)).first->second;
    if (size(photo) < size(least)) least = photo;
    if (size(photo) > size(most)) most = photo;
  }
  std::vector<std::string> parts;
  for (const auto& [camera, pair] : ends) {
    const auto& [least, most] = pair;
    if (size(least) == size(most)) continue;
    parts.push_back(
        absl::StrCat(least.width, "x", least.height, " to ", most.width, "x", most.height));
  }
  if (parts.empty()) return "";
  return absl::StrCat("photos of ", absl::StrJoin(parts, ", of "),
                      " px, which differ by little, share a lens");
}

absl::Status TooFewRegistered(int registered, int num_photos, int needed, const std::string& by,
                              const std::string& drops) {
  return Refuse("SFM_TOO_FEW_REGISTERED",
                absl::StrCat(registered, " of ", num_photos, " photos could be placed, ", needed,
                             " are needed (", by, "): ", drops,
                             "; try leaving those out, photos with more overlap, sharper or less "
                             "extremely exposed ones, a lower min_registered, or known cameras"));
}

absl::Status JudgeRegistration(const SfmRung& rung, const std::vector<SfmPhoto>& photos,
                               const SfmOptions& options) {
  const int n = static_cast<int>(photos.size());
  const int needed = NeededPhotos(n, options);
  const std::string drops = SummarizeDrops(photos);
  const int second = SecondLargest(rung.groups);
  if (rung.turned) {
    return Refuse(
        "SFM_NO_PARALLAX",
        "the photos match each other but show no parallax: the camera turned in place, as "
        "for a panorama; take a step to the side between photos");
  }
  if (rung.registered == 0) {
    return Refuse("SFM_NO_MODEL",
                  absl::StrCat("none of ", n, " photos could be placed: ", drops,
                               "; try photos of one place that overlap by half or more, sharper or "
                               "less extremely exposed ones, or bring known cameras"));
  }
  if (second > 0 && 2 * second >= rung.groups[0]) {
    return Refuse("SFM_SPLIT",
                  absl::StrCat("the ", n, " photos fall into ", rung.groups.size(),
                               " groups that share nothing (", absl::StrJoin(rung.groups, ", "),
                               " photos): ", drops,
                               "; send one place per job, or add photos that link the groups"));
  }
  if (rung.registered < needed) {
    return TooFewRegistered(rung.registered, n, needed,
                            absl::StrCat("best preparation: ", rung.preparation), drops);
  }
  return absl::OkStatus();
}

}  // namespace litags
