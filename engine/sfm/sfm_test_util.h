// Six photos through FindCameras, with a script in COLMAP's place.
#ifndef LITAGS_ENGINE_SFM_SFM_TEST_UTIL_H_
#define LITAGS_ENGINE_SFM_SFM_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/cancel.h"
#include "engine/io/sparse_model.h"
#include "engine/sfm/fake_colmap.h"
#include "engine/sfm/sfm.h"

namespace litags {

inline constexpr int kDark = 12, kWellLit = 120;  // sRGB codes
inline constexpr int kFeatures = 900;

// Six photos of 128x96 px that COLMAP gets at 64x48.
class SfmTest : public ::testing::Test {
 protected:
  SfmTest() {
    options_.colmap = colmap_.program();
    options_.on_line = [this](std::string_view line) { colmap_.Hear(line); };
    options_.max_image_side = 64;
    options_.threads = 1;
    colmap_.SetDatabase(CopyNames({0, 1, 2, 3, 4, 5}), kFeatures, {{0, 1}, {1, 2}, {0, 2}, {3, 4}});
  }

  static std::vector<std::string> CopyNames(const std::vector<int>& photos) {
    std::vector<std::string> names;
    for (const View& view : Model(photos, 0).views) names.push_back(view.name);
    return names;
  }
  static SparseModel Model(const std::vector<int>& photos, int points) {
    return CopiesModel("128x96", 64, 48, photos, points);
  }

  absl::StatusOr<SfmResult> Find(int level = kDark) {
    const std::string photos = colmap_.MakePhotos(6, 128, 96, level);
    return FindCameras(photos, colmap_.dir() + "/work", options_, cancel_);
  }

  // What a caller would pass: cameras of p0..p5 at the photos' own size.
  static SparseModel KnownCameras() {
    SparseModel known = Model({0, 1, 2, 3, 4, 5}, 0);
    for (int i = 0; i < 6; ++i) {
      known.views[i].name = absl::StrCat("p", i, ".png");
      known.views[i].camera = known.views[i].camera.Scaled(128, 96);
      known.views[i].camera.t[1] = 0.1 + i / 3.0;  // digits that a text file would lose
    }
    return known;
  }

  // COLMAP's features are where the known cameras of these photos, in id order, see points.
  void SeeWorldPoints(const SparseModel& known, const std::vector<int>& photos) const {
    std::vector<Camera> copies;
    for (const int photo : photos) copies.push_back(known.views[photo].camera.Scaled(64, 48));
    colmap_.SeeWorldPoints(copies, kFeatures);
  }

  FakeColmap colmap_;
  SfmOptions options_;
  CancelToken cancel_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_SFM_TEST_UTIL_H_
