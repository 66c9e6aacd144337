// What is found from another focal length than COLMAP's guess, and with another lens.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/io/exif_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/sfm/sfm.h"
#include "engine/sfm/sfm_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

// Mappings that start from COLMAP's guess and from another focal length: models 0 and 9.
class SfmSecondStart : public SfmTest {
 protected:
  SfmSecondStart() { colmap_.On("mapper", "case $out in *models_again) rung=9 ;; esac"); }

  int Mappings() const {
    int mappings = 0;
    for (const std::string& call : colmap_.Calls()) mappings += call.starts_with("mapper");
    return mappings;
  }
};

// Without EXIF. COLMAP's guess is 77 px of a copy, the models have 50.
TEST_F(SfmSecondStart, IsFromTheLargestModelWhereOthersAreLeft) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3}, 7));
  colmap_.AddModel(0, 1, Model({4, 5}, 7));
  colmap_.AddModel(9, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.views, SizeIs(6));
  EXPECT_THAT(result->rungs, SizeIs(1));
  EXPECT_THAT(result->notes, Contains(HasSubstr("focal length of the photos that were placed")));
  EXPECT_EQ(Mappings(), 2);
}

TEST_F(SfmSecondStart, IsNoneWhereTheGuessWasNear) {
  options_.min_registered = 0.5;
  SparseModel model = Model({0, 1, 2, 3}, 7);
  for (View& view : model.views) view.camera.fx = view.camera.fy = 70;
  for (const int rung : {0, 1, 2}) colmap_.AddModel(rung, 0, model);
  colmap_.AddModel(9, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.views, SizeIs(4));
  EXPECT_EQ(Mappings(), static_cast<int>(result->rungs.size()));
}

TEST_F(SfmSecondStart, IsNoneWhereAllIsPlaced) {
  colmap_.AddModel(0, 0, Model({0, 1, 2, 3, 4, 5}, 7));
  colmap_.AddModel(9, 0, Model({0, 1, 2, 3, 4, 5}, 70));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.points, SizeIs(7));
  EXPECT_EQ(Mappings(), 1);
}

// Mappings of a plain lens and of a fisheye: models 0 and 8.
class SfmFisheye : public SfmSecondStart {
 protected:
  SfmFisheye() { colmap_.On("mapper", "case $out in *models_fisheye) rung=8 ;; esac"); }

  // Copies of 64x48 px at 50 px: corners are 0.8 from the middle.
  static SparseModel WithLens(const Distortion& lens, int points, double error) {
    SparseModel model = Model({0, 1, 2, 3, 4, 5}, points);
    for (Distortion& d : model.distortions) d = lens;
    for (SparsePoint& point : model.points) point.error = error;
    return model;
  }
};

TEST_F(SfmFisheye, IsTriedWhereCornersAreDrawnIn) {
  colmap_.AddModel(0, 0, WithLens({.k1 = -0.2}, 7, 1.1));
  colmap_.AddModel(8, 0, WithLens({.k1 = -0.03, .fisheye = true}, 8, 0.2));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->model.distortions[0].fisheye);
  EXPECT_THAT(result->notes, Contains("the lens is a fisheye: 6 photos were placed, which see "
                                      "points within 0.20 px; as those of a plain lens 6, and "
                                      "within 1.10 px"));
  EXPECT_THAT(result->notes, Not(Contains(HasSubstr("is taken out"))));
  EXPECT_EQ(Mappings(), 2);
}

TEST_F(SfmFisheye, IsNotTakenWherePointsFitItWorse) {
  colmap_.AddModel(0, 0, WithLens({.k1 = -0.2}, 7, 0.2));
  colmap_.AddModel(8, 0, WithLens({.k1 = -0.03, .fisheye = true}, 8, 0.3));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_FALSE(result->model.distortions[0].fisheye);
  EXPECT_THAT(result->notes, Contains(HasSubstr("is taken out")));
  EXPECT_EQ(Mappings(), 2);
}

TEST_F(SfmFisheye, IsNotTriedWithAPlainLens) {
  colmap_.AddModel(0, 0, WithLens({.k1 = -0.1}, 7, 0.5));
  colmap_.AddModel(8, 0, WithLens({.fisheye = true}, 8, 0.2));
  const auto result = Find();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_FALSE(result->model.distortions[0].fisheye);
  EXPECT_EQ(Mappings(), 1);
}

// Photos whose EXIF says a focal length.
class SfmWithExif : public SfmSecondStart {
 protected:
  SfmWithExif() {
    colmap_.SetDatabase(CopyNamesOf26mm(), kFeatures, {{0, 1}, {1, 2}, {0, 2}, {3, 4}});
  }

  static SparseModel ModelOf26mm(const std::vector<int>& photos, int points) {
    return CopiesModel("128x96_26mm", 64, 48, photos, points);
  }
  static std::vector<std::string> CopyNamesOf26mm() {
    std::vector<std::string> names;
    for (const View& view : ModelOf26mm({0, 1, 2, 3, 4, 5}, 0).views) names.push_back(view.name);
    return names;
  }

  // 26 mm is 48 px of a copy, and its cameras have 50.
  absl::StatusOr<SfmResult> FindWith(int in_35mm) {
    const std::string photos = colmap_.MakePhotos(6, 128, 96, kDark);
    for (int i = 0; i < 6; ++i) {
      const std::string path = absl::StrCat(photos, "/p", i, ".png");
      const std::string jpeg = EncodeJpeg(ReadImage(path, "").value()).value();
      EXPECT_TRUE(WriteFileAtomically(path, WithJpegExif(jpeg, FocalBlock(in_35mm, 4, 1))).ok());
    }
    return FindCameras(photos, colmap_.dir() + "/work", options_, cancel_);
  }
};

TEST_F(SfmWithExif, ItsFocalLengthIsTheStartWherePhotosAreLeftOut) {
  colmap_.AddModel(0, 0, ModelOf26mm({0, 1, 2}, 7));
  colmap_.AddModel(9, 0, ModelOf26mm({0, 1, 2, 3, 4, 5}, 7));
  const auto result = FindWith(26);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.views, SizeIs(6));
  EXPECT_THAT(result->rungs, SizeIs(1));
  EXPECT_THAT(result->notes, Contains(HasSubstr("focal length that EXIF says")));
  EXPECT_EQ(Mappings(), 2);
}

TEST_F(SfmWithExif, ThatIsWrongMakesNothingWorse) {
  options_.min_registered = 0.5;
  colmap_.AddModel(0, 0, ModelOf26mm({0, 1, 2, 3}, 7));
  colmap_.AddModel(9, 0, ModelOf26mm({0, 1, 2}, 70));
  for (const int rung : {1, 2}) colmap_.AddModel(rung, 0, ModelOf26mm({0, 1, 2, 3}, 6));
  const auto result = FindWith(26);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.views, SizeIs(4));
  EXPECT_THAT(result->notes, Not(Contains(HasSubstr("EXIF"))));
}

// As of a camera that goes straight ahead: COLMAP's guess ends in points that few photos see.
TEST_F(SfmWithExif, DecidesWhereAnotherFocalLengthIsFoundAndPointsAreSeenLessOften) {
  SparseModel guess = ModelOf26mm({0, 1, 2, 3, 4, 5}, 9);
  for (SparsePoint& point : guess.points) point.track.resize(2);
  for (View& view : guess.views) view.camera.fx = view.camera.fy = 20;
  colmap_.AddModel(0, 0, guess);
  colmap_.AddModel(9, 0, ModelOf26mm({0, 1, 2, 3, 4, 5}, 7));
  const auto result = FindWith(26);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.points, SizeIs(7));
  EXPECT_EQ(Mappings(), 2);
}

// As of a wall: half of the focal length fits more points, but worse.
TEST_F(SfmWithExif, DoesNotDecideWherePointsFitItWorse) {
  SparseModel guess = ModelOf26mm({0, 1, 2, 3, 4, 5}, 7);
  for (View& view : guess.views) view.camera.fx = view.camera.fy = 20;
  SparseModel exif = ModelOf26mm({0, 1, 2, 3, 4, 5}, 9);
  for (SparsePoint& point : guess.points) point.error = 0.2;
  for (SparsePoint& point : exif.points) point.error = 0.3;
  colmap_.AddModel(0, 0, guess);
  colmap_.AddModel(9, 0, exif);
  const auto result = FindWith(26);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.points, SizeIs(7));
  EXPECT_EQ(Mappings(), 2);
}

TEST_F(SfmWithExif, IsNotTriedWhereAllIsPlacedAsItSays) {
  colmap_.AddModel(0, 0, ModelOf26mm({0, 1, 2, 3, 4, 5}, 7));
  colmap_.AddModel(9, 0, ModelOf26mm({0, 1, 2, 3, 4, 5}, 70));
  const auto result = FindWith(26);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->model.points, SizeIs(7));
  EXPECT_EQ(Mappings(), 1);
}

}  // namespace
}  // namespace litags
