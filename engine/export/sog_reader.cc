#include <webp/decode.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/export/quantize.h"
#include "engine/export/readers.h"

namespace litags {
namespace {

struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;
  const uint8_t* at(size_t i) const { return rgba.data() + 4 * i; }
};

absl::StatusOr<Picture> ReadPicture(std::string_view zip, const std::string& name) {
  const std::string_view bytes = StoredFile(zip, name);
  Picture picture;
  uint8_t* rgba = WebPDecodeRGBA(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(),
                                 &picture.width, &picture.height);
  if (rgba == nullptr) return Corrupt("a .sog without " + name);
  picture.rgba.assign(rgba, rgba + size_t{4} * picture.width * picture.height);
  WebPFree(rgba);
  return picture;
}

// Picture `index` of a part, with a pixel for each of `count`.
absl::StatusOr<Picture> PictureOf(std::string_view zip, const nlohmann::json& meta,
                                  const char* part, size_t index, size_t count) {
  LITAGS_ASSIGN_OR_RETURN(Picture picture,
                          ReadPicture(zip, meta[part]["files"][index].get<std::string>()));
  if (picture.rgba.size() < 4 * count) return Corrupt("a .sog with too small a picture");
  return picture;
}

absl::Status ReadHarmonics(std::string_view zip, const nlohmann::json& meta, ViewerScene* scene) {
  scene->sh_degree = 0;
  if (!meta.contains("shN")) return absl::OkStatus();
  scene->sh_degree = meta["shN"]["bands"];
  const size_t coefficients = ShCount(scene->sh_degree) - 1, count = meta["shN"]["count"];
  const std::vector<float> codebook = meta["shN"]["codebook"];
  LITAGS_ASSIGN_OR_RETURN(const Picture centers,
                          PictureOf(zip, meta, "shN", 0, count * coefficients));
  LITAGS_ASSIGN_OR_RETURN(const Picture labels,
                          PictureOf(zip, meta, "shN", 1, scene->splats.size()));
  if (centers.width != static_cast<int>(64 * coefficients) || codebook.size() != 256) {
    return Corrupt("a .sog with a wrong palette");
  }
  for (size_t i = 0; i < scene->splats.size(); ++i) {
    const size_t label = labels.at(i)[0] + 256 * labels.at(i)[1];
    if (label >= count) return Corrupt("a .sog with a wrong label");
    for (size_t k = 0; k < coefficients; ++k) {
      for (int c = 0; c < 3; ++c) {
        scene->splats.at(i, ShRow(static_cast<int>(k) + 1, c)) =
            codebook[centers.at(label * coefficients + k)[c]];
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ViewerScene> DecodeSog(std::string_view bytes) {
  const auto meta = ParseJson(StoredFile(bytes, "meta.json"));
  if (!meta.is_object() || meta.value("version", 0) != 2) return Corrupt("no .sog of version 2");
  const size_t count = meta["count"];
  ViewerScene scene;
  scene.antialiased = meta.value("antialias", false);
  scene.splats.Resize(count);
  LITAGS_ASSIGN_OR_RETURN(const Picture low, PictureOf(bytes, meta, "means", 0, count));
  LITAGS_ASSIGN_OR_RETURN(const Picture high, PictureOf(bytes, meta, "means", 1, count));
  LITAGS_ASSIGN_OR_RETURN(const Picture quats, PictureOf(bytes, meta, "quats", 0, count));
  LITAGS_ASSIGN_OR_RETURN(const Picture scales, PictureOf(bytes, meta, "scales", 0, count));
  LITAGS_ASSIGN_OR_RETURN(const Picture colors, PictureOf(bytes, meta, "sh0", 0, count));
  const std::vector<float> sizes = meta["scales"]["codebook"], dcs = meta["sh0"]["codebook"];
  const std::vector<double> min = meta["means"]["mins"], max = meta["means"]["maxs"];
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double code = low.at(i)[k] + 256.0 * high.at(i)[k];
      const double v = min[k] + (max[k] - min[k]) * code / 65535;
      scene.splats.at(i, kMean + k) = static_cast<float>(std::copysign(std::expm1(std::abs(v)), v));
      scene.splats.at(i, kLogScale + k) = sizes[scales.at(i)[k]];
      scene.splats.at(i, kShDc + k) = dcs[colors.at(i)[k]];
    }
    SetOpacity(&scene.splats, i, colors.at(i)[3] / 255.0);
    SmallestThree three{quats.at(i)[3] - 252, {}};
    if (three.largest < 0) return Corrupt("a .sog with a wrong rotation");
    for (int k = 0; k < 3; ++k) {
      three.rest[k] = static_cast<float>((quats.at(i)[k] / 255.0 - 0.5) * std::sqrt(2.0));
    }
    SetQuat(&scene.splats, i, AddLargest(three));
  }
  LITAGS_RETURN_IF_ERROR(ReadHarmonics(bytes, meta, &scene));
  return scene;
}

}  // namespace litags
