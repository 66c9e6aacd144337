#ifndef LITAGS_SERVER_WEB_ASSETS_H_
#define LITAGS_SERVER_WEB_ASSETS_H_

#include <span>
#include <string_view>

namespace litags::web {

// A file of the page. The build makes them of server/web/app and engine/viewer.
struct Asset {
  std::string_view path;  // "/app.js"
  std::string_view type;
  std::string_view etag;  // in quotes
  std::string_view bytes;
};

// Those of the page, and the viewer's if there is one.
std::span<const Asset> Assets();
// Those of the page alone.
std::span<const Asset> PageAssets();

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_ASSETS_H_
