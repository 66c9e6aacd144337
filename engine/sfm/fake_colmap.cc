#include "engine/sfm/fake_colmap.h"

#include <sqlite3.h>
#include <stdlib.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/check.h"
#include "engine/core/image.h"
#include "engine/io/colmap_io.h"
#include "engine/io/picture_io.h"
#include "engine/sfm/walk_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kCall = "CALL ";

// FAKE becomes the folder. The rung is the folder that the database lies in, the only one that may
// be written to.
constexpr char kScript[] = R"sh(#!/bin/sh
fake='FAKE'
if [ "$1" = help ]; then
  echo "COLMAP $(cat "$fake/version") -- a fake"
  exit
fi
note() { echo "CALL $*"; }
note "$@"
command=$1
shift
while [ $# -gt 1 ]; do
  case $1 in
    --database_path) db=$2 ;;
    --image_path) images=$2 ;;
    --image_list_path) list=$2 ;;
    --input_path) in=$2 ;;
    --output_path) out=$2 ;;
  esac
  shift 2
done
room=$(dirname "$db")
rung=$(basename "$room")
if [ -f "$fake/on_$command" ]; then . "$fake/on_$command"; fi
case $command in
  feature_extractor) cp "${found:-$fake/database.db}" "$db" ;;
  mapper) if [ -d "$fake/models_$rung" ]; then cp -r "$fake/models_$rung/." "$out"; fi ;;
esac
)sh";

void WriteScript(const fs::path& path, const std::string& text) {
  std::ofstream(path) << text;
  fs::permissions(path, fs::perms::owner_all);
}

void WriteModel(const fs::path& dir, const SparseModel& model) {
  fs::create_directories(dir);
  LITAGS_CHECK(WriteColmapModel(dir, model).ok());
}

std::string HexDescriptors(int count) {
  const std::vector<uint8_t> descriptors = PhotoOfFeatures(0, count);
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(descriptors.data()), descriptors.size()});
}

std::string HexKeypoints(const std::vector<std::array<float, 2>>& keypoints) {
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(keypoints.data()), keypoints.size() * 2 * sizeof(float)});
}

}  // namespace

FakeColmap::FakeColmap() {
  dir_ = (fs::temp_directory_path() / "litags_sfm_XXXXXX").string();
  LITAGS_CHECK(mkdtemp(dir_.data()) != nullptr);
  std::string script = kScript;
  script.replace(script.find("FAKE"), 4, dir_);
  WriteScript(program(), script);
  SetVersion("3.8");
}

FakeColmap::~FakeColmap() { fs::remove_all(dir_); }

void FakeColmap::SetVersion(const std::string& version) const {
  std::ofstream(dir_ + "/version") << version << "\n";
}

std::string FakeColmap::MakePhotos(int count, int width, int height, int level) const {
  const std::string photos = dir_ + "/photos";
  fs::create_directories(photos);
  ImageU8 image(width, height);
  for (size_t i = 0; i < image.data.size(); ++i) {
    image.data[i] = static_cast<uint8_t>(std::clamp<int>(level + int(i * 7919 % 9) - 4, 0, 255));
  }
  for (int i = 0; i < count; ++i) {
    LITAGS_CHECK(WritePng(absl::StrCat(photos, "/p", i, ".png"), image).ok());
  }
  return photos;
}

void FakeColmap::On(const std::string& command, const std::string& shell_code) const {
  std::ofstream(dir_ + "/on_" + command) << shell_code << "\n";
}

void FakeColmap::SetDatabase(const std::vector<std::string>& names, int features,
                             const std::vector<std::pair<int, int>>& pairs) const {
  fs::remove(database());
  // The columns of COLMAP 3.8 that we use.
  std::string sql =
      "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER, width INTEGER, height "
      "INTEGER, params BLOB, prior_focal_length INTEGER);"
      "CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER);"
      "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data "
      "BLOB);"
      "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data "
      "BLOB);"
      "CREATE TABLE matches (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
      "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows INTEGER, config "
      "INTEGER);"
      "INSERT INTO cameras VALUES (1, 1, 64, 48, NULL, 0);";
  const std::string descriptors = HexDescriptors(features);
  for (size_t i = 0; i < names.size(); ++i) {
    absl::StrAppendFormat(&sql, "INSERT INTO images VALUES (%d, '%s', 1);", i + 1, names[i]);
    absl::StrAppendFormat(&sql, "INSERT INTO keypoints VALUES (%d, %d, 2, x'%s');", i + 1, features,
                          HexKeypoints(std::vector<std::array<float, 2>>(features, {30, 20})));
    absl::StrAppendFormat(&sql, "INSERT INTO descriptors VALUES (%d, %d, 128, x'%s');", i + 1,
                          features, descriptors);
  }
  for (const auto& [a, b] : pairs) {
    const int64_t pair_id = int64_t{2147483647} * (a + 1) + (b + 1);
    absl::StrAppendFormat(&sql, "INSERT INTO two_view_geometries VALUES (%d, 100, 2);", pair_id);
  }
  Execute(sql);
}

void FakeColmap::SeeWorldPoints(const std::vector<Camera>& cameras, int features) const {
  std::string sql;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    std::vector<std::array<float, 2>> keypoints;
    for (int k = 0; k < features; ++k) {
      const auto p = c.CamFromWorld(FakeWorldPoint(k));
      keypoints.push_back({static_cast<float>(c.fx * p[0] / p[2] + c.cx),
                           static_cast<float>(c.fy * p[1] / p[2] + c.cy)});
    }
    absl::StrAppendFormat(&sql, "UPDATE keypoints SET data = x'%s' WHERE image_id = %d;",
                          HexKeypoints(keypoints), i + 1);
  }
  Execute(sql);
}

void FakeColmap::Execute(const std::string& sql) const {
  sqlite3* db = nullptr;
  LITAGS_CHECK(sqlite3_open(database().c_str(), &db) == SQLITE_OK);
  LITAGS_CHECK(sqlite3_exec(db, "PRAGMA synchronous = OFF", nullptr, nullptr, nullptr) ==
               SQLITE_OK);
  LITAGS_CHECK(sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
  sqlite3_close(db);
}

void FakeColmap::AddModel(int rung, int number, const SparseModel& model) const {
  WriteModel(absl::StrCat(dir_, "/models_", rung, "/", number), model);
}

void FakeColmap::Hear(std::string_view line) {
  std::lock_guard lock(mutex_);
  if (line.starts_with(kCall)) calls_.emplace_back(line.substr(kCall.size()));
}

std::vector<std::string> FakeColmap::Calls() const {
  std::lock_guard lock(mutex_);
  return calls_;
}

SparseModel CopiesModel(const std::string& folder, int width, int height,
                        const std::vector<int>& photos, int points) {
  SparseModel model;
  for (const int i : photos) {
    Camera camera = {.width = width, .height = height, .fx = 50, .fy = 50};
    camera.cx = width / 2.0;
    camera.cy = height / 2.0;
    camera.t = {double(i), 0, 0};
    model.views.push_back({absl::StrFormat("%s/%06d.png", folder, i), camera});
    model.distortions.push_back({});
  }
  for (int p = 0; p < points; ++p) {
    SparsePoint point;
    point.xyz = {double(p), 0, 5};
    for (size_t v = 0; v < photos.size(); ++v) point.track.push_back({int(v), 10, 20});
    model.points.push_back(point);
  }
  return model;
}

std::array<double, 3> FakeWorldPoint(int i) {
  return {2.0 * (i % 30) - 30, 2.0 * (i / 30) - 30, 90.0 + i % 7};
}

}  // namespace litags
