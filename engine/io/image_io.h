// Photos in (from anybody, of the formats in docs/inputs.md); picture_io.h is pictures out. Colours
// are sRGB-encoded.
#ifndef LITAGS_ENGINE_IO_IMAGE_IO_H_
#define LITAGS_ENGINE_IO_IMAGE_IO_H_

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/image.h"
#include "engine/core/limits.h"
#include "engine/core/photo.h"
#include "engine/io/picture_io.h"

namespace litags {

// What a photo may cost us. Checked on the file's header, before anything is allocated. Fuzzing
// gives smaller ones.
struct ImageLimits {
  int64_t max_bytes = kMaxImageBytes;    // encoded
  int64_t max_pixels = kMaxImagePixels;  // decoded
  int max_side = kMaxImageSide;          // px
};

inline constexpr int kPng16Bits = 12;  // that EncodePng16 keeps of a photo

enum class ImageFormat { kJpeg, kPng, kRaw, kTiff, kWebp, kHeif, kJxl };

// What EXIF says of the lens; 0: not said.
struct ExifLens {
  double in_35mm = 0;         // focal length of a 35 mm camera that sees as much, mm
  double mm = 0;              // the lens' own, times the digital zoom
  double pixels_per_mm = 0;   // of the sensor
  int width = 0, height = 0;  // of the picture that the camera wrote, px
};

// What a header says. The size is that of the upright picture: EXIF orientation applied.
struct ImageInfo {
  ImageFormat format = ImageFormat::kJpeg;
  int width = 0;             // px
  int height = 0;            // px
  int orientation = 1;       // EXIF, 1..8
  int bit_depth = 8;         // per channel
  int significant_bits = 0;  // of them, by PNG's sBIT; 0: not said
  // EXIF, mm: ExifLens::in_35mm, else ExifLens::mm; 0: not said. Tells lenses of one camera and
  // steps of a zoom apart.
  double focal_length = 0;
  ExifLens lens;
  // EXIF's make, model, serial number, lens and digital zoom, if any, a line each: photos of two
  // cameras differ in it. Empty: none is said.
  std::string camera;
  // Of the exposure: s, ISO and f-number; 0: not said. The light on the sensor times its gain is
  // relative to exposure_time * iso / f_number^2.
  double exposure_time = 0;
  double iso = 0;
  double f_number = 0;
  // JPEG: quantisation step of the mean of a block of Cb or Cr, the larger, as the file has it (8
  // times 8-bit codes); 0: no such thing.
  int chroma_step = 0;
  // DNG: it says how the lens shades the corners (GainMap), which decoding does not undo.
  bool has_gain_map = false;
};

// Bits of a channel that say something of the picture: PNG's sBIT, else all of them.
int SignificantBits(const ImageInfo& info);

// The step that the file rounds light to, in codes of 255: at most 1, that of 8 bits.
double CodeStep(const ImageInfo& info);

// Reads the header only. Errors are INVALID_ARGUMENT, start with `field` (for photos:
// "images[0001.jpg]") and carry one of these reasons: IMAGE_EMPTY, IMAGE_NOT_RECOGNIZED (of
// no format that is read), IMAGE_TRUNCATED, IMAGE_CORRUPT, IMAGE_TOO_LARGE, IMAGE_UNSUPPORTED (a
// kind of such a format that is not read, by name).
absl::StatusOr<ImageInfo> ReadImageInfo(std::string_view bytes, std::string_view field,
                                        const ImageLimits& limits = {});

// Focal length that EXIF gives for a picture of this size, px; 0 if it says none, or none that a
// lens without fisheye can have, or if the camera wrote a picture of another shape: one that was
// cut since.
double ExifFocalLength(const ImageInfo& info);

// Decodes to upright RGB with the precision that the file has: JPEG in floating point from its
// coefficients (jpeg_decode.cc), HEIC, AVIF and lossy WebP in floating point from their YCbCr
// (ycbcr.h), RAW from the sensor's numbers (raw_decode.cc), others with their 8 to 16 bits of RGB.
// Colours become sRGB as the file's ICC profile says; a broken one is passed over.
// Transparency is dropped, grey becomes R = G = B. A file that ends early is refused
// (IMAGE_TRUNCATED), never padded with grey. Errors as above.
absl::StatusOr<Photo> DecodePhoto(std::string_view bytes, std::string_view field,
                                  const ImageLimits& limits = {});

// The same rounded to 8 bits.
absl::StatusOr<ImageU8> DecodeImage(std::string_view bytes, std::string_view field,
                                    const ImageLimits& limits = {});

// The same from a file; NOT_FOUND if missing. ReadImageSize decodes nothing.
absl::StatusOr<Photo> ReadPhoto(const std::string& path, std::string_view field);
absl::StatusOr<ImageU8> ReadImage(const std::string& path, std::string_view field);
absl::StatusOr<ImageInfo> ReadImageSize(const std::string& path, std::string_view field);

// As a PNG of 16 bits, of which the lower four repeat the upper: 12 bits of a photo are worth
// keeping. `significant_bits`, at most those: of the file that the photo comes from (sBIT). Where
// samples lie below 0, codes begin at the least of them, and the file says so (pCAL); what lies
// above 1 is cut off. 0 and 1 stay as they are. INVALID_ARGUMENT for an empty photo.
absl::StatusOr<std::string> EncodePng16(const Photo& photo, int significant_bits = kPng16Bits);

// Turns a stored picture upright. EXIF says where the stored first row and column are to appear:
// 2 mirrored, 3 by 180 degrees, 4 flipped, 5 transposed, 6 to be turned clockwise, 7 transposed
// across the other diagonal, 8 to be turned counter-clockwise.
Photo TurnUpright(Photo stored, int orientation);
PlaneU8 TurnUpright(PlaneU8 stored, int orientation);

// Has decoders load and initialise what they otherwise would with the first photo: for a process
// that then gives up opening files.
void LoadPhotoDecoders();

// How the names of photos end, lower case.
std::span<const std::string_view> PhotoEndings();

// Whether the name of a file is that of a photo: by PhotoEndings() in any case, and not hidden.
bool IsPhotoName(const std::string& name);

// Names of the photos in a folder, by IsPhotoName(), sorted by bytes. NOT_FOUND (NO_SUCH_FOLDER),
// INVALID_ARGUMENT (NO_PHOTOS).
absl::StatusOr<std::vector<std::string>> ListPhotos(const std::string& dir, std::string_view field);

// "6 pictures are of a kind that is not read, IMG_1.BMP for one: convert to JPEG or PNG": files of
// a folder, by their names; "" if there are none. NOT_FOUND
// (NO_SUCH_FOLDER).
absl::StatusOr<std::string> DescribeOtherPictures(const std::string& dir, std::string_view field);

// Resamples by pixel area (no aliasing when shrinking; bilinear when growing). Sizes positive.
ImageU8 ResizeArea(const ImageU8& image, int width, int height);

// The same in linear light: what a coarser sensor would have measured.
Photo ResizeArea(const Photo& photo, int width, int height);
// The same with the longer side `side` px, unless it is shorter.
Photo ShrinkToFit(const Photo& photo, int side);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_IMAGE_IO_H_
