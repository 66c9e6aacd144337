// SOG version 2: a pixel of each picture is a Gaussian; sizes, colours and higher harmonics are
// places in lists of values.
#include <webp/encode.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/export/codebook.h"
#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/export/zip.h"

namespace litags {
namespace {

constexpr int kCentersPerRow = 64;
constexpr int kEffort = 4;  // of libwebp, 0..6; above, seconds for a hundredth of the size
// Gaussians that share their higher harmonics, on average: docs/export.md has what it costs.
constexpr size_t kSplatsPerCenter = 4;

struct Picture {
  int width, height;
  std::vector<uint8_t> rgba;

  Picture(int w, int h) : width(w), height(h), rgba(size_t{4} * w * h, 255) {}
  uint8_t* at(size_t i) { return rgba.data() + 4 * i; }
};

// Room for `count` pixels, about square.
Picture PictureFor(size_t count) {
  const auto side = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(count))));
  const int width = std::max(4, (side + 3) / 4 * 4);
  const int rows = static_cast<int>((count + width - 1) / width);
  return Picture(width, std::max(4, (rows + 3) / 4 * 4));
}

absl::StatusOr<std::string> EncodeWebp(const Picture& picture) {
  WebPConfig config;
  WebPPicture input;
  WebPMemoryWriter writer;
  if (!WebPConfigInit(&config) || !WebPPictureInit(&input)) {
    return absl::InternalError("libwebp is another version than the one built against");
  }
  config.lossless = 1;
  config.exact = 1;  // colours where alpha is 0, too
  config.method = kEffort;
  config.quality = 75;
  input.use_argb = 1;
  input.width = picture.width;
  input.height = picture.height;
  WebPMemoryWriterInit(&writer);
  input.writer = WebPMemoryWrite;
  input.custom_ptr = &writer;
  const bool ok = WebPPictureImportRGBA(&input, picture.rgba.data(), 4 * picture.width) &&
                  WebPEncode(&config, &input);
  std::string out(reinterpret_cast<const char*>(writer.mem), ok ? writer.size : 0);
  WebPMemoryWriterClear(&writer);
  WebPPictureFree(&input);
  if (!ok)
    return absl::InternalError(absl::StrCat("libwebp: error ", static_cast<int>(input.error_code)));
  return out;
}

// The files, and what meta.json says of them.
struct Bundle {
  const CancelToken& cancel;
  std::vector<std::pair<std::string, std::string>> files;
  nlohmann::json meta;

  absl::Status Add(const char* part, const char* name, const Picture& picture) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    auto bytes = EncodeWebp(picture);
    if (!bytes.ok()) return bytes.status();
    meta[part]["files"].push_back(name);
    files.emplace_back(name, *std::move(bytes));
    return absl::OkStatus();
  }
};

double LogOf(double v) { return std::copysign(std::log1p(std::abs(v)), v); }

absl::Status AddMeans(const Splats& splats, Bundle* bundle) {
  std::array<double, 3> min, max;
  for (int k = 0; k < 3; ++k) {
    min[k] = max[k] = LogOf(splats.at(0, kMean + k));
    for (size_t i = 1; i < splats.size(); ++i) {
      min[k] = std::min(min[k], LogOf(splats.at(i, kMean + k)));
      max[k] = std::max(max[k], LogOf(splats.at(i, kMean + k)));
    }
  }
  Picture low = PictureFor(splats.size()), high = low;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const double range = max[k] - min[k];
      const uint32_t code =
          PackUnit(range > 0 ? (LogOf(splats.at(i, kMean + k)) - min[k]) / range : 0, 16);
      low.at(i)[k] = static_cast<uint8_t>(code);
      high.at(i)[k] = static_cast<uint8_t>(code >> 8);
    }
  }
  bundle->meta["means"] = {{"mins", min}, {"maxs", max}};
  LITAGS_RETURN_IF_ERROR(bundle->Add("means", "means_l.webp", low));
  return bundle->Add("means", "means_u.webp", high);
}

absl::Status AddQuats(const Splats& splats, Bundle* bundle) {
  Picture picture = PictureFor(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    const SmallestThree three = DropLargest(UnitQuat(splats, i));
    for (int k = 0; k < 3; ++k) {
      picture.at(i)[k] = PackByte(255 * (three.rest[k] * std::sqrt(0.5) + 0.5));
    }
    picture.at(i)[3] = static_cast<uint8_t>(252 + three.largest);
  }
  return bundle->Add("quats", "quats.webp", picture);
}

// Three rows of each Gaussian as places in a list; `alpha(i)` beside them.
template <typename F>
absl::Status AddListed(const Splats& splats, int row, const char* part, const char* name, F&& alpha,
                       Bundle* bundle) {
  std::vector<float> values;
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) values.push_back(splats.at(i, row + k));
  }
  const Codebook codebook(std::move(values));
  Picture picture = PictureFor(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) picture.at(i)[k] = codebook.Nearest(splats.at(i, row + k));
    picture.at(i)[3] = alpha(i);
  }
  bundle->meta[part]["codebook"] = codebook.values();
  return bundle->Add(part, name, picture);
}

absl::Status AddHarmonics(const ViewerScene& scene, Bundle* bundle) {
  const Splats& splats = scene.splats;
  const int coefficients = ShCount(scene.sh_degree) - 1;
  if (coefficients == 0) return absl::OkStatus();
  std::vector<float> points;
  points.reserve(splats.size() * coefficients * 3);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 1; k <= coefficients; ++k) {
      for (int c = 0; c < 3; ++c) points.push_back(splats.at(i, ShRow(k, c)));
    }
  }
  const Palette palette =
      MakePalette(points, 3 * coefficients,
                  std::max<size_t>(1024, splats.size() / kSplatsPerCenter), scene.cancel);
  const Codebook codebook(palette.centers);
  Picture centers(kCentersPerRow * coefficients,
                  static_cast<int>((palette.count + kCentersPerRow - 1) / kCentersPerRow));
  for (size_t g = 0; g < palette.count; ++g) {
    // Centres stand side by side, so their coefficients are one run.
    for (int k = 0; k < coefficients; ++k) {
      for (int c = 0; c < 3; ++c) {
        centers.at(g * coefficients + k)[c] =
            codebook.Nearest(palette.centers[(g * coefficients + k) * 3 + c]);
      }
    }
  }
  Picture labels = PictureFor(splats.size());
  for (size_t i = 0; i < splats.size(); ++i) {
    labels.at(i)[0] = static_cast<uint8_t>(palette.labels[i]);
    labels.at(i)[1] = static_cast<uint8_t>(palette.labels[i] >> 8);
    labels.at(i)[2] = 0;
  }
  bundle->meta["shN"] = {
      {"count", palette.count}, {"bands", scene.sh_degree}, {"codebook", codebook.values()}};
  LITAGS_RETURN_IF_ERROR(bundle->Add("shN", "shN_centroids.webp", centers));
  return bundle->Add("shN", "shN_labels.webp", labels);
}

}  // namespace

absl::StatusOr<std::string> EncodeSog(const ViewerScene& scene) {
  const Splats& splats = scene.splats;
  Bundle bundle{scene.cancel,
                {},
                {{"version", 2},
                 {"asset", {{"generator", "litags"}}},
                 {"count", splats.size()},
                 {"antialias", scene.antialiased}}};
  LITAGS_RETURN_IF_ERROR(AddMeans(splats, &bundle));
  LITAGS_RETURN_IF_ERROR(AddQuats(splats, &bundle));
  LITAGS_RETURN_IF_ERROR(AddListed(
      splats, kLogScale, "scales", "scales.webp", [](size_t) { return uint8_t{255}; }, &bundle));
  LITAGS_RETURN_IF_ERROR(AddListed(
      splats, kShDc, "sh0", "sh0.webp",
      [&](size_t i) { return PackByte(255 * Opacity(splats, i)); }, &bundle));
  LITAGS_RETURN_IF_ERROR(AddHarmonics(scene, &bundle));
  bundle.files.insert(bundle.files.begin(), {"meta.json", JsonText(bundle.meta)});
  return StoredZip(bundle.files);
}

}  // namespace litags
