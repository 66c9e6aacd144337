#include "server/reader/content.h"

#include <vector>

#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/colmap_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/pipeline/photo_look.h"
#include "engine/pipeline/wide_photos.h"
#include "engine/video/video_file.h"
#include "server/reader/file_findings.h"

namespace litags {

namespace {

absl::StatusOr<Content> CheckPhoto(std::string_view bytes, const std::string& field) {
  LITAGS_ASSIGN_OR_RETURN(const Photo photo, DecodePhoto(bytes, field));
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageInfo(bytes, field));
  const ScreenedPhoto look = LookAt("", photo);
  const PhotoFindings findings{info.focal_length,
                               info.exposure_time,
                               info.iso,
                               info.f_number,
                               look.mean_code,
                               look.light,
                               look.structure,
                               look.sharpness,
                               look.detail.fine,
                               look.detail.coarse,
                               double(StatesViews(bytes, photo.width, photo.height)),
                               look.pixels};
  return Content{photo.width, photo.height, Encode(findings)};
}

// The photo of a map that says nothing trains without one.
absl::StatusOr<Content> CheckDepth(std::string_view bytes, const std::string& field) {
  const absl::Status read = DecodeDepthMap(bytes, field).status();
  if (!read.ok() && GetErrorDetail(read)->reason != "NOT_FINITE") return read;
  LITAGS_ASSIGN_OR_RETURN(const DepthSize size, ParseDepthSize(bytes, field));
  return Content{size.width, size.height, ""};
}

Content OfCameras(const std::vector<std::string>& paths) {
  if (paths.empty()) return {};
  return {0, 0, Encode(CameraFindings::Of(paths))};
}

}  // namespace

absl::StatusOr<Content> CheckContent(std::string_view bytes, FileRole role, const std::string& name,
                                     const std::string& field) {
  switch (role) {
    case FileRole::kPhoto:
      return CheckPhoto(bytes, field);
    case FileRole::kMask: {
      LITAGS_ASSIGN_OR_RETURN(const PlaneU8 mask, DecodeMask(bytes, field));
      return Content{mask.width, mask.height, ""};
    }
    case FileRole::kCameras: {
      LITAGS_ASSIGN_OR_RETURN(const auto paths, CheckCameras(bytes, field));
      return OfCameras(paths);
    }
    case FileRole::kDepth:
      return CheckDepth(bytes, field);
    case FileRole::kVideo: {
      LITAGS_ASSIGN_OR_RETURN(const VideoInfo video, CheckVideo(bytes, field));
      const VideoFindings findings{video.seconds, static_cast<double>(video.frames)};
      return Content{video.width, video.height, Encode(findings)};
    }
    case FileRole::kColmap: {
      LITAGS_ASSIGN_OR_RETURN(const auto paths, CheckColmapFile(name, bytes, field));
      return OfCameras(paths);
    }
    case FileRole::kArchive:  // has files of its own
      break;
  }
  return Content{};
}

}  // namespace litags
