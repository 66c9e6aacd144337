#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numeric>
#include <string>

#include "engine/core/error.h"
#include "engine/core/fields_test_util.h"
#include "engine/pipeline/capture_targets.h"

namespace litags {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Case {
  const char* field;
  std::function<void(ReconstructOptions*)> set;
};

TEST(ReconstructOptions, DefaultsAreValid) {
  const ReconstructOptions options;
  EXPECT_TRUE(options.Validate().ok()) << options.Validate();
}

TEST(ReconstructOptions, BadFieldsAreNamed) {
  using O = ReconstructOptions;
  const Case cases[] = {
      {"iterations", [](O* o) { o->iterations = 0; }},
      {"iterations", [](O* o) { o->iterations = 1'000'001; }},
      {"schedule_iterations", [](O* o) { o->schedule_iterations = -1; }},
      {"schedule_iterations", [](O* o) { o->schedule_iterations = 1'000'001; }},
      {"threads", [](O* o) { o->threads = -1; }},
      {"threads", [](O* o) { o->threads = 1025; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 999; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 20'000'001; }},
      {"sh_degree", [](O* o) { o->sh_degree = -1; }},
      {"sh_degree", [](O* o) { o->sh_degree = 4; }},
      {"max_image_side", [](O* o) { o->max_image_side = -1; }},
      {"max_image_side", [](O* o) { o->max_image_side = 63; }},
      {"frames", [](O* o) { o->frames = 2; }},
      {"frames", [](O* o) { o->frames = 2001; }},
      {"holdout_every", [](O* o) { o->holdout_every = -8; }},
      {"holdout_every", [](O* o) { o->holdout_every = 1; }},
      {"min_registered", [](O* o) { o->min_registered = 0; }},
      {"min_registered", [](O* o) { o->min_registered = 1.01; }},
      {"min_registered", [](O* o) { o->min_registered = kNan; }},
      {"checkpoint_every", [](O* o) { o->checkpoint_every = 0; }},
      {"preview_every", [](O* o) { o->preview_every = 0; }},
  };
  for (const auto& [field, set] : cases) {
    ReconstructOptions options;
    set(&options);
    const absl::Status status = options.Validate();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << field;
    const auto detail = GetErrorDetail(status);
    ASSERT_TRUE(detail.has_value()) << field << ": " << status;
    EXPECT_EQ(detail->reason, "BAD_OPTION");
    EXPECT_EQ(detail->field, std::string("options.") + field);
    EXPECT_EQ(std::string(status.message()).find(detail->field + ": "), 0u) << status;
  }
}

TEST(ReconstructOptions, LimitsThemselvesAreValid) {
  using O = ReconstructOptions;
  const Case cases[] = {
      {"iterations", [](O* o) { o->iterations = 1; }},
      {"iterations", [](O* o) { o->iterations = 1'000'000; }},
      {"threads", [](O* o) { o->threads = 1024; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 1000; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 20'000'000; }},
      {"sh_degree", [](O* o) { o->sh_degree = 0; }},
      {"max_image_side", [](O* o) { o->max_image_side = 64; }},
      {"holdout_every", [](O* o) { o->holdout_every = 0; }},
      {"holdout_every", [](O* o) { o->holdout_every = 2; }},
      {"min_registered", [](O* o) { o->min_registered = 1; }},
  };
  for (const auto& [field, set] : cases) {
    ReconstructOptions options;
    set(&options);
    EXPECT_TRUE(options.Validate().ok()) << field << ": " << options.Validate();
  }
}

// An option that is not listed would be lost on its way through the API and the store.
TEST(ReconstructOptions, ListsEveryOption) {
  size_t listed = 0;
  const ReconstructOptions options;
  VisitFields(FieldsOf<ReconstructOptions>(), options,
              [&](const char*, const auto&, const FieldRule& rule) {
                ++listed;
                EXPECT_STRNE(rule.help, "");
              });
  EXPECT_EQ(listed, CountMembers<ReconstructOptions>() - 1) << "all but the recipe";
}

TEST(ReconstructOptions, TheRecipeIsTheMethodsUnlessOneIsGiven) {
  ReconstructOptions options;
  EXPECT_EQ(FieldsText(options.ResolveRecipe()), FieldsText(Litags()));
  options.method = Method::kLitagsPaper;
  EXPECT_EQ(FieldsText(options.ResolveRecipe()), FieldsText(LitagsPaper()));
  options.tone = Tone::kNone;
  EXPECT_EQ(options.ResolveRecipe().tone.rule, Tone::kNone);
  options.recipe = WithPdm(Litags());
  options.tone.reset();
  EXPECT_EQ(FieldsText(options.ResolveRecipe()), FieldsText(WithPdm(Litags())));
  options.recipe->dropout = 2;
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "dropout");
}

TEST(Stage, HasAName) {
  EXPECT_EQ(StageName(Stage::kLoading), "loading");
  EXPECT_EQ(StageName(Stage::kFindingCameras), "finding-cameras");
  EXPECT_EQ(StageName(Stage::kPreparing), "preparing");
  EXPECT_EQ(StageName(Stage::kTraining), "training");
  EXPECT_EQ(StageName(Stage::kSaving), "saving");
}

TEST(PseudoTarget, IsThatOfTheTone) {
  ImageU8 photo(32, 16);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = static_cast<uint8_t>(5 + i % 20);
  ReconstructOptions options;
  options.tone = Tone::kPaper;
  const auto targets = MakePseudoTargets({PhotoFromU8(photo), PhotoFromU8(photo)}, options);
  ASSERT_TRUE(targets.ok()) << targets.status();
  ASSERT_EQ(targets->size(), 2u);
  const std::vector<uint8_t>& data = (*targets)[1].data;
  const double mean = std::accumulate(data.begin(), data.end(), 0.0) / data.size() / 255;
  EXPECT_NEAR(mean, 0.49, 0.5 / 255);
  for (const Photo& bad : {Photo(8, 8), Photo()}) {
    EXPECT_EQ(MakePseudoTargets({bad}, options).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
  options.tone = Tone::kNone;
  const auto same = MakePseudoTargets({PhotoFromU8(photo)}, options);
  ASSERT_TRUE(same.ok());
  EXPECT_EQ(same->front().data, photo.data);
}

}  // namespace
}  // namespace litags
