#include "engine/tools/evaluation/test_view.h"

#include <filesystem>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"

namespace litags {

absl::StatusOr<std::string> FindPhoto(const std::string& dir, const std::string& name) {
  const std::string path = absl::StrCat(dir, "/", name);
  if (!dir.empty() && std::filesystem::is_regular_file(path)) return path;
  const absl::StatusOr<std::vector<std::string>> photos = ListPhotos(dir, "photos");
  for (const std::string& photo : photos.value_or(std::vector<std::string>())) {
    if (Stem(photo) == Stem(name)) return absl::StrCat(dir, "/", photo);
  }
  return MakeError(absl::StatusCode::kNotFound, "NO_SUCH_PHOTO", name,
                   absl::StrCat("there is no photo called ", name, " in \"", dir, "\""));
}

absl::StatusOr<ImageU8> LoadPhoto(const std::string& dir, const TestView& view) {
  LITAGS_ASSIGN_OR_RETURN(const std::string path, FindPhoto(dir, view.view.name));
  LITAGS_ASSIGN_OR_RETURN(ImageU8 photo, ReadImage(path, absl::StrCat("photo[", path, "]")));
  const Camera& camera = view.view.camera;
  if (camera.width == 0) return photo;
  if (photo.width != camera.width || photo.height != camera.height) {
    photo = ResizeArea(photo, camera.width, camera.height);
  }
  if (view.distortion.IsZero()) return photo;
  return Undistort(photo, camera, view.distortion);
}

absl::StatusOr<std::vector<TestView>> AtSizeOfPhotos(std::vector<TestView> views,
                                                     const std::string& dir) {
  for (TestView& view : views) {
    const TestView of_any_size = {.view = {view.view.name, Camera()}, .distortion = {}};
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 photo, LoadPhoto(dir, of_any_size));
    view.view.camera = view.view.camera.Scaled(photo.width, photo.height);
  }
  return views;
}

}  // namespace litags
