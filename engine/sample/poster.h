// The flat pictures that hang and stand in the sample room.
#ifndef LITAGS_ENGINE_SAMPLE_POSTER_H_
#define LITAGS_ENGINE_SAMPLE_POSTER_H_

#include "engine/core/image.h"

namespace litags::sample {

// A printed poster with large and small lettering; portrait, 420x600.
ImageU8 DrawPoster();

// A landscape painting at dusk, 640x400.
ImageU8 DrawPainting();

// A 6x4 chart of saturated colours and greys over a checkerboard, 480x400.
ImageU8 DrawColorChart();

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_POSTER_H_
