#include "engine/tools/table/cell.h"

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/fingerprint.h"

namespace litags {
namespace {

constexpr int64_t kMaxRowBytes = int64_t{16} << 20;
constexpr int64_t kMaxFileBytes = int64_t{2} << 30;

// Of the names and bytes of photos.
void AddPhotos(const std::string& dir, const std::vector<std::string>& photos, Fingerprint* f) {
  for (const std::string& photo : photos) {
    f->Add(photo.data(), photo.size());
    f->AddFileIfReadable(absl::StrCat(dir, "/", photo), kMaxFileBytes);
  }
}

std::string FileKey(const std::string& path) {
  Fingerprint f;
  f.AddFileIfReadable(path, kMaxFileBytes);
  return absl::StrCat(path, " ", f.Text());
}

}  // namespace

std::string TableCell::Name() const {
  return absl::StrCat(scene_.name, "/", light_, "/", method_.name);
}

std::string TableCell::RunDirOf(const std::string& method) const {
  return absl::StrCat(options_.out, "/runs/", scene_.name, "/", photos_light(), "/", method);
}

std::string TableCell::CamerasDir() const {
  return absl::StrCat(options_.out, "/cameras/", scene_.name, "/", photos_light());
}

std::string TableCell::MasksDir() const {
  const std::string dir = CamerasDir() + "/masks";
  std::error_code ignored;
  return std::filesystem::is_directory(dir, ignored) ? dir : std::string();
}

TableRow TableCell::EmptyRow() const {
  TableRow row;
  row.scene = scene_.name;
  row.light = light_;
  row.method = method_.name;
  row.build = BuildId();
  return row;
}

absl::StatusOr<std::string> TableCell::TrainingKey() const {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> photos,
                          scene_.TrainingPhotos(photos_light()));
  Fingerprint f;
  AddPhotos(scene_.PhotosDir(photos_light()), photos, &f);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    f.AddFileIfReadable(absl::StrCat(CamerasDir(), "/cameras/", name), kMaxFileBytes);
  }
  if (const std::string masks = MasksDir(); !masks.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, ListPhotos(masks, "masks"));
    AddPhotos(masks, names, &f);
  }
  return absl::StrCat(method_.trained_as, " ", f.Text(), " ", EnhancerKey(method_.before), " ",
                      options_.settings);
}

absl::StatusOr<std::string> TableCell::RowKey() const {
  LITAGS_ASSIGN_OR_RETURN(const std::string training, TrainingKey());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, scene_.TestViews());
  Fingerprint f;
  for (const TestView& view : views) {
    const std::string& name = view.view.name;
    f.Add(name.data(), name.size());
    const absl::StatusOr<std::string> truth = FindPhoto(scene_.TruthDir(), name);
    if (truth.ok()) f.AddFileIfReadable(*truth, kMaxFileBytes);
    const Camera& camera = view.view.camera;
    f.Add(std::array{camera.width, camera.height});
    f.Add(std::array{camera.fx, camera.fy, camera.cx, camera.cy});
    f.Add(camera.Viewmat());
    f.Add(view.distortion.Coefficients());
    f.Add(view.distortion.fisheye);
  }
  return absl::StrCat(
      training, " ", f.Text(), " ", EnhancerKey(method_.after), " ",
      options_.lpips.empty() ? "" : FileKey(options_.lpips),
      options_.flicker_frames > 0 ? absl::StrCat(" flicker ", options_.flicker_frames) : "");
}

absl::StatusOr<Enhancer> TableCell::MakeEnhancer(const std::string& name) const {
  for (const Enhancer& enhancer : BuiltinEnhancers()) {
    if (enhancer.name == name) return enhancer;
  }
  for (const OnnxEnhancerOptions& enhancer : options_.enhancers) {
    if (enhancer.name == name) return MakeOnnxEnhancer(enhancer);
  }
  return absl::InternalError(absl::StrCat("no enhancer ", name));
}

std::string TableCell::EnhancerKey(const std::string& name) const {
  for (const OnnxEnhancerOptions& e : options_.enhancers) {
    if (e.name == name) return absl::StrCat(e.text, " ", FileKey(e.path));
  }
  return name;
}

absl::Status KeepRow(const std::string& path, const std::string& key, const TableRow& row) {
  // The row's own text, so that rows have one format only.
  const nlohmann::json json = {{"key", key}, {"row", row.ToJson()}};
  return WriteFileAtomically(path, JsonText(json, 1) + "\n");
}

std::optional<TableRow> KeptRow(const std::string& path, const std::string& key) {
  const auto text = ReadFile(path, path, kMaxRowBytes);
  if (!text.ok()) return std::nullopt;
  const auto json = ParseJson(*text);
  if (!json.is_object() || json.value("key", nlohmann::json()) != key) return std::nullopt;
  const nlohmann::json row = json.value("row", nlohmann::json());
  if (!row.is_string()) return std::nullopt;
  const auto parsed = ParseTableRow(row.get<std::string>(), path);
  return parsed.ok() ? std::optional<TableRow>(*parsed) : std::nullopt;
}

std::string BuildId() {
  static const std::string* const kId = [] {
    Fingerprint f;
    f.AddFileIfReadable("/proc/self/exe", kMaxFileBytes);
    return new std::string(f.Text());
  }();
  return *kId;
}

}  // namespace litags
