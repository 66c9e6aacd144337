// What is seen of a photo by itself, and which of several are of no use.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_LOOK_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_LOOK_H_

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/photo.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/photo_detail.h"

namespace litags {

// A photo that was decoded.
struct ScreenedPhoto {
  std::string name;
  int width = 0, height = 0;  // px, upright
  double mean_code = 0;       // of 255, sRGB
  double light = 0;           // mean linear light, of 1
  double structure = 0;       // as StructureOf has it; 1 of one colour
  double sharpness = 0;       // as FrameFacts::sharpness
  PhotoDetail detail;
  std::optional<std::array<uint8_t, 3>> flat;  // as FlatColor has it
  std::string pixels;                          // fingerprint; empty where flat
  // Of copies alone: how closely given cameras name it (HowNamed), and whether a depth map does.
  int named_by_cameras = 0;
  bool has_depth_map = false;
  // Its metadata say what of the sphere it is, so that a run without given cameras takes views of
  // it.
  bool has_views = false;
  bool grey = false;  // it has no colour, as of a camera that sees by infrared light at night
  ImageInfo info;     // what its file says of it; LookAt() does not know it
};

// "is of one colour, (0, 0, 0)".
std::string DescribeFlat(const std::array<uint8_t, 3>& color);

ScreenedPhoto LookAt(std::string name, const Photo& photo);

// Median of this member of the photos; 0 without photos.
double MiddleOf(absl::Span<const ScreenedPhoto> photos, double ScreenedPhoto::*member);

// Whether some have the same pixels.
bool HasCopies(absl::Span<const ScreenedPhoto> photos);

// Why each photo is left out ("is the same photo as a.jpg"); empty: it is used. Left out are photos
// of one colour, of nothing but noise (a cap on the lens), blurred ones among sharp ones, copies,
// and strips among photos that are none. Of photos with the same pixels one is kept: that which
// given cameras name, else that with a depth map, else that with the shortest name. Those of one
// colour, and copies, do not count for what the middle photo is.
std::vector<std::string> WhyLeftOut(absl::Span<const ScreenedPhoto> photos);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_LOOK_H_
