#include "engine/sfm/photo_set.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/core/shrunk_size.h"
#include "engine/io/image_io.h"
#include "engine/io/work_folder.h"

namespace litags {
namespace {

// Photos decoded to tell the light of a capture.
constexpr size_t kMeasuredPhotos = 32;

std::string FieldOf(const PhotoFile& photo) { return absl::StrCat("images[", photo.name, "]"); }

std::string PathOf(const std::string& dir, const PhotoFile& photo) {
  return absl::StrCat(dir, "/", photo.name);
}

// Body for every photo on several threads; the error of the first photo in order, if any.
absl::Status ForEach(size_t n, int threads, const CancelToken& cancel,
                     absl::FunctionRef<absl::Status(size_t i, int thread)> body) {
  std::vector<absl::Status> statuses(n);
  std::atomic<bool> failed = false;
  ParallelFor(threads, n, [&](size_t i, int thread) {
    if (failed) return;
    statuses[i] = cancel.Check();
    if (statuses[i].ok()) statuses[i] = body(i, thread);
    if (!statuses[i].ok()) failed = true;
  });
  for (absl::Status& status : statuses) LITAGS_RETURN_IF_ERROR(std::move(status));
  return absl::OkStatus();
}

// A lens says a little another focal length from photo to photo (autofocus, rounding): each of
// these becomes the least of those that it is near to. A zoom's steps are further apart.
std::map<double, double> SharedFocalLengths(const std::set<double>& given) {
  constexpr double kNearNext = 1.01, kNearAll = 1.05;
  std::map<double, double> shared;
  double least = 0, last = 0;
  for (const double focal : given) {
    if (!(focal <= kNearNext * last && focal <= kNearAll * least)) least = focal;
    shared[focal] = least;
    last = focal;
  }
  return shared;
}

// Sizes that differ by this at most, px, are of one lens: cut by hand, rounded by a program that
// changed their size, or to multiples of 8 by a codec. Choice
constexpr int kNearSize = 8;

bool AreNear(const PhotoFile& a, const PhotoFile& b) {
  return std::abs(a.width - b.width) <= kNearSize && std::abs(a.height - b.height) <= kNearSize;
}

// Sets what copies show: of photos near in size to the smallest of them, the part in the middle
// that all have.
void ShareSizes(std::vector<PhotoFile>& photos) {
  std::vector<PhotoFile*> by_size;
  for (PhotoFile& photo : photos) by_size.push_back(&photo);
  std::stable_sort(by_size.begin(), by_size.end(), [](const PhotoFile* a, const PhotoFile* b) {
    return std::pair(a->width, a->height) < std::pair(b->width, b->height);
  });
  while (!by_size.empty()) {
    const PhotoFile first = *by_size.front();
    const auto others = std::stable_partition(by_size.begin(), by_size.end(),
                                              [&](PhotoFile* p) { return AreNear(first, *p); });
    int least_height = first.height;
    for (auto it = by_size.begin(); it != others; ++it) {
      least_height = std::min(least_height, (*it)->height);
    }
    for (auto it = by_size.begin(); it != others; ++it) {
      PhotoFile& photo = **it;
      photo.shown = {(photo.width - first.width) / 2, (photo.height - least_height) / 2,
                     first.width, least_height};
    }
    by_size.erase(by_size.begin(), others);
  }
}

// Numbers the cameras of one size and focal length of which EXIF names two or more. Photos that
// name none are then of one more.
void TellCamerasApart(const std::vector<std::string>& exif_cameras,
                      std::vector<PhotoFile>& photos) {
  std::map<std::string, std::set<std::string>> named;  // by PhotoFile::camera
  for (size_t i = 0; i < photos.size(); ++i) {
    if (!exif_cameras[i].empty()) named[photos[i].camera].insert(exif_cameras[i]);
  }
  for (size_t i = 0; i < photos.size(); ++i) {
    const std::set<std::string>& cameras = named[photos[i].camera];
    if (cameras.size() < 2 || exif_cameras[i].empty()) continue;
    const auto number = std::distance(cameras.begin(), cameras.find(exif_cameras[i])) + 1;
    absl::StrAppend(&photos[i].camera, "_camera", number);
  }
}

}  // namespace

Camera CameraOfCopy(const Camera& of_photo, const PhotoFile& photo) {
  Camera shown = of_photo;
  shown.cx -= photo.shown.x;
  shown.cy -= photo.shown.y;
  shown.width = photo.shown.width;
  shown.height = photo.shown.height;
  return shown.Scaled(photo.copy_width, photo.copy_height);
}

Camera CameraOfPhoto(const Camera& of_copy, const PhotoFile& photo) {
  Camera camera = of_copy.Scaled(photo.shown.width, photo.shown.height);
  camera.cx += photo.shown.x;
  camera.cy += photo.shown.y;
  camera.width = photo.width;
  camera.height = photo.height;
  return camera;
}

absl::Status WriteScratch(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "work_dir",
                   absl::StrCat("cannot write \"", path, "\" (", bytes.size(),
                                " bytes); free some room on the disk"));
}

absl::StatusOr<std::vector<PhotoFile>> ListPhotoSet(const std::string& images_dir,
                                                    int max_image_side, const MaskPaths& masks,
                                                    const RigViews& rigs) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(images_dir, "images"));
  std::vector<PhotoFile> photos;
  photos.reserve(names.size());
  std::vector<double> focal_lengths, exif_focal_lengths;  // mm, px
  std::vector<std::string> exif_cameras;
  for (const std::string& name : names) {
    PhotoFile photo;
    photo.name = name;
    LITAGS_ASSIGN_OR_RETURN(const ImageInfo info,
                            ReadImageSize(PathOf(images_dir, photo), FieldOf(photo)));
    photo.width = info.width;
    photo.height = info.height;
    if (const auto mask = masks.find(name); mask != masks.end()) photo.mask_path = mask->second;
    focal_lengths.push_back(info.focal_length);
    exif_focal_lengths.push_back(ExifFocalLength(info));
    exif_cameras.push_back(info.camera);
    photos.push_back(std::move(photo));
  }
  ShareSizes(photos);
  const auto shared = SharedFocalLengths({focal_lengths.begin(), focal_lengths.end()});
  for (size_t i = 0; i < photos.size(); ++i) {
    PhotoFile& photo = photos[i];
    const PictureSize copy = ShrunkSize(photo.shown.width, photo.shown.height, max_image_side);
    photo.copy_width = copy.width;
    photo.copy_height = copy.height;
    // By the size before shrinking: two sizes may shrink to one without being one camera.
    photo.camera = absl::StrFormat("%dx%d", photo.shown.width, photo.shown.height);
    const double focal = shared.at(focal_lengths[i]);
    if (focal > 0) absl::StrAppendFormat(&photo.camera, "_%gmm", focal);
    if (const auto found = rigs.find(photo.name); found != rigs.end()) {
      const double known = found->second.focal_length;
      absl::StrAppendFormat(&photo.camera, "_%gpx", known);
      photo.copy_focal_length = known * photo.copy_width / photo.shown.width;
    } else {
      photo.copy_exif_focal_length = exif_focal_lengths[i] * photo.copy_width / photo.shown.width;
    }
  }
  TellCamerasApart(exif_cameras, photos);
  for (size_t i = 0; i < photos.size(); ++i) {
    photos[i].copy_name = absl::StrFormat("%s/%06d.png", photos[i].camera, i);
  }
  return photos;
}

absl::StatusOr<LightStats> MeasureCapture(const std::string& images_dir,
                                          const std::vector<PhotoFile>& photos, int threads,
                                          const CancelToken& cancel) {
  const size_t n = std::min(photos.size(), kMeasuredPhotos);
  if (n == 0) return LightStats{};
  std::vector<LightStats> stats(n);
  LITAGS_RETURN_IF_ERROR(ForEach(n, threads, cancel, [&](size_t i, int) -> absl::Status {
    const PhotoFile& photo = photos[i * photos.size() / n];
    LITAGS_ASSIGN_OR_RETURN(
        const MaskedPhoto read,
        ReadMaskedPhoto(PathOf(images_dir, photo), FieldOf(photo), photo.mask_path));
    stats[i] = MeasureLight(read.photo, read.mask);
    return absl::OkStatus();
  }));
  LightStats mean;
  for (const LightStats& s : stats) {
    mean.mean_level += s.mean_level / n;
    mean.clipped_fraction += s.clipped_fraction / n;
  }
  return mean;
}

absl::Status WriteCopies(const std::string& images_dir, const std::vector<PhotoFile>& photos,
                         Preparation preparation, const std::string& copies_dir,
                         const std::string& masks_dir, int threads, const CancelToken& cancel,
                         const std::function<void(double)>& progress) {
  std::set<std::string> folders;
  for (const PhotoFile& photo : photos) folders.insert(photo.camera);
  for (const std::string& folder : folders) {
    for (const std::string& dir : {copies_dir, masks_dir}) {
      LITAGS_RETURN_IF_ERROR(MakeFolder(absl::StrCat(dir, "/", folder)));
    }
  }
  std::atomic<size_t> done = 0;
  return ForEach(photos.size(), threads, cancel, [&](size_t i, int thread) -> absl::Status {
    const PhotoFile& photo = photos[i];
    LITAGS_ASSIGN_OR_RETURN(MaskedPhoto read, ReadMaskedPhoto(PathOf(images_dir, photo),
                                                              FieldOf(photo), photo.mask_path));
    const auto copy = [&](const auto& image) {
      const int width = photo.copy_width, height = photo.copy_height;
      const bool whole = photo.shown.width == image.width && photo.shown.height == image.height;
      if (whole) return ResizeArea(image, width, height);
      return ResizeArea(Cut(image, photo.shown), width, height);
    };
    const Photo image = copy(read.photo);
    if (!read.mask.empty()) {
      read.mask = ChangeMask(read.mask, copy);
      LITAGS_ASSIGN_OR_RETURN(const std::string mask, EncodeMask(read.mask));
      LITAGS_RETURN_IF_ERROR(
          WriteScratch(absl::StrCat(masks_dir, "/", photo.copy_name, ".png"), mask));
    }
    LITAGS_ASSIGN_OR_RETURN(const std::string png,
                            EncodePng(Prepare(image, preparation, read.mask)));
    LITAGS_RETURN_IF_ERROR(WriteScratch(absl::StrCat(copies_dir, "/", photo.copy_name), png));
    ++done;
    if (thread == 0) progress(static_cast<double>(done) / photos.size());
    return absl::OkStatus();
  });
}

}  // namespace litags
