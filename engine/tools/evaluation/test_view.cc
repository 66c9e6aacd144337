#include "engine/tools/evaluation/test_view.h"

#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/shrunk_size.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/given_cameras.h"

namespace litags {

std::vector<std::string> NamesOf(const std::vector<View>& views) {
  std::vector<std::string> names;
  for (const View& view : views) names.push_back(view.name);
  return names;
}

std::vector<std::string> NamesOf(const std::vector<TestView>& views) {
  std::vector<std::string> names;
  for (const TestView& view : views) names.push_back(view.view.name);
  return names;
}

absl::StatusOr<std::string> FindPhoto(const std::string& dir, const std::string& name) {
  const std::vector<std::string> photos =
      ListPhotos(dir, "photos").value_or(std::vector<std::string>());
  if (const auto found = NameIndex(photos).Find(name))
    return absl::StrCat(dir, "/", photos[*found]);
  return MakeError(absl::StatusCode::kNotFound, "NO_SUCH_PHOTO", name,
                   absl::StrCat("there is no photo called ", name, " in \"", dir, "\""));
}

absl::StatusOr<Photo> LoadPhoto(const std::string& dir, const TestView& view) {
  LITAGS_ASSIGN_OR_RETURN(const std::string path, FindPhoto(dir, view.view.name));
  LITAGS_ASSIGN_OR_RETURN(Photo photo, ReadPhoto(path, absl::StrCat("photo[", path, "]")));
  const Camera& camera = view.view.camera;
  if (camera.width == 0) return photo;
  if (photo.width != camera.width || photo.height != camera.height) {
    // A narrow picture's shape changes where its size is rounded.
    const double height = double(photo.height) * camera.width / photo.width;
    if (!SameShape(camera, photo.width, photo.height) && std::abs(height - camera.height) > 1) {
      return InvalidInput(
          "SIZE_MISMATCH", view.view.name,
          absl::StrCat(path, " is ", photo.width, "x", photo.height, ", what it is compared with ",
                       camera.width, "x", camera.height, ", of another shape; turn or cut one"));
    }
    photo = ResizeArea(photo, camera.width, camera.height);
  }
  if (view.distortion.IsZero()) return photo;
  LITAGS_ASSIGN_OR_RETURN(photo, Undistort(photo, camera, view.distortion));
  // As training fills what the photo does not show.
  LITAGS_ASSIGN_OR_RETURN(const PlaneU8 rim, MaskOfUndistorted(camera, view.distortion));
  if (!rim.empty()) FillMasked(rim, &photo);
  return photo;
}

absl::StatusOr<ImageU8> LoadPicture(const std::string& dir, const TestView& view) {
  LITAGS_ASSIGN_OR_RETURN(const Photo photo, LoadPhoto(dir, view));
  return PhotoToU8(photo);
}

absl::Status FitToPhotoIn(const std::string& dir, bool has_own_size, TestView* view) {
  const std::string& name = view->view.name;
  const absl::StatusOr<std::string> path = FindPhoto(dir, name);
  if (!path.ok()) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageSize(*path, *path));
  return FitToPhoto(name, info, has_own_size, &view->view.camera, &view->distortion).status();
}

absl::StatusOr<std::vector<TestView>> AtSizeOfPhotos(std::vector<TestView> views,
                                                     const std::string& dir) {
  for (TestView& view : views) {
    const std::string& name = view.view.name;
    LITAGS_ASSIGN_OR_RETURN(const std::string path, FindPhoto(dir, name));
    LITAGS_ASSIGN_OR_RETURN(ImageInfo info, ReadImageSize(path, path));
    info.orientation = 1;  // the views are upright
    LITAGS_RETURN_IF_ERROR(
        FitToPhoto(name, info, /*has_own_size=*/true, &view.view.camera, &view.distortion)
            .status());
  }
  return views;
}

std::vector<TestView> AtMost(int max_side, std::vector<TestView> views) {
  for (TestView& view : views) {
    Camera& camera = view.view.camera;
    const PictureSize size = ShrunkSize(camera.width, camera.height, max_side);
    camera = camera.Scaled(size.width, size.height);
  }
  return views;
}

}  // namespace litags
