#include "engine/io/depth_io.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "engine/core/check.h"
#include "engine/core/photo_names.h"
#include "engine/io/byte_reader.h"
#include "engine/io/file_util.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/npy.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

// The largest magnitude of a depth; 1,000 km in millimetres. Programs write more where there is
// nothing: FLT_MAX, 1e10 (Blender), the largest int32. Choice
constexpr float kMostDepth = 1e9f;

absl::Status CheckSize(int64_t width, int64_t height, std::string_view field,
                       const ImageLimits& limits) {
  if (width < 1 || height < 1) {
    return InvalidField("DEPTH_SIZE", field, "the map's size is not positive");
  }
  if (width > limits.max_side || height > limits.max_side || width * height > limits.max_pixels) {
    return InvalidField("IMAGE_TOO_LARGE", field,
                        absl::StrCat(width, "x", height, " exceeds ", limits.max_pixels,
                                     " pixels or ", limits.max_side, " on a side; resize it"));
  }
  return absl::OkStatus();
}

struct PfmHeader {
  int width = 0, height = 0;
  float scale = 0;
  size_t end = 0;  // where the data begin
};

bool IsPfm(std::string_view bytes) {
  return bytes.starts_with("Pf\n") || bytes.starts_with("Pf\r") || bytes.starts_with("Pf ");
}

bool IsNpy(std::string_view bytes) { return bytes.starts_with("\x93NUMPY"); }

// "Pf\n<width> <height>\n<scale>\n"; a negative scale means little-endian.
absl::StatusOr<PfmHeader> ParsePfmHeader(std::string_view bytes, std::string_view field) {
  constexpr size_t kMaxHeaderBytes = 128;
  const std::string_view front = bytes.substr(0, kMaxHeaderBytes);
  size_t end = 0;
  for (int line = 0; line < 3; ++line) {
    const size_t newline = front.find('\n', end);
    if (newline == std::string_view::npos) {
      return InvalidField("DEPTH_CORRUPT", field, "the PFM header is malformed");
    }
    end = newline + 1;
  }
  const std::vector<std::string> words =
      absl::StrSplit(Absl(front.substr(0, end)), absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
  PfmHeader header;
  header.end = end;
  if (words.size() != 4 || words[0] != "Pf" || !absl::SimpleAtoi(words[1], &header.width) ||
      !absl::SimpleAtoi(words[2], &header.height) || !absl::SimpleAtof(words[3], &header.scale) ||
      header.scale == 0) {
    return InvalidField("DEPTH_CORRUPT", field, "the PFM header is malformed");
  }
  return header;
}

// Rows go bottom to top.
absl::StatusOr<Planes> DecodePfm(std::string_view bytes, std::string_view field,
                                 const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(const PfmHeader header, ParsePfmHeader(bytes, field));
  const auto [width, height, scale, end] = header;
  LITAGS_RETURN_IF_ERROR(CheckSize(width, height, field, limits));
  ByteReader reader(bytes.substr(end));
  if (!reader.CanHold(uint64_t(width) * height, sizeof(float))) {
    return InvalidField("DEPTH_TRUNCATED", field, "the PFM ends early; send the whole file");
  }
  Planes map(1, height, width);
  for (int y = height - 1; y >= 0; --y) {
    for (int x = 0; x < width; ++x) {
      uint32_t code = 0;
      if (scale < 0) {
        reader.Read(&code);
      } else {
        reader.ReadBig(&code);
      }
      map.at(0, y, x) = std::bit_cast<float>(code);
    }
  }
  return map;
}

// Height and width, where another axis has one entry.
absl::StatusOr<std::vector<int64_t>> PlaneShape(std::vector<int64_t> shape,
                                                std::string_view field) {
  if (shape.size() == 3 && shape.front() == 1) {
    shape.erase(shape.begin());
  } else if (shape.size() == 3 && shape.back() == 1) {
    shape.pop_back();
  }
  if (shape.size() == 2) return shape;
  return InvalidField("DEPTH_SIZE", field, "the array is not [H,W], [1,H,W] or [H,W,1]");
}

absl::StatusOr<Planes> PlanesFromNpy(std::string_view bytes, std::string_view field,
                                     const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(const NpyArray array, DecodeNpy(bytes, field));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<int64_t> shape, PlaneShape(array.shape, field));
  LITAGS_RETURN_IF_ERROR(CheckSize(shape[1], shape[0], field, limits));
  Planes map(1, static_cast<int>(shape[0]), static_cast<int>(shape[1]));
  map.data = array.ToFloats();
  return map;
}

absl::Status CheckPngKind(int channels, int bit_depth, std::string_view field) {
  if (channels != 1) {
    return InvalidField(
        "DEPTH_SIZE", field,
        absl::StrCat("the PNG has ", channels, " channels; send one channel of 16 bits"));
  }
  if (bit_depth < 16) {
    return InvalidField("DEPTH_BITS", field,
                        absl::StrCat("the PNG has ", bit_depth,
                                     " bits, as pictures of depth have; send 16, PFM or NPY"));
  }
  return absl::OkStatus();
}

// By its header, which ParsePngHeader took; palettes are of RGB.
int PngHeaderChannels(std::string_view bytes) {
  constexpr size_t kColorType = 25;
  const int type = kColorType < bytes.size() ? bytes[kColorType] : 0;
  return type == 0 ? 1 : type == 4 ? 2 : type == 6 ? 4 : 3;
}

absl::StatusOr<Planes> DecodePngCodes(std::string_view bytes, std::string_view field,
                                      const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ParsePngHeader(bytes, field));
  LITAGS_RETURN_IF_ERROR(CheckSize(info.width, info.height, field, limits));
  int channels = 1;
  Planes map(1, info.height, info.width);
  const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
    channels = shape.channels;
    if (channels == 1) std::copy_n(codes, map.width, &map.at(0, y, 0));
  };
  LITAGS_RETURN_IF_ERROR(ReadPngCodes(bytes, PngChannels::kAll, field, take));
  LITAGS_RETURN_IF_ERROR(CheckPngKind(channels, info.bit_depth, field));
  return map;
}

absl::Status NotRecognized(std::string_view field) {
  return InvalidField("DEPTH_NOT_RECOGNIZED", field,
                      "neither a one-channel PFM nor NPY nor PNG file; convert it to one of them");
}

absl::StatusOr<Planes> DecodeAny(std::string_view bytes, std::string_view field,
                                 const ImageLimits& limits) {
  if (IsPfm(bytes)) return DecodePfm(bytes, field, limits);
  if (IsNpy(bytes)) return PlanesFromNpy(bytes, field, limits);
  if (IsPng(bytes)) return DecodePngCodes(bytes, field, limits);
  return NotRecognized(field);
}

}  // namespace

absl::StatusOr<Planes> DecodeDepthMap(std::string_view bytes, std::string_view field,
                                      const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(Planes map, DecodeAny(bytes, field, limits));
  bool any = false;
  for (float& value : map.data) {
    if (std::abs(value) <= kMostDepth) {
      any = true;
    } else {
      value = std::numeric_limits<float>::quiet_NaN();
    }
  }
  if (!any) {
    return InvalidField(
        "NOT_FINITE", field,
        absl::StrCat("every value of the map is NaN, infinite or beyond ", kMostDepth));
  }
  return map;
}

absl::StatusOr<Planes> ReadDepthMap(const std::string& path, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, ImageLimits().max_bytes));
  return DecodeDepthMap(bytes, field);
}

absl::StatusOr<DepthSize> ReadDepthSize(const std::string& path, std::string_view field) {
  constexpr size_t kFrontBytes = 64 << 10;
  std::string front(kFrontBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(front.data(), static_cast<std::streamsize>(front.size()));
  front.resize(static_cast<size_t>(file.gcount()));
  return ParseDepthSize(front, field);
}

absl::StatusOr<DepthSize> ParseDepthSize(std::string_view bytes, std::string_view field) {
  int64_t width = 0, height = 0;
  if (IsPfm(bytes)) {
    LITAGS_ASSIGN_OR_RETURN(const PfmHeader header, ParsePfmHeader(bytes, field));
    width = header.width, height = header.height;
  } else if (IsNpy(bytes)) {
    size_t data = 0;
    LITAGS_ASSIGN_OR_RETURN(const NpyArray header, DecodeNpyHeader(bytes, field, &data));
    LITAGS_ASSIGN_OR_RETURN(const std::vector<int64_t> shape, PlaneShape(header.shape, field));
    height = shape[0], width = shape[1];
  } else if (IsPng(bytes)) {
    LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ParsePngHeader(bytes, field));
    LITAGS_RETURN_IF_ERROR(CheckPngKind(PngHeaderChannels(bytes), info.bit_depth, field));
    width = info.width, height = info.height;
  } else {
    return NotRecognized(field);
  }
  LITAGS_RETURN_IF_ERROR(CheckSize(width, height, field, ImageLimits()));
  return DepthSize{static_cast<int>(width), static_cast<int>(height)};
}

std::string FindDepthMap(const std::string& dir, const std::string& photo) {
  for (const std::string& name : DepthMapNames(BaseName(photo))) {
    const std::string path = absl::StrCat(dir, "/", name);
    std::error_code ignored;
    if (std::filesystem::is_regular_file(path, ignored)) return path;
  }
  return "";
}

std::string EncodePfm(const Planes& planes) {
  LITAGS_CHECK(planes.channels == 1 || planes.channels == 3);
  std::string out = absl::StrCat(planes.channels == 1 ? "Pf" : "PF", "\n", planes.width, " ",
                                 planes.height, "\n-1.0\n");
  out.reserve(out.size() + planes.data.size() * sizeof(float));
  for (int y = planes.height - 1; y >= 0; --y) {
    for (int x = 0; x < planes.width; ++x) {
      for (int c = 0; c < planes.channels; ++c) AppendNumber(&out, planes.at(c, y, x));
    }
  }
  return out;
}

absl::Status WritePfm(const std::string& path, const Planes& planes) {
  return WriteFileAtomically(path, EncodePfm(planes));
}

}  // namespace litags
