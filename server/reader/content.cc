#include "server/reader/content.h"

#include "engine/core/error.h"
#include "engine/io/depth_io.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/transforms_io.h"
#include "engine/video/video_file.h"

namespace litags {

absl::StatusOr<PictureSize> CheckContent(std::string_view bytes, FileRole role,
                                         const std::string& field) {
  switch (role) {
    case FileRole::kPhoto: {
      LITAGS_ASSIGN_OR_RETURN(const ImageU8 image, DecodeImage(bytes, field));
      return PictureSize{image.width, image.height};
    }
    case FileRole::kMask: {
      LITAGS_ASSIGN_OR_RETURN(const PlaneU8 mask, DecodeMask(bytes, field));
      return PictureSize{mask.width, mask.height};
    }
    case FileRole::kCameras:
      LITAGS_RETURN_IF_ERROR(CheckTransforms(bytes, field));
      break;
    case FileRole::kDepth:
      LITAGS_RETURN_IF_ERROR(DecodeDepthMap(bytes, field).status());
      break;
    case FileRole::kVideo: {
      LITAGS_ASSIGN_OR_RETURN(const VideoInfo video, CheckVideo(bytes, field));
      return PictureSize{video.width, video.height};
    }
    case FileRole::kColmap:   // its three files make sense together only: checked by the engine
    case FileRole::kArchive:  // has files of its own
      break;
  }
  return PictureSize{};
}

}  // namespace litags
