#include "engine/pipeline/given_cameras.h"

#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/pipeline/photo_place.h"

namespace litags {
namespace {

std::string NameInMessage(std::string_view name) { return absl::StrCat("'", Absl(name), "'"); }

// The view of each photo: names that are the same go first, so that a camera whose own photo is
// missing takes no other's.
absl::StatusOr<std::map<size_t, size_t>> ViewsOfPhotos(const SparseModel& model,
                                                       const std::vector<std::string>& photos) {
  const NameIndex index(photos);
  std::map<size_t, size_t> view_of;
  const auto add = [&](size_t photo, size_t view) -> absl::Status {
    const auto [first, added] = view_of.emplace(photo, view);
    if (added) return absl::OkStatus();
    const std::string& path = model.PathOf(view);
    return InvalidInput("DUPLICATE_CAMERA", "cameras",
                        absl::StrCat("cameras: photo ", photos[photo], " may have the camera of ",
                                     model.PathOf(first->second), " or of ", path,
                                     "; keep one, or name the photos of several folders with them, "
                                     "as ",
                                     NamesInOneFolder(path).front()));
  };
  std::vector<size_t> others;
  for (size_t i = 0; i < model.views.size(); ++i) {
    if (const auto photo = index.FindExact(model.PathOf(i))) {
      LITAGS_RETURN_IF_ERROR(add(*photo, i));
    } else {
      others.push_back(i);
    }
  }
  std::set<size_t> taken;
  for (const auto& [photo, view] : view_of) taken.insert(photo);
  for (const size_t i : others) {
    std::vector<size_t> meant = index.FindAlike(model.PathOf(i));
    std::erase_if(meant, [&](size_t photo) { return taken.contains(photo); });
    if (meant.empty()) continue;
    if (meant.size() > 1) {
      return InvalidInput("CAMERA_AMBIGUOUS", "cameras",
                          absl::StrCat("cameras: ", NameInMessage(model.PathOf(i)), " may be ",
                                       photos[meant[0]], " or ", photos[meant[1]],
                                       "; name photos with their endings, or rename one"));
    }
    LITAGS_RETURN_IF_ERROR(add(meant[0], i));
  }
  return view_of;
}

// Renames the views to the photos they belong to, puts them in the photos' order and drops views
// without a photo, with their marks in tracks. `panoramas`, if not null, are renamed with them.
absl::StatusOr<SparseModel> MatchPhotos(SparseModel model, const std::vector<std::string>& photos,
                                        PanoramaNames* panoramas) {
  LITAGS_ASSIGN_OR_RETURN(const auto view_of, ViewsOfPhotos(model, photos));
  PanoramaNames renamed;
  SparseModel out;
  std::vector<int> new_index(model.views.size(), -1);
  for (const auto& [photo, i] : view_of) {
    new_index[i] = static_cast<int>(out.views.size());
    out.views.push_back({photos[photo], model.views[i].camera});
    if (panoramas != nullptr && panoramas->contains(model.views[i].name)) {
      renamed.insert(photos[photo]);
    }
    out.distortions.push_back(model.distortions[i]);
  }
  out.points = std::move(model.points);
  for (SparsePoint& point : out.points) {
    std::erase_if(point.track, [&](const TrackElement& e) { return new_index[e.view] < 0; });
    for (TrackElement& e : point.track) e.view = new_index[e.view];
  }
  if (panoramas != nullptr) *panoramas = std::move(renamed);
  return out;
}

// What a photo's camera becomes when the photo is turned by 90 degrees, clockwise.
void TurnClockwise(Camera* camera, Distortion* distortion) {
  Camera& c = *camera;
  const Camera before = c;
  c.width = before.height;
  c.height = before.width;
  c.fx = before.fy;
  c.fy = before.fx;
  c.cx = before.height - before.cy;
  c.cy = before.cx;
  // x and y of the camera's frame become -y and x.
  for (int i = 0; i < 3; ++i) {
    c.R[i] = -before.R[3 + i];
    c.R[3 + i] = before.R[i];
  }
  c.t[0] = -before.t[1];
  c.t[1] = before.t[0];
  // (p2, p1) is a direction in the picture.
  const double p1 = distortion->p1;
  distortion->p1 = distortion->p2;
  distortion->p2 = -p1;
}

// Turns a camera that is of the photo as stored upright, and returns by how many turns clockwise.
absl::StatusOr<int> TurnUpright(const std::string& name, const ImageInfo& photo, bool has_own_size,
                                Camera* camera, Distortion* distortion) {
  if (photo.orientation == 1) return 0;
  const bool swaps = photo.orientation >= 5;
  const bool upright = SameShape(*camera, photo.width, photo.height);
  const bool stored = swaps ? SameShape(*camera, photo.height, photo.width) : upright;
  if (!stored && !(upright && !has_own_size)) return 0;
  const bool turned = photo.orientation == 6 || photo.orientation == 8;  // not mirrored, too
  if (upright || !turned) {
    return InvalidInput(
        "ORIENTATION_AMBIGUOUS", absl::StrCat("images[", name, "]"),
        absl::StrCat(name, ": its EXIF orientation, ", photo.orientation,
                     ", turns the photo, and its camera may be of the photo before or after; if "
                     "the cameras are COLMAP's, which ignores it, take it out of the photos "
                     "(exiftool -Orientation= DIR), else turn their pixels (mogrify -auto-orient "
                     "DIR/*)"));
  }
  const int turns = photo.orientation == 6 ? 1 : 3;
  for (int i = 0; i < turns; ++i) TurnClockwise(camera, distortion);
  return turns;
}

// What becomes of the marks of points in a view: TurnClockwise, then another scale.
struct MarkChange {
  int turns = 0;
  int width = 0, height = 0;  // of the picture that they are in before
  std::array<double, 2> scale = {1, 1};
};

// `changes`: of each view.
void ChangeTracks(const std::vector<MarkChange>& changes, std::vector<SparsePoint>* points) {
  for (SparsePoint& point : *points) {
    for (TrackElement& e : point.track) {
      const MarkChange& change = changes[e.view];
      for (int turn = 0; turn < change.turns; ++turn) {
        e = {e.view, (turn % 2 == 0 ? change.height : change.width) - e.y, e.x};
      }
      e.x *= change.scale[0];
      e.y *= change.scale[1];
    }
  }
}

// Photos of given cameras come with a size; it may be given for another resolution of the photos.
// `unsized`: photos whose size their cameras have. `panoramas`: may be null.
absl::Status FitToPhotos(const ReconstructInput& input, const std::set<std::string>& unsized,
                         const PanoramaNames* panoramas, SparseModel* model,
                         std::vector<std::string>* notes) {
  int turned = 0, scaled = 0;
  std::string some_scaled;
  std::vector<MarkChange> changes(model->views.size());
  for (size_t i = 0; i < model->views.size(); ++i) {
    View& view = model->views[i];
    const std::string field = absl::StrCat("images[", view.name, "]");
    LITAGS_ASSIGN_OR_RETURN(ImageInfo info, ReadImageSize(PhotoPath(input, view.name), field));
    if (input.cameras_are_upright) info.orientation = 1;
    const Camera given = view.camera;
    int width = view.camera.width, height = view.camera.height;
    MarkChange& change = changes[i];
    change.width = width;
    change.height = height;
    LITAGS_ASSIGN_OR_RETURN(change.turns, FitToPhoto(view.name, info, !unsized.contains(view.name),
                                                     &view.camera, &model->distortions[i]));
    if (panoramas == nullptr || !panoramas->contains(view.name)) {
      LITAGS_RETURN_IF_ERROR(CheckIntrinsics(given, absl::StrCat("cameras[", view.name, "]")));
    }
    if (change.turns % 2 == 1) std::swap(width, height);
    turned += change.turns > 0;
    if (info.width == width && info.height == height) continue;
    if (++scaled == 1) {
      some_scaled = absl::StrCat(width, "x", height, " px for ", view.name, " of ", info.width, "x",
                                 info.height);
    }
    change.scale = {double(info.width) / width, double(info.height) / height};
  }
  if (turned + scaled > 0) ChangeTracks(changes, &model->points);
  if (scaled > 0) {
    notes->push_back(absl::StrCat(scaled, " of ", model->views.size(),
                                  " cameras are of photos of another size, such as ", some_scaled,
                                  ", and were scaled: if they are of undistorted or cut photos, "
                                  "give those"));
  }
  if (turned > 0) {
    notes->push_back(absl::StrCat(turned, " of ", model->views.size(),
                                  " cameras are of photos as stored; they were turned upright with "
                                  "them, as EXIF has it"));
  }
  return absl::OkStatus();
}

}  // namespace

bool SameShape(const Camera& camera, int width, int height) {
  return std::abs(double(width) * camera.height / (double(height) * camera.width) - 1) <= 0.02;
}

absl::StatusOr<int> FitToPhoto(const std::string& name, const ImageInfo& photo, bool has_own_size,
                               Camera* camera, Distortion* distortion) {
  LITAGS_ASSIGN_OR_RETURN(const int turns,
                          TurnUpright(name, photo, has_own_size, camera, distortion));
  if (!SameShape(*camera, photo.width, photo.height)) {
    return InvalidInput("CAMERA_SIZE_MISMATCH", absl::StrCat("images[", name, "]"),
                        absl::StrCat(name, ": the photo is ", photo.width, "x", photo.height,
                                     " but its camera says ", camera->width, "x", camera->height,
                                     "; give cameras of these photos"));
  }
  *camera = camera->Scaled(photo.width, photo.height);
  return turns;
}

absl::Status NoMatchingCameras(size_t photos, std::string_view photo, std::string_view path) {
  return InvalidInput(
      "NO_MATCHING_CAMERAS", "cameras",
      absl::StrCat(
          "cameras: none of the ", photos,
          " photos has a camera; the paths of the cameras' photos must end in the names of "
          "yours, as ",
          NameInMessage(photo), ", and one is ", NameInMessage(path)));
}

absl::StatusOr<SparseModel> ReadGivenCameras(const ReconstructInput& input,
                                             const std::vector<std::string>& photos,
                                             std::vector<std::string>* notes,
                                             PanoramaNames* panoramas) {
  const NameIndex index(photos);
  std::set<std::string> unsized, sure;
  std::map<size_t, PhotoSize> known;  // a file may name a photo many times
  const auto size_of = [&](const std::string& name) {
    const std::optional<size_t> found = index.Find(name);
    // Of a photo that is not there: any, nothing is made of it. A large one shows all points.
    if (!found.has_value()) return PhotoSize{kMaxImageSide, kMaxImageSide};
    const auto [entry, is_new] = known.try_emplace(*found);
    PhotoSize& size = entry->second;
    if (!is_new) return size;
    const std::string& photo = photos[*found];
    unsized.insert(photo);
    const auto info = ReadImageSize(input.images_dir + "/" + photo, photo);
    if (info.ok()) size = {info->width, info->height};
    return size;
  };
  LITAGS_ASSIGN_OR_RETURN(SparseModel given,
                          ReadCameras(input.cameras_path, "cameras", size_of, panoramas, &sure));
  for (const std::string& name : sure) {
    if (const auto found = index.Find(name)) unsized.erase(photos[*found]);
  }
  const std::string some_camera = given.PathOf(0);
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, MatchPhotos(std::move(given), photos, panoramas));
  if (model.views.empty()) return NoMatchingCameras(photos.size(), photos[0], some_camera);
  LITAGS_RETURN_IF_ERROR(FitToPhotos(input, unsized, panoramas, &model, notes));
  return model;
}

}  // namespace litags
