#include "engine/core/photo_names.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/name_key.h"

namespace litags {

std::string WithoutEnding(const std::string& name) { return name.substr(0, name.rfind('.')); }

PhotoNames::PhotoNames(absl::Span<const std::string> photos)
    : names_(photos.begin(), photos.end()) {
  for (const std::string& photo : photos) {
    const auto [first, added] = by_stem_.emplace(WithoutEnding(photo), photo);
    if (!added) first->second.clear();
  }
}

std::optional<std::string> PhotoNames::Find(const std::string& name) const {
  if (names_.contains(name)) return name;
  const auto stem = by_stem_.find(name);
  return stem == by_stem_.end() ? std::nullopt : std::optional(stem->second);
}

int HowNamed(const std::string& photo, absl::FunctionRef<bool(const std::string& key)> has) {
  if (!has(NameKey(WithoutEnding(photo)))) return 0;
  return has(NameKey(photo)) ? 2 : 1;
}

std::vector<std::string> DepthMapNames(const std::string& photo) {
  std::vector<std::string> names;
  for (const std::string& base : {photo, WithoutEnding(photo)}) {
    for (const char* ending : {".npy", ".NPY", ".pfm", ".PFM", ".png", ".PNG"}) {
      names.push_back(base + ending);
    }
  }
  return names;
}

absl::Status CheckDepthMapIsOf(const std::string& photo, const std::string& map,
                               const PhotoNames& photos, const std::string& field) {
  const std::string stem = WithoutEnding(map);
  if (photos.Find(stem) == photo) return absl::OkStatus();
  return InvalidInput("DEPTH_MAP_AMBIGUOUS", field,
                      absl::StrCat(field, ": several photos are called ", stem, " or ", stem,
                                   ".*; name their maps <photo's whole name>.npy, .pfm or .png, "
                                   "as ",
                                   photo, map.substr(stem.size())));
}

}  // namespace litags
