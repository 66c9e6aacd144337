#include "engine/tools/evaluation/benchmark_scene.h"

#include <filesystem>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/held_out.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr char kPoses[] = "--render-poses";
constexpr char kTestViews[] = "/transforms_test.json";

bool IsThere(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

// For files of cameras that state no size; 0x0 without photos.
ImageInfo SizeOfFirstPhoto(const std::string& dir) {
  const auto photos = ListPhotos(dir, "photos");
  if (!photos.ok()) return {};
  return ReadImageSize(dir + "/" + photos->front(), "photos").value_or(ImageInfo());
}

}  // namespace

std::vector<std::string> UnscoredViews::Notes(size_t scored) const {
  std::vector<std::string> notes;
  if (!trained_on.empty()) {
    notes.push_back(absl::StrCat("test views that were trained on are not scored: ",
                                 absl::StrJoin(trained_on, ", ")));
  }
  const size_t all = scored + trained_on.size() + without_camera.size();
  if (!without_camera.empty()) {
    notes.push_back(absl::StrCat(without_camera.size(), " of ", all,
                                 " test views have no camera in this scene and are not scored: ",
                                 absl::StrJoin(without_camera, ", ")));
  }
  if (scored == 0 && all > 0) notes.emplace_back("no test view is left: nothing is scored");
  return notes;
}

std::string BenchmarkScene::PhotosDir() const { return light.empty() ? dir : dir + "/" + light; }

std::string BenchmarkScene::TruthDir() const {
  if (!truth.empty()) return truth;
  const std::string high = dir + "/high";
  return IsThere(high) ? high : std::string();
}

std::string BenchmarkScene::DepthDir() const { return sfm ? std::string() : dir + "/depth"; }

absl::StatusOr<ReconstructInput> BenchmarkScene::Input(const std::string& work_dir,
                                                       ReconstructOptions* options) const {
  ReconstructInput input;
  input.images_dir = PhotosDir();
  input.work_dir = work_dir;
  input.cameras_path = cameras;
  const std::string train = dir + "/transforms_train.json";
  const bool has_train = !light.empty() && IsThere(train);
  if (!poses.empty() && (sfm || (cameras.empty() && !has_train))) {
    return InvalidInput("POSES_WITHOUT_CAMERAS", kPoses,
                        absl::StrCat(kPoses, ": the cameras of the photos must be known too, in ",
                                     "the same world; name them with --cameras"));
  }
  if (sfm || (light.empty() && poses.empty())) return input;
  if (cameras.empty() && has_train) {
    input.cameras_path = train;
    options->holdout_every = 0;
  }
  if (input.cameras_path.empty()) {
    if (!HasTestViews()) return input;
    return InvalidInput("POSES_WITHOUT_CAMERAS", "--cameras",
                        absl::StrCat(dir, " has transforms_test.json, but no ",
                                     "transforms_train.json: COLMAP's cameras would be in another ",
                                     "world than the test views; name cameras in theirs with ",
                                     "--cameras, or let litags-train take all from COLMAP: --sfm"));
  }
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> test, TestViews());
  if (test.empty()) return input;
  options->holdout_every = 0;
  // Poses without truth are only rendered: they may be those of photos.
  if (!poses.empty() && TruthDir().empty()) return input;
  const char* field = cameras.empty() ? "transforms_train.json" : "--cameras";
  // Only names are looked at: any size will do.
  const auto size_of = [](const std::string&) { return PhotoSize{kMaxImageSide, kMaxImageSide}; };
  PanoramaNames panoramas;
  LITAGS_ASSIGN_OR_RETURN(const SparseModel model, ReadCameras(ResolveCameras(input.cameras_path),
                                                               field, size_of, &panoramas));
  const NameIndex index(NamesOf(test));
  for (const View& view : model.views) {
    if (!index.Find(view.name).has_value()) continue;
    return InvalidInput("TEST_VIEW_IN_CAMERAS", field,
                        absl::StrCat(input.cameras_path, " has ", view.name, ", a test view of ",
                                     dir, ": it would be trained on; take it out of the cameras"));
  }
  return input;
}

bool BenchmarkScene::HasTestViews() const {
  return !poses.empty() || ((!light.empty() || sfm) && IsThere(dir + kTestViews));
}

absl::StatusOr<std::vector<TestView>> BenchmarkScene::TestViews() const {
  std::vector<TestView> views;
  if (!HasTestViews()) return views;
  const std::string path = poses.empty() ? dir + kTestViews : poses;
  const std::string photos = TruthDir().empty() ? PhotosDir() : TruthDir();
  const ImageInfo first = SizeOfFirstPhoto(photos);
  // Paths of views whose size the file does not say, and of those where its points tell it.
  std::set<std::string> unsized, sure;
  const auto size_of = [&](const std::string& name) {
    unsized.insert(name);
    const auto photo = FindPhoto(photos, name);
    const ImageInfo size = photo.ok() ? ReadImageSize(*photo, name).value_or(first) : first;
    return PhotoSize{size.width, size.height};
  };
  LITAGS_ASSIGN_OR_RETURN(
      SparseModel given,
      ReadCameras(ResolveCameras(path), poses.empty() ? "transforms_test.json" : kPoses, size_of,
                  nullptr, &sure));
  for (const std::string& name : sure) unsized.erase(name);
  for (size_t i = 0; i < given.views.size(); ++i) {
    TestView view{given.views[i], given.distortions[i]};
    if (!sfm) {  // else they are not used
      const std::string& name = given.paths.empty() ? view.view.name : given.paths[i];
      LITAGS_RETURN_IF_ERROR(FitToPhotoIn(TruthDir(), !unsized.contains(name), &view));
    }
    views.push_back(std::move(view));
  }
  return views;
}

absl::StatusOr<std::vector<TestView>> BenchmarkScene::TestViews(const Scene& scene,
                                                                const std::string& work_dir,
                                                                int holdout_every,
                                                                UnscoredViews* unscored) const {
  LITAGS_ASSIGN_OR_RETURN(std::vector<TestView> given, TestViews());
  if (!sfm || given.empty()) return given;
  LITAGS_ASSIGN_OR_RETURN(const SparseModel found, ReadCameras(work_dir + "/cameras", "cameras"));
  const NameIndex trained(NamesOf(scene.views())), cameras(NamesOf(found.views));
  std::vector<TestView> views;
  UnscoredViews others;
  for (const TestView& wanted : given) {
    const std::string& name = wanted.view.name;
    const auto view = trained.Find(name), camera = cameras.Find(name);
    if (!view || !camera) {
      others.without_camera.push_back(name);
    } else if (!IsHeldOut(*view, scene.views().size(), holdout_every)) {
      others.trained_on.push_back(name);
    } else {
      views.push_back({scene.views()[*view], found.distortions[*camera]});
    }
  }
  if (unscored != nullptr) *unscored = std::move(others);
  return views;
}

}  // namespace litags
