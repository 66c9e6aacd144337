// SPZ: a header, then positions, opacities, colours, sizes, rotations and higher harmonics, each of
// all Gaussians. Axes are right, up, back, which the scene has been turned to.
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr uint32_t kMagic = 0x5053474e;
constexpr uint8_t kAntialiased = 1;
// Positions are in 24 bits with a sign, so many of them behind the point.
constexpr int kMostFractionalBits = 20, kUsualFractionalBits = 12, kLeastFractionalBits = 4;
// Largest step of positions, in Gaussians' median size: finer steps change no picture.
constexpr double kStepOfSize = 1.0 / 8;
// Scales are in bytes of 16 steps a unit of their logarithm, from here. Smaller Gaussians grow to
// it and larger ones than a byte holds shrink; where more than this share of them would, pictures
// show it.
constexpr double kStepsOfScale = 16, kLeastLogScale = -10, kMostChanged = 0.1;
constexpr double kMostLogScale = kLeastLogScale + 255 / kStepsOfScale;
// Niantic's own readers refused more (maxPointsToRead in load-spz.cc) until they knew version 4:
// https://github.com/nianticlabs/spz/pull/73 brought it and took the limit away.
constexpr size_t kMostOfVersion3 = 10000000;
constexpr int kZstdLevel = 12;
// What is left of a byte of a coefficient, as Niantic's own writer has it.
constexpr int kBitsOfDegree1 = 5, kBitsOfHigher = 4;

// Names of the parts are in the order of the file.
struct Streams {
  std::string positions, opacities, colors, scales, rotations, rest;

  std::array<const std::string*, 6> All() const {
    return {&positions, &opacities, &colors, &scales, &rotations, &rest};
  }
};

// One of each Gaussian's three log-scales, 0: the smallest; sorted.
std::vector<float> SortedLogScales(const Splats& splats, int which) {
  std::vector<float> out;
  for (size_t i = 0; i < splats.size(); ++i) {
    std::array<float, 3> sizes;
    for (int k = 0; k < 3; ++k) sizes[k] = splats.at(i, kLogScale + k);
    std::sort(sizes.begin(), sizes.end());
    out.push_back(sizes[which]);
  }
  std::sort(out.begin(), out.end());
  return out;
}

absl::Status OutOfRange(double share, const char* than, double bound, const char* most,
                        double factor) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
                   absl::StrFormat("format: %.0f %% of the Gaussians are %s than the %.2g units "
                                   "that spz holds; give a scale %s %.3g times as large, or "
                                   "another format",
                                   100 * share, than, bound, most, factor));
}

// `middle`: the middle log-scale of each Gaussian, sorted; `largest`: the largest. The smallest
// says little: Gaussians of surfaces are flat.
absl::Status CheckSizes(const std::vector<float>& middle, const std::vector<float>& largest) {
  const auto n = static_cast<double>(middle.size());
  const auto small = std::lower_bound(middle.begin(), middle.end(), kLeastLogScale);
  if (const double share = (small - middle.begin()) / n; share > kMostChanged) {
    const double least = middle[static_cast<size_t>(kMostChanged * n)];
    return OutOfRange(share, "smaller", std::exp(kLeastLogScale), "at least",
                      1.01 * std::exp(kLeastLogScale - least));
  }
  const auto large = std::upper_bound(largest.begin(), largest.end(), kMostLogScale);
  if (const double share = (largest.end() - large) / n; share > kMostChanged) {
    const double most = largest[static_cast<size_t>(n - 1 - std::floor(kMostChanged * n))];
    return OutOfRange(share, "larger", std::exp(kMostLogScale), "at most",
                      0.99 * std::exp(kMostLogScale - most));
  }
  return absl::OkStatus();
}

absl::StatusOr<int> FractionalBits(const Splats& splats) {
  const std::vector<float> log_scales = SortedLogScales(splats, 1);
  LITAGS_RETURN_IF_ERROR(CheckSizes(log_scales, SortedLogScales(splats, 2)));
  const double step = kStepOfSize * std::exp(double{log_scales[log_scales.size() / 2]});
  const int wanted = std::clamp(static_cast<int>(std::ceil(-std::log2(step))), kUsualFractionalBits,
                                kMostFractionalBits);
  double largest = 0;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k)
      largest = std::max(largest, double{std::abs(splats.at(i, kMean + k))});
  }
  for (int bits = wanted; bits >= kLeastFractionalBits; --bits) {
    if (std::ldexp(largest, bits) < (1 << 23) - 1) return bits;
  }
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
      absl::StrCat("format: a Gaussian lies ", largest,
                   " units from the origin and spz holds 524287; give a smaller scale, "
                   "a crop, or another format"));
}

uint32_t PackQuat(const std::array<float, 4>& wxyz) {
  const SmallestThree three = DropLargest({wxyz[1], wxyz[2], wxyz[3], wxyz[0]});
  uint32_t word = static_cast<uint32_t>(three.largest);
  for (float v : three.rest) {
    const auto size = static_cast<uint32_t>(
        std::min(511.0, std::floor(511 * std::abs(v) / std::sqrt(0.5) + 0.5)));
    word = word << 10 | (v < 0 ? 512u : 0u) | size;
  }
  return word;
}

uint8_t PackCoefficient(float value, int bits) {
  const double step = 1 << (8 - bits);
  return PackByte(step * std::round((128.0 * value + 128) / step));
}

Streams Pack(const ViewerScene& scene, int fractional_bits) {
  const Splats& splats = scene.splats;
  Streams out;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const auto fixed = static_cast<int32_t>(
          std::lround(std::ldexp(double{splats.at(i, kMean + k)}, fractional_bits)));
      for (int byte = 0; byte < 3; ++byte) out.positions += static_cast<char>(fixed >> (8 * byte));
      AppendNumber(&out.colors, PackByte(255 * (0.15 * splats.at(i, kShDc + k) + 0.5)));
      AppendNumber(&out.scales,
                   PackByte(kStepsOfScale * (splats.at(i, kLogScale + k) - kLeastLogScale)));
    }
    AppendNumber(&out.opacities, PackByte(255 * Opacity(splats, i)));
    AppendNumber(&out.rotations, PackQuat(UnitQuat(splats, i)));
    for (int k = 1; k < ShCount(scene.sh_degree); ++k) {
      for (int c = 0; c < 3; ++c) {
        AppendNumber(&out.rest, PackCoefficient(splats.at(i, ShRow(k, c)),
                                                k < 4 ? kBitsOfDegree1 : kBitsOfHigher));
      }
    }
  }
  return out;
}

std::string Header(uint32_t version, const ViewerScene& scene, int fractional_bits, int streams) {
  std::string out;
  AppendNumber(&out, kMagic);
  AppendNumber(&out, version);
  AppendNumber(&out, static_cast<uint32_t>(scene.splats.size()));
  AppendNumber(&out, static_cast<uint8_t>(scene.sh_degree));
  AppendNumber(&out, static_cast<uint8_t>(fractional_bits));
  AppendNumber(&out, scene.antialiased ? kAntialiased : uint8_t{0});
  AppendNumber(&out, static_cast<uint8_t>(streams));
  return out;
}

constexpr size_t kPiece = size_t{1} << 20;  // that is compressed between looks at the token

absl::StatusOr<std::string> Gzip(const std::string& bytes, const CancelToken& cancel) {
  z_stream stream{};
  constexpr int kGzip = 16 + MAX_WBITS;
  // The level that is zlib's default: 9 takes 6 to 13 times as long for 2.5 % less.
  constexpr int kLevel = 6;
  if (deflateInit2(&stream, kLevel, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
    return absl::InternalError("zlib cannot start");
  }
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  constexpr size_t kMostRoom = size_t{1} << 30;  // zlib counts in 32 bits
  size_t in_at = 0, out_at = 0;
  int result = Z_OK;
  while (result == Z_OK && !cancel.IsCancelled()) {
    const size_t in = std::min(kPiece, bytes.size() - in_at);
    const size_t room = std::min(kMostRoom, out.size() - out_at);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + in_at));
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + out_at);
    stream.avail_out = static_cast<uInt>(room);
    result = deflate(&stream, in_at + in == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    in_at += in - stream.avail_in;
    out_at += room - stream.avail_out;
  }
  deflateEnd(&stream);
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  if (result != Z_STREAM_END) return absl::InternalError("zlib cannot compress");
  out.resize(out_at);
  return out;
}

absl::StatusOr<std::string> Zstd(const std::string& bytes, const CancelToken& cancel) {
  const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                   ZSTD_freeCCtx);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kZstdLevel);
  ZSTD_CCtx_setPledgedSrcSize(context.get(), bytes.size());
  std::string buffer(ZSTD_compressBound(bytes.size()), '\0');
  ZSTD_outBuffer out{buffer.data(), buffer.size(), 0};
  size_t at = 0, left = 1;
  while (left != 0) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    ZSTD_inBuffer in{bytes.data() + at, std::min(kPiece, bytes.size() - at), 0};
    const bool last = at + in.size == bytes.size();
    left = ZSTD_compressStream2(context.get(), &out, &in, last ? ZSTD_e_end : ZSTD_e_continue);
    if (ZSTD_isError(left)) {
      return absl::InternalError(absl::StrCat("zstd: ", ZSTD_getErrorName(left)));
    }
    at += in.pos;
    if (!last) left = 1;
  }
  buffer.resize(out.pos);
  return buffer;
}

}  // namespace

absl::Status CheckSpzCount(size_t gaussians) {
  if (gaussians <= kMostOfVersion3) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
                   absl::StrCat("format: there are ", gaussians, " Gaussians, and readers of spz ",
                                "take at most ", kMostOfVersion3,
                                "; give a max_splats of that, or take spz-v4"));
}

absl::StatusOr<std::string> EncodeSpz(const ViewerScene& scene) {
  LITAGS_RETURN_IF_ERROR(CheckSpzCount(scene.splats.size()));
  LITAGS_ASSIGN_OR_RETURN(const int bits, FractionalBits(scene.splats));
  const Streams streams = Pack(scene, bits);
  std::string bytes = Header(3, scene, bits, /*streams=*/0);
  for (const std::string* stream : streams.All()) bytes += *stream;
  return Gzip(bytes, scene.cancel);
}

absl::StatusOr<std::string> EncodeSpzV4(const ViewerScene& scene) {
  LITAGS_ASSIGN_OR_RETURN(const int bits, FractionalBits(scene.splats));
  const Streams streams = Pack(scene, bits);
  const auto all = streams.All();
  const size_t count = scene.sh_degree > 0 ? all.size() : all.size() - 1;
  std::string out = Header(4, scene, bits, static_cast<int>(count)), data;
  AppendNumber(&out, uint32_t{32});  // where the table of streams begins
  out.append(12, '\0');
  for (size_t i = 0; i < count; ++i) {
    LITAGS_ASSIGN_OR_RETURN(const std::string packed, Zstd(*all[i], scene.cancel));
    AppendNumber(&out, uint64_t{packed.size()});
    AppendNumber(&out, uint64_t{all[i]->size()});
    data += packed;
  }
  return out + data;
}

}  // namespace litags
