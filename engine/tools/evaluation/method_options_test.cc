#include "engine/tools/evaluation/method_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "engine/core/error.h"

namespace litags {
namespace {

// The options that a command line gives.
ReconstructOptions Parsed(const std::string& arguments) {
  ReconstructOptions options;
  std::vector<std::string> set;
  CLI::App app;
  AddMethodOptions(&app, &options, &set);
  app.parse(arguments);
  EXPECT_TRUE(SetConstants(set, &options).ok());
  return options;
}

TEST(MethodOptions, TheMethodDecidesWhatTheOthersLeaveOpen) {
  const ReconstructOptions paper = Parsed("--tone capture --iterations 7 --method litags-paper");
  EXPECT_EQ(paper.iterations, 7);
  EXPECT_EQ(paper.ResolveRecipe().tone.rule, Tone::kCapture);
  EXPECT_TRUE(paper.ResolveRecipe().use_pdm);
  EXPECT_EQ(Parsed("--method litags-paper").ResolveRecipe().tone.rule, Tone::kPaper);
  EXPECT_EQ(Parsed("--method 3dgs").ResolveRecipe().tone.rule, Tone::kNone);
  EXPECT_EQ(Parsed("").method, Method::kLitags);
}

TEST(MethodOptions, OptionsThatAProgramDoesNotUseAreNotThere) {
  ReconstructOptions options;
  std::vector<std::string> set;
  CLI::App app;
  AddMethodOptions(&app, &options, &set, {"preview_every"});
  EXPECT_THROW(app.parse("--preview-every 3"), CLI::ExtrasError);
  app.parse("--iterations 7");
  EXPECT_EQ(options.iterations, 7);
}

TEST(MethodOptions, ConstantsOfTheRecipeAreSetByName) {
  const ReconstructOptions options =
      Parsed("--set dropout=0.1 --method litags-paper --set growth=long-axis");
  EXPECT_EQ(options.ResolveRecipe().dropout, 0.1);
  EXPECT_EQ(options.ResolveRecipe().growth, Growth::kLongAxis);
  EXPECT_EQ(options.ResolveRecipe().weight_depth, LitagsPaper().weight_depth);
  ReconstructOptions unchanged;
  EXPECT_EQ(GetErrorDetail(SetConstants({"dropout"}, &unchanged))->reason, "BAD_OPTION");
  EXPECT_EQ(GetErrorDetail(SetConstants({"drop=1"}, &unchanged))->reason, "BAD_OPTION");
  EXPECT_FALSE(unchanged.recipe.has_value());
}

TEST(MethodOptions, AWrongWordIsAnsweredWithTheRightOnes) {
  try {
    Parsed("--method 4dgs");
    FAIL() << "4dgs is no method";
  } catch (const CLI::ValidationError& error) {
    EXPECT_STREQ(error.what(), "--method: \"4dgs\" is not one of: litags, litags-paper, 3dgs");
  }
  ReconstructOptions options;
  std::vector<std::string> set;
  CLI::App app;
  AddMethodOptions(&app, &options, &set);
  const std::string help = app.help();
  EXPECT_THAT(help, testing::HasSubstr("--white-balance TEXT=scene"));
  EXPECT_THAT(help, testing::HasSubstr("--max-image-side INT=1600"));
}

}  // namespace
}  // namespace litags
