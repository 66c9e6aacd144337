// Cameras' RAW, DNG among it, by LibRaw: what the sensor measured, demosaiced, in linear light,
// with the camera's white balance.
//
// LibRaw itself would cut off what lies below the black level, half of the noise where there is no
// light, and so brighten the dark. It is told that black is 0, and interpolates between numbers
// that still have the black level in them. Black level, white balance, clipping and the camera's
// matrix come after that, in floating point.
#include <libraw/libraw.h>

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/byte_reader.h"
#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"
#include "engine/io/tiff_reader.h"

// Of libgomp, which LibRaw runs its loops with: for the calling thread only.
extern "C" void omp_set_num_threads(int);
extern "C" int omp_get_max_threads();

namespace litags {
namespace {

template <size_t kSize>
std::string_view TextOf(const char (&text)[kSize]) {
  return {text, strnlen(text, kSize)};
}

// The main directory of a TIFF and those below it.
std::vector<size_t> DirectoriesOf(const TiffReader& reader) {
  constexpr uint16_t kSubDirectories = 330;
  constexpr uint32_t kMaxDirectories = 16;
  const size_t main = reader.FirstDirectory();
  if (main == 0) return {};
  std::vector<size_t> directories = {main};
  const size_t entry = reader.FindEntry(main, kSubDirectories);
  const uint32_t n = std::min(reader.CountOf(entry), kMaxDirectories);
  const size_t list = n > 1 ? reader.Get<uint32_t>(entry + 8) : entry + 8;
  for (uint32_t i = 0; i < n; ++i) directories.push_back(reader.Get<uint32_t>(list + 4 * i));
  return directories;
}

// Whether a TIFF is one of a sensor's numbers.
bool HoldsSensorData(std::string_view bytes) {
  constexpr uint16_t kPhotometric = 262, kDngVersion = 50706;
  constexpr int kSensor = 32803, kLinear = 34892;
  const TiffReader reader(bytes);
  if (reader.FindEntry(reader.FirstDirectory(), kDngVersion) != 0) return true;
  const std::vector<size_t> directories = DirectoriesOf(reader);
  return std::any_of(directories.begin(), directories.end(), [&](size_t directory) {
    const int kind = reader.Get<uint16_t>(reader.Find(directory, kPhotometric, TiffReader::kShort));
    return kind == kSensor || kind == kLinear;
  });
}

// Whether a DNG's second list of opcodes, which is for light, has a GainMap.
bool HasGainMap(std::string_view bytes) {
  constexpr uint16_t kOpcodeList2 = 51009;
  constexpr uint32_t kGainMap = 9, kMaxOpcodes = 64;
  const TiffReader reader(bytes);
  for (const size_t directory : DirectoriesOf(reader)) {
    const size_t entry = reader.FindEntry(directory, kOpcodeList2);
    const size_t at = entry == 0 ? bytes.size() : reader.Get<uint32_t>(entry + 8);
    ByteReader list(bytes.substr(std::min(at, bytes.size())));
    uint32_t count = 0, id = 0, version = 0, flags = 0, size = 0;
    list.ReadBig(&count);
    for (uint32_t i = 0; i < std::min(count, kMaxOpcodes); ++i) {
      if (!list.ReadBig(&id) || id == kGainMap) break;
      if (!list.ReadBig(&version) || !list.ReadBig(&flags) || !list.ReadBig(&size)) break;
      if (!list.Skip(size)) break;
    }
    if (id == kGainMap) return true;
  }
  return false;
}

bool IsRaw(std::string_view bytes) {
  if (bytes.substr(0, 12).ends_with("ftypcrx ")) return true;                        // Canon CR3
  if (bytes.substr(0, 10).ends_with("CR") && bytes.starts_with("II*")) return true;  // CR2
  for (const std::string_view magic : {"FUJIFILMCCD-RAW", "IIRO", "IIRS", "MMOR", "IIU"}) {
    if (bytes.starts_with(magic)) return true;
  }
  return HoldsSensorData(bytes);
}

// LibRaw reads a box of a CR3 whose size is 0 again and again.
class FiniteStream : public LibRaw_buffer_datastream {
 public:
  // LibRaw only reads, whatever the type says.
  explicit FiniteStream(std::string_view bytes)
      : LibRaw_buffer_datastream(const_cast<char*>(bytes.data()), bytes.size()) {}

  int seek(INT64 offset, int whence) override {
    constexpr int kMostSeeks = 200'000;  // far more than a photo has tiles or rows
    if (++seeks_ > kMostSeeks) throw LIBRAW_EXCEPTION_IO_CORRUPT;  // which LibRaw catches
    return LibRaw_buffer_datastream::seek(offset, whence);
  }

 private:
  int seeks_ = 0;
};

class RawFile {
 public:
  RawFile() : raw_(std::make_unique<LibRaw>(kQuiet)) {
    omp_set_num_threads(1);  // photos are decoded in parallel as it is
    raw_->set_dataerror_handler(OnDataError, this);
    libraw_output_params_t& params = raw_->imgdata.params;
    params.use_camera_wb = 1;
    params.no_auto_bright = 1;
    params.output_bps = 16;
    params.gamm[0] = params.gamm[1] = 1;
    params.output_color = 0;        // the camera's own: the matrix comes later
    params.highlight = 1;           // nor is white cut off before that
    params.adjust_maximum_thr = 0;  // white is where the camera has it, in every photo
    params.user_qual = 3;           // AHD
    params.max_raw_memory_mb = 1024;
  }
  ~RawFile() { omp_set_num_threads(threads_before_); }
  RawFile(const RawFile&) = delete;
  RawFile& operator=(const RawFile&) = delete;

  libraw_data_t& data() { return raw_->imgdata; }

  absl::Status Open(std::string_view bytes, std::string_view field) {
    stream_.emplace(bytes);
    return Check(raw_->open_datastream(&*stream_), field);
  }

  // To data().image, 16 bits with the black level in them.
  absl::Status Process(std::string_view field) {
    LITAGS_RETURN_IF_ERROR(Check(raw_->unpack(), field));
    if (data_error_) return Check(LIBRAW_IO_ERROR, field);
    libraw_colordata_t& color = data().color;
    const unsigned pattern = color.cblack[4] * color.cblack[5];
    std::array<unsigned, 4> black;
    for (int c = 0; c < 4; ++c) {
      black[c] = color.black + color.cblack[c];
      // Of a pattern as large as the sensor's own, LibRaw knows the colour of each place.
      unsigned sum = 0, n = 0;
      for (unsigned i = 0; i < pattern && i + 6 < LIBRAW_CBLACK_SIZE; ++i) {
        const int row = static_cast<int>(i / color.cblack[5]),
                  column = static_cast<int>(i % color.cblack[5]);
        if (raw_->COLOR(row, column) != c && pattern > 1) continue;
        sum += color.cblack[6 + i];
        ++n;
      }
      if (n > 0) black[c] += sum / n;
    }
    black_ =
        *std::min_element(black.begin(), black.begin() + std::clamp(data().idata.colors, 1, 4));
    data().params.user_black = 0;
    for (int c = 0; c < 4; ++c) {
      data().params.user_cblack[c] = static_cast<int>(black[c] - std::min(black[c], black_));
    }
    LITAGS_RETURN_IF_ERROR(Check(raw_->dcraw_process(), field));
    if (data_error_) return Check(LIBRAW_IO_ERROR, field);
    return absl::OkStatus();
  }

  // Common to all channels, in the sensor's numbers.
  unsigned black() const { return black_; }

 private:
  static constexpr unsigned kQuiet =
      LIBRAW_OPIONS_NO_MEMERR_CALLBACK | LIBRAW_OPIONS_NO_DATAERR_CALLBACK;

  static void OnDataError(void* self, const char*, int) {
    static_cast<RawFile*>(self)->data_error_ = true;
  }

  absl::Status Check(int code, std::string_view field) const {
    if (code == LIBRAW_SUCCESS) return absl::OkStatus();
    const std::string why = absl::StrCat("(", libraw_strerror(code), ")");
    if (code == LIBRAW_FILE_UNSUPPORTED || code == LIBRAW_NOT_IMPLEMENTED ||
        code == LIBRAW_UNSUPPORTED_THUMBNAIL) {
      return InvalidField("IMAGE_UNSUPPORTED", field,
                          absl::StrCat("a RAW file of a kind that LibRaw does not know ", why,
                                       "; convert it to DNG, TIFF or JPEG"));
    }
    if (data_error_ || code == LIBRAW_IO_ERROR) {
      return InvalidField("IMAGE_TRUNCATED", field,
                          absl::StrCat("the RAW file ends early or is damaged ", why,
                                       "; send the whole file again"));
    }
    if (code == LIBRAW_TOO_BIG || code == LIBRAW_UNSUFFICIENT_MEMORY) {
      return InvalidField("IMAGE_TOO_LARGE", field,
                          absl::StrCat("the RAW file is too large ", why, "; send it as TIFF"));
    }
    return InvalidField(
        "IMAGE_CORRUPT", field,
        absl::StrCat("the RAW file cannot be decoded ", why, "; send the file again"));
  }

  const int threads_before_ = omp_get_max_threads();  // of the calling thread
  std::optional<FiniteStream> stream_;
  std::unique_ptr<LibRaw> raw_;  // large
  unsigned black_ = 0;
  bool data_error_ = false;
};

// LibRaw's flip is in the bits of dcraw: 1 mirrored, 2 flipped, 4 transposed first.
int OrientationOf(int flip) {
  constexpr int kExif[] = {1, 2, 4, 3, 5, 8, 6, 7};
  return kExif[flip & 7];
}

absl::StatusOr<ImageInfo> ReadRawInfo(std::string_view bytes, std::string_view field) {
  // LibRaw takes tags behind the end for any numbers.
  const TiffReader tiff(bytes);
  if (const size_t main = tiff.FirstDirectory(); main != 0 && !tiff.IsWhole(main)) {
    return InvalidField("IMAGE_TRUNCATED", field,
                        "the RAW file ends before its tags do; send the whole file again");
  }
  RawFile file;
  LITAGS_RETURN_IF_ERROR(file.Open(bytes, field));
  const libraw_data_t& data = file.data();
  // The sensor's frame is allocated, too.
  const libraw_image_sizes_t& sizes = data.sizes;
  if (sizes.iwidth == 0 || sizes.iheight == 0 || sizes.raw_width > 2 * sizes.iwidth + 1024 ||
      sizes.raw_height > 2 * sizes.iheight + 1024) {
    return InvalidField("IMAGE_CORRUPT", field, "the RAW file states an impossible size");
  }
  ImageInfo info;
  info.format = ImageFormat::kRaw;
  info.width = sizes.iwidth;
  info.height = sizes.iheight;
  info.orientation = OrientationOf(sizes.flip);
  info.bit_depth = 16;
  info.has_gain_map = HasGainMap(bytes);
  info.exposure_time = data.other.shutter;
  info.iso = data.other.iso_speed;
  info.f_number = data.other.aperture;
  info.lens.in_35mm = data.lens.FocalLengthIn35mmFormat;
  info.lens.mm = data.other.focal_len;
  info.focal_length = info.lens.in_35mm > 0 ? info.lens.in_35mm : info.lens.mm;
  info.camera = CameraName({TextOf(data.idata.make), TextOf(data.idata.model),
                            TextOf(data.shootinginfo.BodySerial), TextOf(data.lens.Lens)});
  return info;
}

// From interpolated numbers of 16 bits to the camera's light: white balanced, 1 at white in every
// channel.
struct Levels {
  std::array<float, 4> scale = {}, black = {};

  Levels(const libraw_colordata_t& color, unsigned black_level, int colors) {
    const float least = *std::min_element(color.pre_mul, color.pre_mul + colors);
    // LibRaw has multiplied by 65535 * pre_mul / maximum; the largest of pre_mul is 1.
    const float white = float(color.maximum - black_level) / color.maximum;
    for (int c = 0; c < colors; ++c) {
      black[c] = color.pre_mul[c] * black_level / color.maximum;
      scale[c] = 1 / (least * white);
    }
  }
};

absl::StatusOr<Photo> DecodeRaw(std::string_view bytes, const ImageInfo& info,
                                std::string_view field) {
  RawFile file;
  LITAGS_RETURN_IF_ERROR(file.Open(bytes, field));
  LITAGS_RETURN_IF_ERROR(file.Process(field));
  const libraw_data_t& data = file.data();
  const libraw_colordata_t& color = data.color;
  const int colors = data.idata.colors;
  if (data.image == nullptr || data.sizes.iwidth != info.width ||
      data.sizes.iheight != info.height || colors < 1 || colors > 4 ||
      color.maximum <= file.black()) {
    return InvalidField("IMAGE_CORRUPT", field,
                        "the RAW file's picture is not what its header states");
  }
  const Levels levels(color, file.black(), colors);
  std::array<std::array<float, 4>, 3> matrix = {};
  for (int i = 0; i < 3; ++i) {
    if (colors == 1) matrix[i] = {1, 0, 0, 0};
    for (int c = 0; c < colors && colors > 1; ++c) matrix[i][c] = color.rgb_cam[i][c];
  }
  const ColorSpace space = ColorSpace::Gamma(1, 3);
  Photo photo(info.width, info.height);
  std::vector<float> light(size_t{3} * info.width);
  for (int y = 0; y < info.height; ++y) {
    for (int x = 0; x < info.width; ++x) {
      const uint16_t* numbers = data.image[size_t(y) * info.width + x];
      std::array<float, 4> camera = {};
      for (int c = 0; c < colors; ++c) {
        const float value = (numbers[c] / 65535.0f - levels.black[c]) * levels.scale[c];
        camera[c] = std::min(value, 1.0f);
      }
      for (int i = 0; i < 3; ++i) {
        float sum = 0;
        for (int c = 0; c < 4; ++c) sum += matrix[i][c] * camera[c];
        light[3 * x + i] = sum;
      }
    }
    space.Convert(light.data(), info.width, photo.pixel(0, y));
  }
  return photo;
}

}  // namespace

const PhotoFormat kRawFormat = {ImageFormat::kRaw, "cameras' RAW", IsRaw, ReadRawInfo, DecodeRaw};

}  // namespace litags
