#include "server/web/assets.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/viewer/viewer.h"

namespace litags::web {

std::span<const Asset> Assets() {
  static const auto* const etag =
      new std::string(absl::StrCat("\"", std::string(ViewerDigest()), "\""));
  static const auto* const all = [] {
    const auto page = PageAssets();
    auto* assets = new std::vector<Asset>(page.begin(), page.end());
    if (!ViewerModule().empty()) {
      assets->push_back({"/viewer.js", "text/javascript; charset=utf-8", *etag, ViewerModule()});
    }
    return assets;
  }();
  return *all;
}

}  // namespace litags::web
