// Tells a photo that is blurred all over from those beside it.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_DETAIL_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_DETAIL_H_

#include "engine/core/image.h"

namespace litags {

struct PhotoDetail {
  // What it has at details of some 4 px, without its noise, by what it has at those of 16 px:
  // variances. 0.2 to 2.7 in 110 well exposed photos; a sensor that gets 6 stops less light changes
  // it by a twentieth.
  double fine = 0;
  // What it has at 16 px, by the square of its mean. A plain wall has none, however it is lit.
  double coarse = 0;
};

// Of the luma of a photo of 640 px or less on its longer side: [1, H, W], sRGB-encoded. None of one
// with less than 128 px on its shorter side.
PhotoDetail DetailOf(const Planes& luma);

// Whether the photo is blurred, `middle` being the median PhotoDetail::fine of its capture.
bool IsBlurred(const PhotoDetail& photo, double middle);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_DETAIL_H_
