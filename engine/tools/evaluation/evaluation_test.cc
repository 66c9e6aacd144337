#include "engine/tools/evaluation/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "engine/core/error.h"
#include "engine/io/image_io.h"

namespace litags {
namespace {

ImageU8 Ramp(int offset) {
  ImageU8 image(32, 24);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<uint8_t>(40 + offset + (i * 7) % 100);
  }
  return image;
}

class EvaluationTest : public testing::Test {
 protected:
  void SetUp() override {
    dir_ = testing::TempDir() + "/evaluation_" +
           testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(dir_);
    std::filesystem::create_directories(dir_ + "/truth");
    std::filesystem::create_directories(dir_ + "/photos");
  }
  std::string dir_;
};

TEST_F(EvaluationTest, AUniformOffsetCostsItsPsnrAndNothingAfterTheColourFit) {
  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", Ramp(0)).ok());
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add("a.png", Ramp(10)).ok());
  ASSERT_TRUE(scorer.Add("no-truth.png", Ramp(90)).ok());
  const absl::StatusOr<Scores> scores = scorer.Finish();
  ASSERT_TRUE(scores.ok()) << scores.status();
  ASSERT_EQ(scores->views.size(), 1u);
  EXPECT_EQ(scores->views[0].name, "a.png");
  EXPECT_NEAR(scores->psnr, -20 * std::log10(10.0 / 255), 1e-6);
  EXPECT_GT(scores->psnr_affine, 80);
}

TEST_F(EvaluationTest, NoTruthPhotoIsNotFound) {
  Scorer scorer(dir_ + "/truth");
  ASSERT_TRUE(scorer.Add("a.png", Ramp(0)).ok());
  const absl::Status status = scorer.Finish().status();
  EXPECT_TRUE(absl::IsNotFound(status));
  EXPECT_EQ(GetErrorDetail(status)->reason, "NO_TRUTH");
}

TEST_F(EvaluationTest, PhotosAreScoredAfterTheToneRule) {
  ASSERT_TRUE(WritePng(dir_ + "/photos/a.png", Ramp(-30)).ok());
  View view;
  view.name = "a.png";
  ReconstructOptions options;
  const ImageU8 target = MakePseudoTarget(Ramp(-30), options).value();
  double mean = 0;
  for (const uint8_t v : target.data) mean += v / (255.0 * target.data.size());
  EXPECT_NEAR(mean, options.theta, 0.01);

  ASSERT_TRUE(WritePng(dir_ + "/truth/a.png", target).ok());
  EXPECT_TRUE(std::isinf(ScorePhotos(dir_ + "/photos", {view}, dir_ + "/truth", options)->psnr));
  options.tone = Tone::kNone;
  EXPECT_LT(ScorePhotos(dir_ + "/photos", {view}, dir_ + "/truth", options)->psnr, 30);
}

}  // namespace
}  // namespace litags
