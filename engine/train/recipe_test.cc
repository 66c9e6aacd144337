#include "engine/train/recipe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/fields_test_util.h"

namespace litags {
namespace {

using Lines = std::vector<std::string>;

// "name=value" of `b` where it differs from `a`.
Lines Changes(const Recipe& a, const Recipe& b) {
  Lines before, after, changed;
  const auto lines = [](Lines* out) {
    return [out](const char* name, const auto& value, const FieldRule&) {
      out->push_back(absl::StrCat(name, "=", FieldText(value)));
    };
  };
  VisitFields(FieldsOf<Recipe>(), a, lines(&before));
  VisitFields(FieldsOf<Recipe>(), b, lines(&after));
  for (size_t i = 0; i < after.size(); ++i) {
    if (after[i] != before[i]) changed.push_back(after[i]);
  }
  return changed;
}

// A constant that is not listed would be resumed under another value.
TEST(Recipe, ListsEveryConstant) {
  size_t listed = 0;
  const Recipe recipe;
  VisitFields(FieldsOf<Recipe>(), recipe,
              [&](const char*, const auto&, const FieldRule&) { ++listed; });
  constexpr size_t kNested = 2;  // tone and pdm
  EXPECT_EQ(listed, CountMembers<Recipe>() - kNested + CountMembers<ToneOptions>() +
                        CountMembers<PdmOptions>());
}

TEST(Recipe, ThoseOfMethodsAreValid) {
  for (const Method method : {Method::kLitags, Method::kLitagsPaper, Method::k3dgs}) {
    EXPECT_TRUE(RecipeOf(method).Validate().ok()) << WordOf(method);
  }
}

TEST(Recipe, ValidateNamesTheFieldThatBreaksItsRule) {
  const auto field_of = [](auto change) {
    Recipe recipe;
    change(&recipe);
    const auto detail = GetErrorDetail(recipe.Validate());
    return detail.has_value() ? detail->field : "valid";
  };
  EXPECT_EQ(field_of([](Recipe* r) { r->sh_interval = 0; }), "sh_interval");
  EXPECT_EQ(field_of([](Recipe* r) { r->lr_means = std::nan(""); }), "lr_means");
  EXPECT_EQ(field_of([](Recipe* r) { r->weight_tv = -1; }), "weight_tv");
  EXPECT_EQ(field_of([](Recipe* r) { r->dropout = 0.95; }), "dropout");
  EXPECT_NE(field_of([](Recipe* r) { r->densify_every = 0; }), "valid");
  EXPECT_NE(field_of([](Recipe* r) { r->pdm.stages = 0; }), "valid");
}

// Paper, Sec. "Implementation Details".
TEST(Recipe, LitagsPaperIsThePapers) {
  const Recipe r = LitagsPaper();
  EXPECT_TRUE(r.lita && r.use_pdm && r.use_prior && r.use_depth && r.prior_geometry);
  EXPECT_EQ(r.tone.rule, Tone::kPaper);
  EXPECT_EQ(r.pdm.stages, 3);
  EXPECT_EQ(r.weight_prior, 0.1);
  EXPECT_EQ(r.weight_depth, 0.1);
  EXPECT_EQ(r.exposure_ssim, 0);
  EXPECT_EQ(r.coarse_levels, 0);
  EXPECT_EQ(r.densify_until, 5000);
  EXPECT_FALSE(r.depth_geometry || r.dense_start || r.noise_filter || r.antialiased ||
               r.information_weights);
  EXPECT_EQ(r.growth, Growth::kCloneSplit);
  EXPECT_EQ(r.dropout + r.lr_decay_epochs + r.max_scale + r.near_camera_pruning + r.densify_epochs,
            0);
}

TEST(Recipe, Plain3dgsLearnsThePhotosAsTheyAre) {
  const Recipe r = Plain3dgs();
  EXPECT_FALSE(r.lita);
  EXPECT_EQ(r.tone.rule, Tone::kNone);
  EXPECT_FALSE(r.use_depth || r.dense_start || r.noise_filter);
  EXPECT_EQ(r.growth, Growth::kCloneSplit);
}

TEST(Recipe, AblationsChangeWhatTheyAreNamedFor) {
  const Recipe ours = Litags(), paper = LitagsPaper();
  EXPECT_EQ(Changes(paper, WithoutPdm(paper)), Lines{"use_pdm=false"});
  EXPECT_EQ(Changes(paper, WithoutDepth(paper)), Lines{"use_depth=false"});
  EXPECT_EQ(Changes(paper, WithoutPrior(paper)), Lines{"use_prior=false"});
  EXPECT_EQ(Changes(ours, WithoutDepth(ours)), (Lines{"dense_start=false", "use_depth=false"}));
  EXPECT_EQ(Changes(ours, WithoutNoiseFilter(ours)), Lines{"noise_filter=false"});
  EXPECT_EQ(Changes(ours, WithPdm(ours)), Lines{"use_pdm=true"});
  EXPECT_EQ(Changes(ours, WithPriorGeometry(ours)), Lines{"prior_geometry=true"});
}

TEST(Recipe, ConstantsAreSetByName) {
  Recipe r = Litags();
  EXPECT_TRUE(SetField("lr_scales", "0.02", &r).ok());
  EXPECT_EQ(r.lr_scales, 0.02);
  EXPECT_TRUE(SetField("growth", "clone-split", &r).ok());
  EXPECT_EQ(r.growth, Growth::kCloneSplit);
  EXPECT_EQ(SetField("dropout", "0.95", &r).message(), "dropout: 0.95 is not in [0, 0.9]");
}

}  // namespace
}  // namespace litags
