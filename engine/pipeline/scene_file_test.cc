#include "engine/pipeline/scene_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/container.h"
#include "engine/io/file_util.h"
#include "engine/io/ply.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/model_scene.h"
#include "engine/pipeline/scene_test_util.h"

namespace litags {
namespace {

using Json = nlohmann::json;

TEST(SceneFile, ComesBackAsItWas) {
  const TempDir dir;
  const Model model = SmallModel();
  const std::vector<View> views = RingViews(5);
  ASSERT_TRUE(SaveScene(dir / "a.litags", model, views).ok());
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();

  EXPECT_EQ((*scene)->num_gaussians(), 37);
  EXPECT_EQ((*scene)->iteration(), 1234);
  EXPECT_TRUE(FullPly(**scene, dir / "a.ply") == EncodePly(model.splats, /*lita_attributes=*/true));
  ASSERT_EQ((*scene)->views().size(), views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const View& read = (*scene)->views()[i];
    EXPECT_EQ(read.name, views[i].name);
    // JSON numbers are written with all their digits.
    EXPECT_EQ(read.camera.Viewmat(), views[i].camera.Viewmat());
    EXPECT_EQ(read.camera.width, kWidth);
    EXPECT_EQ(read.camera.height, kHeight);
    EXPECT_EQ(read.camera.fx, views[i].camera.fx);
    EXPECT_EQ(read.camera.fy, views[i].camera.fy);
    EXPECT_EQ(read.camera.cx, views[i].camera.cx);
    EXPECT_EQ(read.camera.cy, views[i].camera.cy);
  }

  // Everything a picture depends on, the denoiser, the noise filter and the curve included.
  const auto before = RenderChannel(*MakeScene(model, views), Channel::kColor);
  const auto after = RenderChannel(**scene, Channel::kColor);
  ASSERT_TRUE(before.ok() && after.ok());
  EXPECT_EQ(before->data, after->data);
  Model without_pdm = model, without_filter = model, without_curve = model, dilated = model;
  without_pdm.use_pdm = false;
  without_filter.noise.reset();
  without_curve.curve.reset();
  dilated.pixel_filter = PixelFilter::kDilate;
  for (const Model& other : {without_pdm, without_filter, without_curve, dilated}) {
    const auto picture = RenderChannel(*MakeScene(other, views), Channel::kColor);
    ASSERT_TRUE(picture.ok());
    EXPECT_NE(picture->data, after->data) << "what does nothing was not tested";
  }
}

TEST(SceneFile, PicturesOfScenesWithoutCurvesAreAsTheyWereDrawn) {
  const TempDir dir;
  Model model = SmallModel();
  model.noise.reset();
  model.curve.reset();
  ASSERT_TRUE(SaveScene(dir / "a.litags", model, RingViews(5)).ok());
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  const auto before = RenderChannel(*MakeScene(model, RingViews(5)), Channel::kColor);
  const auto after = RenderChannel(**scene, Channel::kColor);
  ASSERT_TRUE(before.ok() && after.ok());
  EXPECT_EQ(before->data, after->data);
}

TEST(SceneFile, SavingTwiceGivesTheSameBytes) {
  const TempDir dir;
  ASSERT_TRUE(SaveScene(dir / "a.litags", SmallModel(), RingViews(3)).ok());
  ASSERT_TRUE(SaveScene(dir / "b.litags", SmallModel(), RingViews(3)).ok());
  EXPECT_TRUE(Bytes(dir / "a.litags") == Bytes(dir / "b.litags"));
}

TEST(SceneFile, ASceneThatWasLoadedIsSavedAsItWas) {
  const TempDir dir;
  Model model = SmallModel();
  model.origin = {1000, 2000, 3000};
  ASSERT_TRUE(SaveScene(dir / "a.litags", model, RingViews(3)).ok());
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  ASSERT_TRUE((*scene)->Save(dir / "b.litags").ok());
  EXPECT_TRUE(Bytes(dir / "a.litags") == Bytes(dir / "b.litags"));
}

TEST(SceneFile, PlainScenesComeBackWithoutADenoiser) {
  const TempDir dir;
  ASSERT_TRUE(SaveScene(dir / "a.litags", SmallModel(/*lita=*/false), RingViews(3)).ok());
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(Reason((*scene)->ExportFullPly(dir / "a.ply")), "CHANNEL_UNAVAILABLE");
}

TEST(SceneFile, NamesThatAreNotUtf8AreKept) {
  const TempDir dir;
  std::vector<View> views = RingViews(1);
  views[0].name = "caf\xE9.png";
  ASSERT_TRUE(SaveScene(dir / "a.litags", SmallModel(), views).ok());
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->views()[0].name, "caf\xE9.png");
}

TEST(SceneFile, AnOriginComesBack) {
  const TempDir dir;
  Model model = SmallModel();
  ASSERT_TRUE(SaveScene(dir / "near.litags", model, RingViews(5)).ok());
  model.origin = {5e5, 4.6e6, 0.1};
  ASSERT_TRUE(SaveScene(dir / "far.litags", model, RingViews(5)).ok());
  const auto near = LoadSceneFile(dir / "near.litags"), far = LoadSceneFile(dir / "far.litags");
  ASSERT_TRUE(near.ok() && far.ok()) << far.status();
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR((*far)->views()[2].camera.Center()[k],
                (*near)->views()[2].camera.Center()[k] + model.origin[k], 1e-8);
  }
  // Programs before origins draw what has none.
  const auto version = [&](const char* name) {
    return Container::Read(dir / name, "scene", 1, 3)->version();
  };
  EXPECT_EQ(version("near.litags"), 2);
  EXPECT_EQ(version("far.litags"), 3);
  EXPECT_EQ(FullPly(**far, dir / "a.ply"),
            EncodePly(model.splats, /*lita_attributes=*/true, model.origin));
}

TEST(SceneFile, ANearPlaneComesBack) {
  const TempDir dir;
  Model model = SmallModel();
  model.near_plane = 0.01f;
  ASSERT_TRUE(SaveScene(dir / "a.litags", model, RingViews(3)).ok());
  EXPECT_EQ(Container::Read(dir / "a.litags", "scene", 1, 4)->version(), 4);
  const auto scene = LoadSceneFile(dir / "a.litags");
  ASSERT_TRUE(scene.ok()) << scene.status();
  // Before the first camera, nearer than 3DGS draws anything.
  RenderRequest request;
  request.camera = (*scene)->views()[0].camera;
  const auto z = request.camera.CamFromWorld(
      {model.splats.at(0, kMean), model.splats.at(0, kMean + 1), model.splats.at(0, kMean + 2)});
  for (int k = 0; k < 3; ++k) request.camera.t[k] -= z[k] - (k == 2 ? 0.1 : 0);
  request.channel = Channel::kDepth;
  const auto drawn = (*scene)->Render(request);
  model.near_plane = RenderSettings().near_plane;
  const auto cut = MakeScene(model, RingViews(3))->Render(request);
  ASSERT_TRUE(drawn.ok() && cut.ok());
  EXPECT_NE(drawn->data, cut->data);
}

// Cameras that look the same way tell a distance by how far they are apart only.
TEST(SceneFile, TheFrameOfParallelCamerasIsInTheirUnit) {
  const auto frame_of = [](double unit) {
    std::vector<View> views(3);
    for (int i = 0; i < 3; ++i) {
      views[i].camera.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
      views[i].camera.t = {-unit * i, 0, 0};
    }
    return FrameOfViews(views);
  };
  const SceneFrame one = frame_of(1);
  EXPECT_NEAR(one.center[0], 1, 1e-9);
  EXPECT_NEAR(one.center[2], 1, 1e-9);
  for (const double unit : {1e-12, 0.01, 100.0}) {
    const SceneFrame frame = frame_of(unit);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(frame.center[k] / unit, one.center[k], 1e-9) << unit;
    EXPECT_NEAR(frame.radius / unit, one.radius, 1e-9) << unit;
  }
  EXPECT_EQ(frame_of(0).radius, 1);
}

TEST(SceneFile, NumbersThatAreNotFiniteAreNotSaved) {
  const TempDir dir;
  for (const int row : {int{kMean}, int{kShDc}, kShRest + 44, int{kIllumination}}) {
    Model model = SmallModel();
    model.splats.at(36, row) = std::nanf("");
    const absl::Status status = SaveScene(dir / "a.litags", model, RingViews(1));
    EXPECT_EQ(Reason(status), "NOT_FINITE") << row;
    EXPECT_NE(status.message().find("Gaussian 36"), absl::string_view::npos) << status;
  }
  Model model = SmallModel();
  model.pdm.nets[1].back() = INFINITY;
  EXPECT_EQ(Reason(SaveScene(dir / "a.litags", model, RingViews(1))), "NOT_FINITE");
}

TEST(SceneFile, ForeignAndTruncatedFilesAreRefused) {
  const TempDir dir;
  EXPECT_EQ(LoadSceneFile(dir / "none.litags").status().code(), absl::StatusCode::kNotFound);

  ASSERT_TRUE(WriteFileAtomically(dir / "foreign", "ply\nformat ascii 1.0\n").ok());
  const absl::Status foreign = LoadSceneFile(dir / "foreign").status();
  EXPECT_EQ(foreign.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Reason(foreign), "NOT_A_CONTAINER");

  ContainerWriter other("checkpoint", 1);
  other.AddSection("meta", "{}");
  ASSERT_TRUE(other.Commit(dir / "other").ok());
  EXPECT_EQ(Reason(LoadSceneFile(dir / "other").status()), "WRONG_CONTAINER_KIND");

  ContainerWriter newer("scene", 5);
  ASSERT_TRUE(newer.Commit(dir / "newer").ok());
  EXPECT_EQ(Reason(LoadSceneFile(dir / "newer").status()), "CONTAINER_TOO_NEW");

  ASSERT_TRUE(SaveScene(dir / "a.litags", SmallModel(), RingViews(3)).ok());
  const std::string whole = Bytes(dir / "a.litags");
  for (const size_t size : {whole.size() - 1, whole.size() / 2, size_t{100}, size_t{12}}) {
    ASSERT_TRUE(WriteFileAtomically(dir / "cut", whole.substr(0, size)).ok());
    const absl::Status cut = LoadSceneFile(dir / "cut").status();
    EXPECT_EQ(cut.code(), absl::StatusCode::kDataLoss) << size << ": " << cut;
    EXPECT_EQ(Reason(cut), "CONTAINER_TRUNCATED") << size;
  }
  std::string flipped = whole;
  flipped[whole.size() - 5] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(dir / "flipped", flipped).ok());
  EXPECT_EQ(Reason(LoadSceneFile(dir / "flipped").status()), "CONTAINER_CORRUPT");
}

// What LoadSceneFile says to a scene whose sections were changed and then sealed again, so that
// checksums hold.
class ChangedScene : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(SaveScene(dir_ / "a.litags", SmallModel(), RingViews(3)).ok());
  }

  absl::Status Load(const std::function<void(Json* meta, std::string* splats)>& change,
                    const std::string& left_out = "", uint32_t version = 2) {
    const auto file = Container::Read(dir_ / "a.litags", "scene", 1, 2);
    if (!file.ok()) return file.status();
    Json meta = Json::parse(*file->Section("meta"));
    std::string splats(*file->Section("splats"));
    change(&meta, &splats);
    ContainerWriter out("scene", version);
    for (const std::string& name : file->SectionNames()) {
      if (name == left_out) continue;
      out.AddSection(name, name == "meta"     ? meta.dump()
                           : name == "splats" ? splats
                                              : std::string(*file->Section(name)));
    }
    if (const absl::Status s = out.Commit(dir_ / "b.litags"); !s.ok()) return s;
    return LoadSceneFile(dir_ / "b.litags").status();
  }

  const TempDir dir_;
};

TEST_F(ChangedScene, LoadsIfNothingChanged) {
  const absl::Status status = Load([](Json*, std::string*) {});
  EXPECT_TRUE(status.ok()) << status;
}

// Version 1 says nothing of pixel filters.
TEST_F(ChangedScene, OfTheFirstVersionLooksAsItDid) {
  const auto forget = [](Json* meta, std::string*) { meta->erase("antialiased"); };
  EXPECT_EQ(Reason(Load(forget)), "SCENE_CORRUPT");
  ASSERT_TRUE(Load(forget, "", 1).ok());
  Model model = SmallModel();
  model.pixel_filter = PixelFilter::kDilate;
  const auto before = RenderChannel(*MakeScene(model, RingViews(3)), Channel::kColor);
  const auto after = RenderChannel(**LoadSceneFile(dir_ / "b.litags"), Channel::kColor);
  ASSERT_TRUE(before.ok() && after.ok());
  EXPECT_EQ(before->data, after->data);
}

TEST_F(ChangedScene, IsCorruptIfItsPartsDoNotFit) {
  const struct {
    const char* what;
    std::function<void(Json*, std::string*)> change;
  } cases[] = {
      {"one block too many", [](Json* m, std::string*) { (*m)["gaussians"] = 49; }},
      {"one block too few", [](Json* m, std::string*) { (*m)["gaussians"] = 32; }},
      {"all the memory there is", [](Json* m, std::string*) { (*m)["gaussians"] = ~uint64_t{0}; }},
      {"a negative number", [](Json* m, std::string*) { (*m)["gaussians"] = -1; }},
      {"no number", [](Json* m, std::string*) { m->erase("gaussians"); }},
      {"a text for a number", [](Json* m, std::string*) { (*m)["gaussians"] = "37"; }},
      {"a size beyond every integer",
       [](Json* m, std::string*) {
         (*m)["views"][1]["size"] = {64, 6.4e49};
       }},
      {"half an iteration", [](Json* m, std::string*) { (*m)["iteration"] = 0.5; }},
      {"half a Gaussian more", [](Json*, std::string* s) { s->append(100, '\0'); }},
      {"a Gaussian cut short", [](Json*, std::string* s) { s->resize(s->size() - 4); }},
      {"a colour that is not a number",
       [](Json*, std::string* s) {
         const float nan = std::nanf("");
         std::memcpy(&(*s)[sizeof(float) * (kSplatBlock * (kShDc + 1) + 5)], &nan, sizeof(nan));
       }},
      {"an infinite SH coefficient",
       [](Json*, std::string* s) {
         const float infinity = INFINITY;
         std::memcpy(&(*s)[sizeof(float) * kSplatBlock * (kShRest + 9)], &infinity, 4);
       }},
      {"a view without a name",
       [](Json* m, std::string*) { (*m)["views"].push_back((*m)["views"][0]); }},
      {"a name without a view", [](Json* m, std::string*) { (*m)["views"].erase(0); }},
      {"an SH degree of 4", [](Json* m, std::string*) { (*m)["sh_degree"] = 4; }},
      {"an SH degree of -1", [](Json* m, std::string*) { (*m)["sh_degree"] = -1; }},
      {"a camera without size",
       [](Json* m, std::string*) {
         (*m)["views"][1]["size"] = {0, 24};
       }},
      {"a camera that is no rotation",
       [](Json* m, std::string*) { (*m)["views"][1]["viewmat"][0] = 7; }},
      {"a camera matrix of 15 numbers",
       [](Json* m, std::string*) { (*m)["views"][1]["viewmat"].erase(0); }},
      {"views that are no list", [](Json* m, std::string*) { (*m)["views"] = 3; }},
      {"a wider denoiser", [](Json* m, std::string*) { (*m)["pdm"]["hidden"] = 5; }},
      {"an impossible denoiser", [](Json* m, std::string*) { (*m)["pdm"]["hidden"] = 0; }},
      {"a short noise curve", [](Json* m, std::string*) { (*m)["noise"].erase(0); }},
      {"a noise curve of words", [](Json* m, std::string*) { (*m)["noise"][7] = "much"; }},
      {"a denoiser of one net", [](Json* m, std::string*) { (*m)["pdm"]["nets"] = 1; }},
      {"another number of nets", [](Json* m, std::string*) { (*m)["pdm"]["shared"] = true; }},
  };
  for (const auto& [what, change] : cases) {
    const absl::Status status = Load(change);
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << what << ": " << status;
    EXPECT_EQ(Reason(status), "SCENE_CORRUPT") << what << ": " << status;
  }
}

TEST_F(ChangedScene, IsRefusedIfASectionIsMissing) {
  for (const char* section : {"meta", "splats", "pdm1"}) {
    const absl::Status status = Load([](Json*, std::string*) {}, section);
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << section << ": " << status;
    EXPECT_EQ(Reason(status), "SECTION_MISSING") << section;
  }
}

}  // namespace
}  // namespace litags
