#include "engine/export/readers.h"

#include <algorithm>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/splats.h"
#include "engine/io/byte_reader.h"
#include "engine/io/ply.h"

namespace litags {

void SetOpacity(Splats* splats, size_t i, double opacity) {
  splats->at(i, kLogitOpacity) = LogitOf(std::clamp(opacity, 1e-6, 1 - 1e-6));
}

void SetQuat(Splats* splats, size_t i, const std::array<float, 4>& quat) {
  for (int k = 0; k < 4; ++k) splats->at(i, kRawQuat + k) = quat[k];
}

std::string_view StoredFile(std::string_view zip, std::string_view name) {
  ByteReader reader(zip);
  uint32_t magic, size;
  uint16_t name_size, extra;
  std::string_view found, content;
  while (reader.Read(&magic) && magic == 0x04034b50) {
    if (!reader.Skip(18) || !reader.Read(&size) || !reader.Read(&name_size) ||
        !reader.Read(&extra) || !reader.ReadBytes(name_size, &found) || !reader.Skip(extra) ||
        !reader.ReadBytes(size, &content)) {
      break;
    }
    if (found == name) return content;
  }
  return {};
}

absl::StatusOr<ViewerScene> DecodeSplat(std::string_view bytes) {
  if (bytes.size() % 32 != 0) return Corrupt("a .splat file has 32 bytes a Gaussian");
  ByteReader reader(bytes);
  ViewerScene scene;
  scene.sh_degree = 0;
  scene.splats.Resize(bytes.size() / 32);
  for (size_t i = 0; i < scene.splats.size(); ++i) {
    float value;
    for (int row : {kMean, kLogScale}) {
      for (int k = 0; k < 3; ++k) {
        if (!reader.Read(&value)) return Corrupt("a .splat file ends early");
        scene.splats.at(i, row + k) = row == kMean ? value : std::log(value);
      }
    }
    uint8_t codes[8];
    for (uint8_t& code : codes) {
      if (!reader.Read(&code)) return Corrupt("a .splat file ends early");
    }
    for (int k = 0; k < 3; ++k) {
      scene.splats.at(i, kShDc + k) = static_cast<float>((codes[k] / 255.0 - 0.5) / kSh0);
    }
    SetOpacity(&scene.splats, i, codes[3] / 255.0);
    for (int k = 0; k < 4; ++k) {
      scene.splats.at(i, kRawQuat + k) = static_cast<float>((codes[4 + k] - 128) / 128.0);
    }
  }
  return scene;
}

absl::StatusOr<ViewerScene> ReadExported(SceneFormat format, const std::string& bytes) {
  switch (format) {
    case SceneFormat::kPly: {
      LITAGS_ASSIGN_OR_RETURN(PlyScene ply, DecodePly(bytes, "file"));
      ViewerScene scene;
      scene.splats = std::move(ply.splats);
      scene.sh_degree = ply.sh_degree;
      return scene;
    }
    case SceneFormat::kCompressedPly:
      return DecodeCompressedPly(bytes);
    case SceneFormat::kSplat:
      return DecodeSplat(bytes);
    case SceneFormat::kSpz:
    case SceneFormat::kSpzV4:
      return DecodeSpz(bytes);
    case SceneFormat::kSog:
      return DecodeSog(bytes);
    case SceneFormat::kGlb:
      return DecodeGlb(bytes);
    case SceneFormat::kUsda:
      return DecodeUsda(bytes);
    case SceneFormat::kHtml:
      return DecodeHtml(bytes);
    case SceneFormat::kColmap:
    case SceneFormat::kPoints:
    case SceneFormat::kLas:
    case SceneFormat::kMeshPly:
    case SceneFormat::kMeshGlb:
      break;
  }
  return Corrupt("the file holds no Gaussians");
}

}  // namespace litags
