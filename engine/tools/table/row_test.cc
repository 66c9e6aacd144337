#include "engine/tools/table/row.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/tools/table/scene.h"

namespace litags {
namespace {

TableRow Row(const std::string& scene, const std::string& method, double psnr) {
  TableRow row;
  row.scene = scene;
  row.light = "low";
  row.method = method;
  row.psnr = psnr;
  row.ssim = psnr / 100;
  row.psnr_affine = psnr + 1;
  row.seconds = 2.5;
  row.iterations = 30;
  row.gaussians = 1000;
  row.peak_rss_bytes = int64_t{3} << 20;
  row.views = 2;
  return row;
}

std::vector<TableMethod> Methods(const std::vector<std::string>& names) {
  std::vector<TableMethod> methods;
  for (const std::string& name : names) {
    methods.push_back(ParseMethod(name, ReconstructOptions(), {"gain"}).value());
  }
  return methods;
}

TEST(TableRow, ComesBackFromJson) {
  TableRow row = Row("fox", "litags", 25.5);
  row.lpips = 0.25;
  row.flicker = 0.0125;
  row.flicker_share = 0.75;
  row.path_contrast = 0.2;
  const auto back = ParseTableRow(row.ToJson(), "row");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->ToJson(), row.ToJson());
  EXPECT_EQ(back->flicker, 0.0125);
  row.error = "no such, \"photo\"";
  const auto failed = ParseTableRow(row.ToJson(), "row");
  ASSERT_TRUE(failed.ok()) << failed.status();
  EXPECT_FALSE(failed->ok());
  EXPECT_TRUE(nlohmann::json::parse(row.ToJson())["psnr"].is_null());
  EXPECT_EQ(Reason(ParseTableRow("{\"scene\": 3}", "row").status()), "ROW_CORRUPT");
}

TEST(TableCsv, QuotesWhatWouldBreakALine) {
  TableRow failed = Row("fox", "litags", 0);
  failed.error = "said \"no\", twice";
  const std::string csv = TableCsv({Row("fox", "3dgs", 7.5), failed});
  EXPECT_EQ(csv.rfind("scene,light,method,psnr,ssim,lpips,psnr_affine,seconds,", 0), 0u) << csv;
  EXPECT_NE(csv.find("fox,low,3dgs,7.5,0.075,,8.5,2.5,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\"said \"\"no\"\", twice\""), std::string::npos) << csv;
}

TEST(TableMarkdown, HasMeansOverScenesAndMarksTheBestButNotTheReference) {
  const std::string text =
      TableMarkdown({Row("a", "3dgs-normal", 30), Row("b", "3dgs-normal", 32), Row("a", "3dgs", 7),
                     Row("b", "3dgs", 9), Row("a", "litags", 20), Row("b", "litags", 25)},
                    Methods({"3dgs-normal", "3dgs", "litags"}), "# T");
  EXPECT_NE(text.find("| 3dgs-normal | 30.00 | 0.300 | 32.00 | 0.320 | 31.00 | 0.310 |"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("| litags | **20.00** | **0.200** | **25.00** | **0.250** | **22.50** |"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("3DGS on normally lit photos, for reference"), std::string::npos) << text;
  EXPECT_NE(text.find("no network given"), std::string::npos);
}

TEST(TableMarkdown, ScenesWithoutTruthAreNamedAndHaveNoFigures) {
  TableRow blind = Row("b", "litags", 0);
  blind.psnr = blind.ssim = blind.psnr_affine = std::nullopt;
  blind.views = 0;
  const auto back = ParseTableRow(blind.ToJson(), "row");
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_TRUE(back->ok());
  EXPECT_FALSE(back->scored());
  EXPECT_EQ(back->seconds, 2.5);
  const auto text = [](const std::vector<TableRow>& rows) {
    return TableMarkdown(rows, Methods({"litags"}), "# T");
  };
  // The mean is that of the scenes with a truth; what a method costs is that of all.
  const std::string both = text({Row("a", "litags", 20), blind});
  EXPECT_NE(both.find("| a PSNR↑ | a SSIM↑ | mean PSNR↑ | mean SSIM↑ |"), std::string::npos)
      << both;
  EXPECT_NE(both.find("| **20.00** | **0.200** | **20.00** | **0.200** |"), std::string::npos);
  EXPECT_NE(both.find("| litags | 21.00 | 2.5 |"), std::string::npos) << both;
  EXPECT_NE(both.find("no figures: b. "), std::string::npos) << both;
  const std::string none = text({blind});
  EXPECT_EQ(none.find("PSNR↑"), std::string::npos) << none;
  EXPECT_NE(none.find("| litags | – | 2.5 |"), std::string::npos) << none;
}

TEST(TableMarkdown, ARenderThatEqualsItsTruthTakesNoOtherFiguresAway) {
  TableRow equal = Row("a", "litags", std::numeric_limits<double>::infinity());
  equal.ssim = 0.75;
  equal = ParseTableRow(equal.ToJson(), "row").value();
  EXPECT_TRUE(equal.scored());
  EXPECT_EQ(equal.PsnrText(), "infinite");
  const TableRow other = Row("a", "3dgs", 20);
  EXPECT_EQ(other.PsnrText(), "20.00");
  const std::string text = TableMarkdown({other, equal}, Methods({"3dgs", "litags"}), "# T");
  EXPECT_NE(text.find("| 3dgs | **20.00** | 0.200 |"), std::string::npos) << text;
  EXPECT_NE(text.find("| litags | – | **0.750** |"), std::string::npos) << text;
  EXPECT_EQ(text.find("no figures"), std::string::npos) << text;
}

TEST(TableMarkdown, ShowsFlickerWhereItWasMeasured) {
  TableRow row = Row("a", "litags", 20);
  EXPECT_EQ(TableMarkdown({row}, Methods({"litags"}), "# T").find("flicker"), std::string::npos);
  row.flicker = 0.0125;
  row.path_contrast = 0.25;
  const std::string text = TableMarkdown({row}, Methods({"litags"}), "# T");
  EXPECT_NE(text.find("| flicker x 1000 | flicker / contrast, % |"), std::string::npos) << text;
  EXPECT_NE(text.find("| 12.50 | 5.00 |"), std::string::npos) << text;
}

TEST(TableMarkdown, NamesTheRowsThatOtherBuildsMade) {
  std::vector<TableRow> rows = {Row("a", "3dgs", 7), Row("a", "litags", 20),
                                Row("b", "litags", 21)};
  for (TableRow& row : rows) row.build = "new";
  const auto text = [&] { return TableMarkdown(rows, Methods({"3dgs", "litags"}), "# T"); };
  EXPECT_EQ(text().find("other programs"), std::string::npos) << text();
  rows[0].build = "old";
  EXPECT_NE(text().find("## Made by other programs"), std::string::npos) << text();
  EXPECT_NE(text().find("- build old: a low 3dgs\n"), std::string::npos) << text();
  EXPECT_EQ(text().find("- build new"), std::string::npos) << text();
}

TEST(TableMarkdown, AMeanOverFewerScenesIsNotShown) {
  TableRow failed = Row("b", "litags", 0);
  failed.error = "too dark";
  const std::string text =
      TableMarkdown({Row("a", "litags", 20), failed}, Methods({"litags"}), "# T");
  EXPECT_NE(text.find("| litags | **20.00** | **0.200** | – | – | – | – |"), std::string::npos)
      << text;
  EXPECT_NE(text.find("- b low litags: too dark"), std::string::npos) << text;
  // Nor is that of a method whose turn has not come in the second scene.
  const std::string unfinished =
      TableMarkdown({Row("a", "3dgs", 7), Row("a", "litags", 20), Row("b", "3dgs", 9)},
                    Methods({"3dgs", "litags"}), "# T");
  EXPECT_NE(unfinished.find("| litags | **20.00** | **0.200** | – | – | – | – |"),
            std::string::npos)
      << unfinished;
}

TEST(ParseMethod, TheNameDecidesWhatIsTrainedOnWhat) {
  ReconstructOptions base;
  base.iterations = 77;
  const std::vector<std::string> enhancers = {"gain", "mine"};
  const std::vector<std::string> names = AllMethods(enhancers);
  ASSERT_GT(names.size(), enhancers.size());
  for (const std::string& name : names) {
    const auto method = ParseMethod(name, base, enhancers);
    ASSERT_TRUE(method.ok()) << method.status();
    EXPECT_EQ(method->options.iterations, 77) << name;
  }
  const auto of = [&](const char* name) { return ParseMethod(name, base, enhancers).value(); };
  EXPECT_EQ(of("3dgs").options.method, Method::k3dgs);
  EXPECT_EQ(of("mine+3dgs").before, "mine");
  EXPECT_EQ(of("mine+3dgs").trained_as, "mine+3dgs");
  EXPECT_EQ(of("3dgs+mine").after, "mine");
  EXPECT_EQ(of("3dgs+mine").trained_as, "3dgs");
  EXPECT_TRUE(of("3dgs-normal").normal_light);
  EXPECT_EQ(of("litags-paper").options.method, Method::kLitagsPaper);
  EXPECT_FALSE(of("litags-paper").options.recipe.has_value());
  EXPECT_EQ(Reason(ParseMethod("other+3dgs", base, enhancers).status()), "UNKNOWN_METHOD");
}

TEST(ParseMethod, AnAblationIsTheRecipeWithThatChange) {
  const auto text = [](const std::string& name) {
    return FieldsText(ParseMethod(name, ReconstructOptions(), {}).value().options.ResolveRecipe());
  };
  const Recipe ours = Litags(), paper = LitagsPaper();
  EXPECT_EQ(text("litags"), FieldsText(ours));
  EXPECT_EQ(text("litags-no-noise-filter"), FieldsText(WithoutNoiseFilter(ours)));
  EXPECT_EQ(text("litags-no-depth"), FieldsText(WithoutDepth(ours)));
  EXPECT_EQ(text("litags-no-noise-filter-depth"),
            FieldsText(WithoutNoiseFilter(WithoutDepth(ours))));
  EXPECT_EQ(text("litags-with-pdm"), FieldsText(WithPdm(ours)));
  EXPECT_EQ(text("litags-prior-geometry"), FieldsText(WithPriorGeometry(ours)));
  EXPECT_EQ(text("litags-paper"), FieldsText(paper));
  EXPECT_EQ(text("litags-paper-no-pdm"), FieldsText(WithoutPdm(paper)));
  EXPECT_EQ(text("litags-paper-no-depth"), FieldsText(WithoutDepth(paper)));
  EXPECT_EQ(text("litags-paper-no-prior"), FieldsText(WithoutPrior(paper)));
  EXPECT_EQ(text("litags-paper-none"), FieldsText(WithoutPdm(WithoutDepth(WithoutPrior(paper)))));
  EXPECT_EQ(text("3dgs"), FieldsText(Plain3dgs()));
}

TEST(ParseMethod, SetConstantsDoNotUndoWhatTheNameSays) {
  const auto of = [](const char* name) {
    return ParseMethod(name, ReconstructOptions(), {}, {"noise_filter=true", "use_pdm=true"})
        .value()
        .options.ResolveRecipe();
  };
  EXPECT_TRUE(of("litags").noise_filter);
  EXPECT_FALSE(of("litags-no-noise-filter").noise_filter);
  for (const char* name : {"litags", "litags-no-noise-filter", "litags-paper", "3dgs"}) {
    EXPECT_TRUE(of(name).use_pdm) << name;
  }
  EXPECT_FALSE(of("litags-paper-no-pdm").use_pdm);
  EXPECT_EQ(Reason(ParseMethod("litags-no-depth", ReconstructOptions(), {}, {"no"}).status()),
            "BAD_OPTION");
}

TEST(ParseMethod, NamesThatSaidAnotherThingAreGone) {
  for (const char* name : {"litags-no-pdm", "litags-no-prior", "litags-no-pdm-depth-prior"}) {
    EXPECT_EQ(Reason(ParseMethod(name, ReconstructOptions(), {}).status()), "UNKNOWN_METHOD");
  }
}

TEST(FindScenes, AFolderOfScenesIsAllOfThem) {
  TempDir dir;
  for (const char* scene : {"LOM/shrub", "LOM/bike", "LOM/notes", "else/bike"}) {
    std::filesystem::create_directories(dir / scene);
    if (std::string(scene) == "LOM/notes") continue;
    ASSERT_TRUE(
        WriteFileAtomically(dir / (std::string(scene) + "/transforms_test.json"), "{}").ok());
  }
  const auto scenes = FindScenes({dir / "LOM/"}, "");
  ASSERT_TRUE(scenes.ok()) << scenes.status();
  ASSERT_EQ(scenes->size(), 2u);
  EXPECT_EQ(scenes->at(0).name, "bike");
  EXPECT_EQ(scenes->at(1).name, "shrub");
  EXPECT_EQ(FindScenes({dir / "LOM/bike/"}, "")->at(0).name, "bike");
  EXPECT_EQ(Reason(FindScenes({dir / "LOM/notes"}, "").status()), "NO_SUCH_SCENE");
  EXPECT_EQ(Reason(FindScenes({dir / std::string(300, 'x')}, "").status()), "NO_SUCH_SCENE");
  EXPECT_EQ(Reason(FindScenes({dir / "LOM", dir / "else"}, "").status()), "DUPLICATE_SCENE");
}

}  // namespace
}  // namespace litags
