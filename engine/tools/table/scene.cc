#include "engine/tools/table/scene.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/camera_source.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "engine/tools/inspect/dataset_folder.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr char kTrain[] = "transforms_train.json", kTest[] = "transforms_test.json";

bool IsScene(const fs::path& dir) {
  std::error_code ignored;
  return fs::exists(dir / kTest, ignored) || fs::exists(dir / kTrain, ignored);
}

// "LOM_full/buu/" and "." have names too.
std::string NameOf(const fs::path& dir) {
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(dir, ignored);
  return whole.filename().string();
}

absl::Status Missing(const std::string& dir, const std::string& what) {
  return MakeError(absl::StatusCode::kNotFound, "NO_SUCH_SCENE", dir,
                   absl::StrCat(dir, ": ", what));
}

// Copies them into `dir`, by their photos' names; without any there is no such folder.
absl::Status KeepMasks(const MaskPaths& masks, const std::string& dir) {
  std::error_code ignored;  // writing reports what matters
  fs::remove_all(dir, ignored);
  if (!masks.empty()) fs::create_directories(dir, ignored);
  for (const auto& [photo, path] : masks) {
    LITAGS_ASSIGN_OR_RETURN(const std::string png, ReadFile(path, path, ImageLimits().max_bytes));
    LITAGS_RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(dir, "/", photo, ".png"), png));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<TestView>> TableScene::TestViews() const {
  const BenchmarkScene scene{.dir = dir, .light = "high", .cameras = ""};
  LITAGS_ASSIGN_OR_RETURN(std::vector<TestView> views, scene.TestViews());
  if (views.empty()) return Missing(dir, absl::StrCat("has no ", kTest));
  if (sparse.empty()) return views;

  const Camera& first = views[0].view.camera;
  std::set<std::string> unsized;  // views whose size the file does not say
  const auto size_of = [&](const std::string& name) {
    unsized.insert(name);
    return PhotoSize{first.width, first.height};
  };
  LITAGS_ASSIGN_OR_RETURN(const SparseModel model,
                          ReadCameras(absl::StrCat(dir, "/", sparse), "--sparse", size_of));
  const NameIndex index(NamesOf(model.views));
  for (TestView& view : views) {
    const auto same = index.Find(view.view.name);
    if (!same.has_value()) {
      return Missing(dir, absl::StrCat(sparse, " has no camera of test view ", view.view.name));
    }
    ImageInfo size;
    size.width = view.view.camera.width;
    size.height = view.view.camera.height;
    view.distortion = model.distortions[*same];
    view.view.camera = model.views[*same].camera;
    LITAGS_RETURN_IF_ERROR(
        FitToPhotoIn(TruthDir(), !unsized.contains(model.views[*same].name), &view));
    // Those without a truth photo.
    LITAGS_RETURN_IF_ERROR(
        FitToPhoto(view.view.name, size, /*has_own_size=*/true, &view.view.camera, &view.distortion)
            .status());
  }
  return views;
}

absl::StatusOr<std::vector<std::string>> TableScene::TrainingPhotos(
    const std::string& light) const {
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> photos, ListPhotos(PhotosDir(light), "photos"));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> test, TestViews());
  const NameIndex held_out(NamesOf(test));
  std::erase_if(photos, [&](const std::string& photo) { return held_out.Find(photo).has_value(); });
  if (photos.empty()) return Missing(PhotosDir(light), "every photo is a test view");
  return photos;
}

absl::StatusOr<std::string> TableScene::PrepareCameras(const std::string& light,
                                                       const ReconstructOptions& options,
                                                       const std::string& colmap,
                                                       const std::string& work_dir) const {
  ReconstructInput input;
  input.images_dir = PhotosDir(light);
  input.cameras_path = absl::StrCat(dir, "/", sparse.empty() ? kTrain : sparse);
  input.work_dir = work_dir;
  std::error_code error;  // reading says what is wrong
  if (!fs::exists(input.cameras_path, error) && !error) {
    return Missing(input.cameras_path, "no such cameras; name a file or folder with --sparse");
  }
  UseMasksBeside(input.images_dir, &input.masks_dir);
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(work_dir, ignored);
  LITAGS_ASSIGN_OR_RETURN(PhotoList list, ListPhotosAndMasks(input));
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> photos, TrainingPhotos(light));
  std::erase_if(photos, [&](const std::string& photo) {  // masks among them
    return !std::binary_search(list.names.begin(), list.names.end(), photo);
  });
  std::erase_if(list.masks, [&](const auto& mask) {
    return !std::binary_search(photos.begin(), photos.end(), mask.first);
  });
  LITAGS_RETURN_IF_ERROR(KeepMasks(list.masks, work_dir + "/masks"));
  ReconstructReport report;
  const CancelToken never;
  const Context context(
      input, options, never, [](Stage, const std::string&) {}, &report);
  LITAGS_RETURN_IF_ERROR(ObtainCameras(context, photos, list.masks, colmap).status());
  return absl::StrCat(work_dir, "/cameras");
}

absl::StatusOr<std::vector<TableScene>> FindScenes(const std::vector<std::string>& dirs,
                                                   const std::string& sparse) {
  std::vector<TableScene> scenes;
  for (const std::string& dir : dirs) {
    std::vector<std::string> found;
    if (IsScene(dir)) {
      found.push_back(dir);
    } else {
      std::error_code error;
      for (fs::directory_iterator it(dir, error), end; it != end; it.increment(error)) {
        std::error_code ignored;
        if (it->is_directory(ignored) && IsScene(it->path())) found.push_back(it->path());
      }
      if (error == std::errc::permission_denied) {
        return MakeError(absl::StatusCode::kPermissionDenied, "NO_PERMISSION", dir,
                         absl::StrCat("cannot list the folder '", dir, "': ", error.message(),
                                      "; check its permissions"));
      }
      std::sort(found.begin(), found.end());
    }
    if (found.empty()) {
      return Missing(dir, absl::StrCat("is neither a scene (with ", kTrain, " and ", kTest,
                                       ") nor a folder of scenes"));
    }
    for (const std::string& scene : found) scenes.push_back({NameOf(scene), scene, sparse});
  }
  std::set<std::string> names;
  for (const TableScene& scene : scenes) {
    if (!names.insert(scene.name).second) {
      return InvalidInput("DUPLICATE_SCENE", scene.dir,
                          absl::StrCat(scene.dir, ": another scene is called ", scene.name,
                                       " too; rename a folder or run two tables"));
    }
  }
  return scenes;
}

}  // namespace litags
