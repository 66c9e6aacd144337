#include "engine/io/image_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/io/byte_reader.h"
#include "engine/io/io_error.h"
#include "engine/io/tiff_reader.h"

namespace litags {
namespace {

constexpr std::string_view kJpegMagic = "\xFF\xD8\xFF";
constexpr std::string_view kPngMagic = "\x89PNG\r\n\x1A\n";
constexpr std::string_view kExifPrefix("Exif\0\0", 6);  // JPEG's; some programs write it in others
constexpr uint8_t kEndOfImage = 0xD9;

absl::Status Truncated(std::string_view field) {
  return InvalidField("IMAGE_TRUNCATED", field, "the file ends early; send the whole file again");
}

absl::Status Corrupt(std::string_view field, std::string_view what) {
  return InvalidField("IMAGE_CORRUPT", field, absl::StrCat(Absl(what), "; send the file again"));
}

constexpr uint8_t kJpegLs = 0xF7;

// Start of frame: SOF0..SOF15 but for DHT (C4), JPG (C8) and DAC (CC), which share the range.
bool IsStartOfFrame(uint8_t marker) {
  return marker == kJpegLs ||
         (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC);
}

// A whole JPEG of a kind that libjpeg does not decode, which it would call damaged. It decodes
// baseline, extended and progressive ones, and those of arithmetic coding, which JpegCoefficients
// refuses by name.
absl::Status CheckJpegKind(uint8_t start_of_frame, uint8_t depth, std::string_view field) {
  constexpr std::string_view kDecoded = "\xC0\xC1\xC2\xC9\xCA";
  if (kDecoded.find(static_cast<char>(start_of_frame)) == std::string_view::npos) {
    const bool lossless = start_of_frame == kJpegLs || (start_of_frame & 3) == 3;
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        absl::StrCat(lossless ? "a lossless" : "a hierarchical",
                                     " JPEG; save it as a PNG, a TIFF or a baseline JPEG"));
  }
  if (depth == 8) return absl::OkStatus();
  return InvalidField(
      "IMAGE_UNSUPPORTED", field,
      absl::StrCat("a JPEG of ", depth, " bits a channel; save it as a PNG or TIFF of 16 bits"));
}

// Markers without a length: TEM and RST0..RST7.
bool IsBareMarker(uint8_t marker) { return marker == 0x01 || (marker >= 0xD0 && marker <= 0xD7); }

// Next marker of a JPEG: FF, any number of fill bytes FF, then the code. What stands before it is
// skipped, as libjpeg does.
bool ReadMarker(ByteReader* reader, uint8_t* marker) {
  do {
    if (!reader->Read(marker)) return false;
  } while (*marker != 0xFF);
  do {
    if (!reader->Read(marker)) return false;
  } while (*marker == 0xFF);
  return true;
}

// The first step, that of a block's mean, of each of a JPEG's four quantisation tables; 0: not set.
using FirstSteps = std::array<int, 4>;

// From a DQT segment (ITU-T T.81, B.2.4.1). What is broken is left to the decoder.
void ReadQuantTables(std::string_view segment, FirstSteps* steps) {
  ByteReader reader(segment);
  uint8_t kind = 0;
  while (reader.Read(&kind)) {
    const bool wide = kind >> 4 != 0;
    uint8_t byte = 0;
    uint16_t step = 0;
    if (wide ? !reader.ReadBig(&step) : !reader.Read(&byte)) return;
    if ((kind & 15) < 4) (*steps)[kind & 15] = wide ? step : byte;
    if (!reader.Skip(wide ? 126 : 63)) return;
  }
}

// What a start of frame says of the chroma tables; the reader stands after the size.
std::array<int, 2> ChromaTables(ByteReader frame) {
  std::array<int, 2> tables = {-1, -1};
  uint8_t components = 0, id = 0, sampling = 0, table = 0;
  frame.Read(&components);
  for (int c = 0; c < components && components == 3; ++c) {
    if (!frame.Read(&id) || !frame.Read(&sampling) || !frame.Read(&table)) break;
    if (c > 0) tables[c - 1] = table & 3;
  }
  return tables;
}

struct PngChunk {
  std::string_view type, data;
};

// One chunk with its CRC (which libpng checks when it decodes); false if it is not all there.
bool ReadChunk(ByteReader* reader, PngChunk* chunk) {
  uint32_t size = 0;
  return reader->ReadBig(&size) && reader->ReadBytes(4, &chunk->type) &&
         reader->ReadBytes(size, &chunk->data) && reader->Skip(4);
}

// Of an sBIT chunk, over the channels; 0 where it says what cannot be.
int LeastBits(std::string_view channels, int depth) {
  int least = depth + 1;
  for (const char bits : channels) least = std::min<int>(least, static_cast<uint8_t>(bits));
  return least <= depth ? least : 0;
}

constexpr std::string_view kCalibration("litags\0", 7);  // its name; others mean other quantities
constexpr uint32_t kLargestCode = 65535;

// PngColors::least of a pCAL chunk: name, codes that the parameters are of, kind of equation,
// number of parameters, name of the unit, parameters as text.
double LeastOf(std::string_view calibration) {
  ByteReader reader(calibration);
  uint32_t first = 0, last = 0;
  uint8_t equation = 0, parameters = 0;
  if (!calibration.starts_with(kCalibration) || !reader.Skip(kCalibration.size()) ||
      !reader.ReadBig(&first) || !reader.ReadBig(&last) || !reader.Read(&equation) ||
      !reader.Read(&parameters) || first != 0 || last != kLargestCode || equation != 0 ||
      parameters != 2) {
    return 0;
  }
  const std::vector<std::string> texts =
      absl::StrSplit(Absl(calibration.substr(kCalibration.size() + 10)), '\0');
  double least = 0;
  const bool said = texts.size() == 3 && absl::SimpleAtod(texts[1], &least);
  return said && least >= -1 && least < 0 ? least : 0;
}

// How much the camera enlarged the middle of what the lens gave; 1: not at all.
double DigitalZoom(const TiffReader& reader, size_t directory) {
  constexpr uint16_t kDigitalZoomRatio = 0xA404;
  return std::max(1.0, reader.GetRatio(directory, kDigitalZoomRatio));
}

// Of the directory that EXIF's tags of the exposure are in.
ExifLens ReadExifLens(const TiffReader& reader, size_t directory) {
  constexpr uint16_t kFocalLength = 0x920A, kFocalLengthIn35mmFilm = 0xA405, kWidth = 0xA002,
                     kHeight = 0xA003, kPlaneResolution = 0xA20E, kPlaneUnit = 0xA210;
  constexpr uint16_t kShort = TiffReader::kShort, kLong = TiffReader::kLong;
  const auto side = [&](uint16_t tag) {
    const size_t at = reader.Find(directory, tag, kLong);
    const uint32_t pixels = at != 0 ? reader.Get<uint32_t>(at)
                                    : reader.Get<uint16_t>(reader.Find(directory, tag, kShort));
    return pixels <= kMaxImageSide ? static_cast<int>(pixels) : 0;
  };
  const auto unit = reader.Get<uint16_t>(reader.Find(directory, kPlaneUnit, kShort));
  constexpr double kMmOfUnit[] = {25.4, 25.4, 25.4, 10, 1, 0.001};  // 2: inch, the default
  ExifLens lens;
  lens.in_35mm = reader.Get<uint16_t>(reader.Find(directory, kFocalLengthIn35mmFilm, kShort));
  lens.mm = reader.GetRatio(directory, kFocalLength) * DigitalZoom(reader, directory);
  if (unit < std::size(kMmOfUnit)) {
    lens.pixels_per_mm = reader.GetRatio(directory, kPlaneResolution) / kMmOfUnit[unit];
  }
  lens.width = side(kWidth);
  lens.height = side(kHeight);
  return lens;
}

// Calls visit(marker, content) for the segments of a JPEG before its first scan.
template <class Visit>
void ForSegments(std::string_view bytes, const Visit& visit) {
  constexpr uint8_t kStartOfScan = 0xDA;
  ByteReader reader(bytes);
  reader.Skip(2);  // SOI
  uint8_t marker = 0;
  while (ReadMarker(&reader, &marker) && marker != kStartOfScan) {
    if (IsBareMarker(marker)) continue;
    uint16_t length = 0;
    std::string_view segment;
    if (!reader.ReadBig(&length) || length < 2 || !reader.ReadBytes(length - 2u, &segment)) return;
    visit(marker, segment);
  }
}

// 0: not said.
uint32_t ReadIso(const TiffReader& reader, size_t directory) {
  constexpr uint16_t kIso = 0x8827, kStandardOutput = 0x8831, kRecommended = 0x8832,
                     kIsoSpeed = 0x8833;
  constexpr uint16_t kTooMuch = 0xFFFF;  // for this tag: another one has it
  const auto iso = reader.Get<uint16_t>(reader.Find(directory, kIso, TiffReader::kShort));
  if (iso != kTooMuch) return iso;
  for (const uint16_t tag : {kRecommended, kStandardOutput, kIsoSpeed}) {
    const auto larger = reader.Get<uint32_t>(reader.Find(directory, tag, TiffReader::kLong));
    if (larger > 0) return larger;
  }
  return 0;
}

}  // namespace

bool IsJpeg(std::string_view bytes) { return bytes.starts_with(kJpegMagic); }

bool IsPng(std::string_view bytes) { return bytes.starts_with(kPngMagic); }

std::string CameraName(std::initializer_list<std::string_view> parts) {
  std::string name;
  bool said = false;
  for (const std::string_view part : parts) {
    said |= !part.empty();
    name.append(part).append("\n");
  }
  return said ? name : "";
}

void ReadExif(std::string_view tiff, ImageInfo* info) {
  if (tiff.starts_with(kExifPrefix)) tiff.remove_prefix(kExifPrefix.size());
  constexpr uint16_t kOrientation = 0x0112, kCameraDirectory = 0x8769, kExposureTime = 0x829A,
                     kFNumber = 0x829D, kMake = 0x010F, kModel = 0x0110, kSerial = 0xA431,
                     kLens = 0xA434;
  constexpr uint16_t kShort = TiffReader::kShort;
  const TiffReader reader(tiff);
  const size_t main = reader.FirstDirectory();
  const int orientation = reader.Get<uint16_t>(reader.Find(main, kOrientation, kShort));
  if (info->orientation == 1 && orientation >= 1 && orientation <= 8) {
    info->orientation = orientation;
  }
  const size_t camera = reader.FindDirectory(main, kCameraDirectory);
  if (info->focal_length == 0) {
    info->lens = ReadExifLens(reader, camera);
    info->focal_length = info->lens.in_35mm > 0 ? info->lens.in_35mm : info->lens.mm;
  }
  if (info->camera.empty()) {
    info->camera = CameraName({reader.GetText(main, kMake), reader.GetText(main, kModel),
                               reader.GetText(camera, kSerial), reader.GetText(camera, kLens)});
    // Some makers' focal length in 35 mm has it, some makers' does not.
    const std::string zoom = absl::StrFormat("%.2f", DigitalZoom(reader, camera));
    if (zoom != "1.00") absl::StrAppend(&info->camera, "zoom ", zoom, "\n");
  }
  if (info->exposure_time == 0) info->exposure_time = reader.GetRatio(camera, kExposureTime);
  if (info->f_number == 0) info->f_number = reader.GetRatio(camera, kFNumber);
  if (info->iso == 0) info->iso = ReadIso(reader, camera);
}

double ExifFocalLength(const ImageInfo& info) {
  constexpr double kFilmDiagonal = 43.267;                 // mm, of 36 x 24
  constexpr double kLeastSensor = 2, kLargestSensor = 60;  // mm: of phones, medium format
  constexpr double kLeast = 0.25, kMost = 10;              // of the longer side: 127 to 6 degrees
  constexpr double kSameShape = 0.02;                      // rounded sides, margins of RAW
  const ExifLens& lens = info.lens;
  const auto [shorter, longer] = std::minmax(info.width, info.height);
  const auto [wrote_shorter, wrote_longer] = std::minmax(lens.width, lens.height);
  if (longer == 0) return 0;
  if (wrote_shorter > 0 &&
      std::abs(double(shorter) * wrote_longer / (double(longer) * wrote_shorter) - 1) >
          kSameShape) {
    return 0;
  }
  double focal = 0;
  if (lens.in_35mm > 0) {
    focal = lens.in_35mm / kFilmDiagonal * std::hypot(shorter, longer);
  } else if (lens.mm > 0 && lens.pixels_per_mm > 0 && wrote_longer > 0) {
    const double sensor = wrote_longer / lens.pixels_per_mm;
    if (sensor >= kLeastSensor && sensor <= kLargestSensor) focal = lens.mm / sensor * longer;
  }
  return focal >= kLeast * longer && focal <= kMost * longer ? focal : 0;
}

absl::StatusOr<ImageInfo> ParseJpegHeader(std::string_view bytes, std::string_view field) {
  constexpr uint8_t kStartOfScan = 0xDA, kQuantTables = 0xDB, kApp1 = 0xE1;
  ImageInfo info;
  FirstSteps steps = {};
  std::array<int, 2> chroma = {-1, -1};
  info.format = ImageFormat::kJpeg;
  ByteReader reader(bytes);
  reader.Skip(2);  // SOI
  while (true) {
    uint8_t marker = 0;
    if (!ReadMarker(&reader, &marker)) return Truncated(field);
    if (IsBareMarker(marker)) continue;
    if (marker == kEndOfImage) return Corrupt(field, "the JPEG ends without a picture");
    uint16_t length = 0;
    std::string_view segment;
    if (!reader.ReadBig(&length)) return Truncated(field);
    if (length < 2) return Corrupt(field, "a JPEG segment has an impossible length");
    if (!reader.ReadBytes(length - 2u, &segment)) return Truncated(field);
    if (marker == kApp1 && segment.starts_with(kExifPrefix)) ReadExif(segment, &info);
    if (marker == kQuantTables) ReadQuantTables(segment, &steps);
    if (IsStartOfFrame(marker)) {
      ByteReader frame(segment);
      uint8_t depth = 0;
      uint16_t height = 0, width = 0;
      if (!frame.Read(&depth) || !frame.ReadBig(&height) || !frame.ReadBig(&width)) {
        return Corrupt(field, "the JPEG frame header is too short");
      }
      LITAGS_RETURN_IF_ERROR(CheckJpegKind(marker, depth, field));
      info.bit_depth = depth;
      info.width = width;
      info.height = height;
      chroma = ChromaTables(frame);
    }
    if (marker == kStartOfScan) break;
  }
  if (info.width == 0 || info.height == 0) return Corrupt(field, "the JPEG states no picture size");
  for (const int table : chroma) {
    if (table >= 0) info.chroma_step = std::max(info.chroma_step, steps[table]);
  }
  return info;
}

absl::StatusOr<ImageInfo> ParsePngHeader(std::string_view bytes, std::string_view field) {
  constexpr uint32_t kMaxSide = 0x7FFFFFFF;  // PNG specification
  ImageInfo info;
  info.format = ImageFormat::kPng;
  ByteReader reader(bytes);
  reader.Skip(kPngMagic.size());
  PngChunk chunk;
  if (!ReadChunk(&reader, &chunk)) return Truncated(field);
  ByteReader header(chunk.data);
  uint32_t width = 0, height = 0;
  uint8_t depth = 0;
  if (chunk.type != "IHDR" || !header.ReadBig(&width) || !header.ReadBig(&height) ||
      !header.Read(&depth)) {
    return Corrupt(field, "the PNG does not start with its header");
  }
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    return Corrupt(field, "the PNG states an impossible size");
  }
  info.width = static_cast<int>(width);
  info.height = static_cast<int>(height);
  info.bit_depth = depth;
  while (chunk.type != "IDAT" && chunk.type != "IEND") {
    if (!ReadChunk(&reader, &chunk)) break;  // long image data: the header was whole before it
    if (chunk.type == "eXIf") ReadExif(chunk.data, &info);
    if (chunk.type == "sBIT") info.significant_bits = LeastBits(chunk.data, depth);
  }
  return info;
}

bool LacksJpegEnd(std::string_view bytes) {
  ByteReader reader(bytes);
  reader.Skip(2);  // SOI
  uint8_t marker = 0;
  while (ReadMarker(&reader, &marker)) {
    if (marker == kEndOfImage) return false;
    if (marker == 0 || IsBareMarker(marker)) continue;  // 0: in a scan, of a byte FF
    uint16_t length = 0;
    if (!reader.ReadBig(&length) || length < 2 || !reader.Skip(length - 2u)) break;
  }
  return true;
}

std::string JpegProfile(std::string_view bytes) {
  constexpr std::string_view kPrefix("ICC_PROFILE\0", 12);
  constexpr uint8_t kApp2 = 0xE2;
  std::array<std::string_view, 256> parts = {};  // by their number, from 1 on
  ForSegments(bytes, [&](uint8_t marker, std::string_view segment) {
    if (marker != kApp2 || !segment.starts_with(kPrefix)) return;
    uint8_t number = 0;
    ByteReader part(segment.substr(kPrefix.size()));
    if (part.Read(&number) && part.Skip(1)) parts[number] = segment.substr(kPrefix.size() + 2);
  });
  std::string profile;
  for (const std::string_view part : parts) profile += part;
  return profile;
}

bool IsAdobeRgbByExif(std::string_view bytes) {
  constexpr uint16_t kCameraDirectory = 0x8769, kColorSpace = 0xA001, kUncalibrated = 0xFFFF,
                     kInteroperability = 0xA005, kIndex = 1;
  constexpr uint8_t kApp1 = 0xE1;
  bool is_adobe = false;
  ForSegments(bytes, [&](uint8_t marker, std::string_view segment) {
    if (marker != kApp1 || !segment.starts_with(kExifPrefix)) return;
    const TiffReader reader(segment.substr(kExifPrefix.size()));
    const size_t camera = reader.FindDirectory(reader.FirstDirectory(), kCameraDirectory);
    const size_t space = reader.Find(camera, kColorSpace, TiffReader::kShort);
    const size_t interoperability = reader.FindDirectory(camera, kInteroperability);
    is_adobe |= reader.Get<uint16_t>(space) == kUncalibrated &&
                reader.GetText(interoperability, kIndex) == "R03";
  });
  return is_adobe;
}

PngColors ReadPngColors(std::string_view bytes) {
  PngColors colors;
  ByteReader reader(bytes);
  reader.Skip(kPngMagic.size());
  PngChunk chunk;
  while (ReadChunk(&reader, &chunk) && chunk.type != "IDAT") {
    if (chunk.type == "IHDR") {
      const int type = chunk.data.size() > 9 ? chunk.data[9] : 2;
      colors.is_grey = (type & ~4) == 0;  // 0 grey, 4 grey with alpha
      colors.has_alpha = (type & 4) != 0;
    } else if (chunk.type == "tRNS") {
      colors.has_alpha = true;
    } else if (chunk.type == "gAMA") {
      uint32_t gamma = 0;
      if (ByteReader(chunk.data).ReadBig(&gamma)) colors.gamma = gamma / 1e5;
    } else if (chunk.type == "cICP") {
      colors.code_points = chunk.data;
    } else if (chunk.type == "sRGB") {
      colors.is_srgb = true;
    } else if (chunk.type == "pCAL") {
      colors.least = LeastOf(chunk.data);
    } else if (chunk.type == "iCCP") {
      // Name, zero, method, deflated profile.
      const size_t name = chunk.data.find('\0');
      if (name != std::string_view::npos && name + 2 <= chunk.data.size()) {
        colors.deflated_profile = chunk.data.substr(name + 2);
      }
    }
  }
  return colors;
}

std::string PngCalibration(double least) {
  const std::string codes("\0\0\0\0\0\0\xFF\xFF\0\2", 10);  // a line through 0 and kLargestCode
  return absl::StrCat(Absl(kCalibration), codes, "white", absl::string_view("\0", 1),
                      absl::StrFormat("%.9g", least), absl::string_view("\0", 1),
                      absl::StrFormat("%.9g", 1 - least));
}

absl::Status CheckPngComplete(std::string_view bytes, std::string_view field) {
  ByteReader reader(bytes);
  reader.Skip(kPngMagic.size());
  PngChunk chunk;
  while (ReadChunk(&reader, &chunk)) {
    if (chunk.type == "IEND") return absl::OkStatus();
  }
  return Truncated(field);
}

}  // namespace litags
