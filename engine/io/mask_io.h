// Masks of photos as files; what they mean is in engine/core/mask.h.
#ifndef LITAGS_ENGINE_IO_MASK_IO_H_
#define LITAGS_ENGINE_IO_MASK_IO_H_

#include <map>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/image.h"
#include "engine/io/image_io.h"

namespace litags {

// Name of a photo to the path of its mask.
using MaskPaths = std::map<std::string, std::string>;

// The masks in a folder (.png in any case; hidden files and other names do not count), matched with
// photos as MatchMasks says, whose errors it has. NOT_FOUND (NO_SUCH_FOLDER), INVALID_ARGUMENT
// (NO_MASKS).
absl::StatusOr<MaskPaths> FindMasks(const std::string& dir, absl::Span<const std::string> photos);
// The same of all but `known`: masks of any name, of which it is known whose they are.
absl::StatusOr<MaskPaths> FindMasks(const std::string& dir, absl::Span<const std::string> photos,
                                    const std::set<std::string>& known);

// A PNG of at most 8 bits a channel, as [H, W] of kCounts or 0: a pixel counts if one of its
// channels is not 0 in the file, whatever colours its profile makes of that. Errors of DecodeImage,
// and MASK_FORMAT, MASK_BLACK (no pixel counts).
absl::StatusOr<PlaneU8> DecodeMask(std::string_view bytes, std::string_view field,
                                   const ImageLimits& limits = {});

// The same from a file, with "masks[NAME]" as field. MASK_SIZE, before it is decoded, unless it is
// of its upright photo's size.
absl::StatusOr<PlaneU8> ReadMask(const std::string& path, int photo_width, int photo_height);

// A photo whose masked pixels are filled in from around them.
struct MaskedPhoto {
  Photo photo;
  ImageInfo info;
  PlaneU8 mask;  // empty: all pixels count
};

// Errors of ReadPhoto with `field`, and of ReadMask. `mask_path` may be empty.
absl::StatusOr<MaskedPhoto> ReadMaskedPhoto(const std::string& path, std::string_view field,
                                            const std::string& mask_path);

// One channel, 8 bits: 255 where a pixel counts, else 0.
absl::StatusOr<std::string> EncodeMask(const PlaneU8& mask);

// The mask after `change` was done to it as to its photo: Undistort, ResizeArea. A pixel counts
// if all of those it is made of do: mixed ones are partly guessed, and other photos see the rim.
// Change takes and returns an ImageU8.
template <class Change>
PlaneU8 ChangeMask(const PlaneU8& mask, Change change) {
  ImageU8 gray(mask.width, mask.height);
  for (size_t i = 0; i < gray.data.size(); ++i) gray.data[i] = mask.data[i / 3];
  gray = change(gray);
  PlaneU8 out(gray.width, gray.height);
  for (size_t i = 0; i < out.data.size(); ++i) out.data[i] = gray.data[3 * i] == 255 ? 255 : 0;
  return out;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_MASK_IO_H_
