// The viewer of scenes in the browser, by WebGL; the build makes it of the files in src.
#ifndef LITAGS_ENGINE_VIEWER_VIEWER_H_
#define LITAGS_ENGINE_VIEWER_VIEWER_H_

#include <string_view>

namespace litags {

// An ES module that loads nothing more (src/viewer.ts); empty where the build had no node.
std::string_view ViewerModule();
// The start of its SHA-256, in hex.
std::string_view ViewerDigest();
// A page around it, with places for @CAMERAS@, @SCENE@ and @MODULE@.
std::string_view ViewerPage();

}  // namespace litags

#endif  // LITAGS_ENGINE_VIEWER_VIEWER_H_
