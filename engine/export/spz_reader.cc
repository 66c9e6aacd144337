#include <zlib.h>
#include <zstd.h>

#include <cmath>

#include "engine/core/error.h"
#include "engine/export/quantize.h"
#include "engine/export/readers.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

struct Header {
  uint32_t magic, version, count;
  uint8_t degree, fractional_bits, flags, streams;

  bool Read(ByteReader* reader) {
    return reader->Read(&magic) && reader->Read(&version) && reader->Read(&count) &&
           reader->Read(&degree) && reader->Read(&fractional_bits) && reader->Read(&flags) &&
           reader->Read(&streams) && magic == 0x5053474e && degree <= 3 && count < (1u << 28);
  }
};

// Bytes of the six attributes, in their order.
std::array<size_t, 6> Sizes(const Header& header) {
  const size_t n = header.count;
  return {9 * n, n, 3 * n, 3 * n, 4 * n, 3 * n * (ShCount(header.degree) - 1)};
}

absl::StatusOr<std::string> Gunzip(std::string_view bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK) return Corrupt("zlib cannot start");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string out;
  std::string piece(1 << 20, '\0');
  int result = Z_OK;
  while (result == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    stream.avail_out = static_cast<uInt>(piece.size());
    result = inflate(&stream, Z_NO_FLUSH);
    out.append(piece.data(), piece.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (result != Z_STREAM_END) return Corrupt("an .spz is no whole gzip file");
  return out;
}

// All attributes in one run, as version 3 has them.
absl::StatusOr<std::string> Unzstd(std::string_view bytes, const Header& header) {
  ByteReader reader(bytes);
  uint32_t table;
  if (!reader.Skip(16) || !reader.Read(&table) || table > bytes.size() || header.streams > 6) {
    return Corrupt("an .spz without a table of streams");
  }
  ByteReader entries(bytes.substr(table));
  size_t at = table + size_t{16} * header.streams;
  std::string out;
  for (int i = 0; i < header.streams; ++i) {
    uint64_t packed, size;
    if (!entries.Read(&packed) || !entries.Read(&size) || at > bytes.size() ||
        packed > bytes.size() - at || size != Sizes(header)[i]) {
      return Corrupt("an .spz with a wrong table of streams");
    }
    const size_t before = out.size();
    out.resize(before + size);
    if (ZSTD_decompress(out.data() + before, size, bytes.data() + at, packed) != size) {
      return Corrupt("an .spz with a broken stream");
    }
    at += packed;
  }
  return out;
}

std::array<float, 4> UnpackQuat(uint32_t word) {  // wxyz
  SmallestThree three{static_cast<int>(word >> 30), {}};
  for (int k = 0; k < 3; ++k) {
    const uint32_t part = word >> (20 - 10 * k) & 1023;
    const double size = (part & 511) / 511.0 * std::sqrt(0.5);
    three.rest[k] = static_cast<float>(part & 512 ? -size : size);
  }
  const std::array<float, 4> q = AddLargest(three);
  return {q[3], q[0], q[1], q[2]};
}

ViewerScene Unpack(const Header& header, std::string_view data) {
  ViewerScene scene;
  scene.sh_degree = header.degree;
  scene.antialiased = header.flags & 1;
  scene.splats.Resize(header.count);
  const auto* p = reinterpret_cast<const uint8_t*>(data.data());
  const auto sizes = Sizes(header);
  const uint8_t *positions = p, *opacities = positions + sizes[0], *colors = opacities + sizes[1];
  const uint8_t *scales = colors + sizes[2], *quats = scales + sizes[3], *rest = quats + sizes[4];
  for (size_t i = 0; i < header.count; ++i) {
    for (size_t k = 0; k < 3; ++k) {
      const uint8_t* b = positions + 9 * i + 3 * k;
      const int32_t fixed =
          static_cast<int32_t>(uint32_t{b[0]} << 8 | uint32_t{b[1]} << 16 | uint32_t{b[2]} << 24) >>
          8;
      scene.splats.at(i, kMean + k) = static_cast<float>(
          std::ldexp(double{static_cast<float>(fixed)}, -header.fractional_bits));
      scene.splats.at(i, kShDc + k) = static_cast<float>((colors[3 * i + k] / 255.0 - 0.5) / 0.15);
      scene.splats.at(i, kLogScale + k) = static_cast<float>(scales[3 * i + k] / 16.0 - 10);
    }
    SetOpacity(&scene.splats, i, opacities[i] / 255.0);
    uint32_t word;
    std::memcpy(&word, quats + 4 * i, 4);
    SetQuat(&scene.splats, i, UnpackQuat(word));
    const size_t coefficients = ShCount(header.degree) - 1;
    for (size_t k = 0; k < coefficients; ++k) {
      for (size_t c = 0; c < 3; ++c) {
        scene.splats.at(i, ShRow(static_cast<int>(k) + 1, static_cast<int>(c))) =
            static_cast<float>((rest[3 * (coefficients * i + k) + c] - 128) / 128.0);
      }
    }
  }
  return scene;
}

}  // namespace

absl::StatusOr<ViewerScene> DecodeSpz(std::string_view bytes) {
  Header header;
  std::string data;
  if (bytes.starts_with("NGSP")) {
    ByteReader reader(bytes);
    if (!header.Read(&reader) || header.version != 4) return Corrupt("no .spz of version 4");
    LITAGS_ASSIGN_OR_RETURN(data, Unzstd(bytes, header));
  } else {
    LITAGS_ASSIGN_OR_RETURN(data, Gunzip(bytes));
    ByteReader reader(data);
    if (!header.Read(&reader) || header.version != 3) return Corrupt("no .spz of version 3");
    data.erase(0, 16);
  }
  size_t expected = 0;
  for (size_t size : Sizes(header)) expected += size;
  if (data.size() != expected) return Corrupt("an .spz of a wrong length");
  return Unpack(header, data);
}

}  // namespace litags
