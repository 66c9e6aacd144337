#ifndef LITAGS_SERVER_API_PICTURE_H_
#define LITAGS_SERVER_API_PICTURE_H_

#include "absl/status/status.h"
#include "engine/core/image.h"
#include "engine/pipeline/scene.h"
#include "litags/v1/render_service.pb.h"

namespace litags {

// Encodes a rendered channel as PNG, JPEG (`jpeg_quality` 0: the default) or raw floats into
// data, size, planes and value range of `view`. See RenderedView.
absl::Status EncodePicture(const Planes& planes, Channel channel, v1::PictureFormat format,
                           int jpeg_quality, v1::RenderedView* view);

}  // namespace litags

#endif  // LITAGS_SERVER_API_PICTURE_H_
