#include "engine/sfm/colmap_database.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/sfm/colmap_keypoints.h"

namespace litags {
namespace {

// COLMAP numbers a pair as kMaxImages * smaller id + larger id.
constexpr int64_t kMaxImages = 2147483647;
constexpr int kAside = 1 << 30;             // above all numbers of images, below kMaxImages
constexpr int64_t kMaxKeypointColumns = 6;  // x y and the shape
// COLMAP's TwoViewGeometry: planar, panoramic, one of the two.
constexpr int kFirstFlat = 4, kLastFlat = 6;

struct CloseDatabase {
  void operator()(sqlite3* db) const { sqlite3_close_v2(db); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

class Database {
 public:
  explicit Database(const std::string& path) : path_(path) {}

  absl::Status Open(int flags) {
    sqlite3* db = nullptr;
    const int code = sqlite3_open_v2(path_.c_str(), &db, flags, nullptr);
    db_.reset(db);
    if (code != SQLITE_OK) return Error(sqlite3_errmsg(db_.get()));
    return Execute("PRAGMA synchronous = OFF");  // as COLMAP: after a crash it is made anew
  }

  absl::StatusOr<Statement> Prepare(std::string_view sql) {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(db_.get(), sql.data(), static_cast<int>(sql.size()), &statement,
                           nullptr) != SQLITE_OK) {
      return Error(sqlite3_errmsg(db_.get()));
    }
    return Statement(statement);
  }

  // True while there are rows.
  absl::StatusOr<bool> Step(const Statement& statement) {
    const int code = sqlite3_step(statement.get());
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) return false;
    return Error(sqlite3_errmsg(db_.get()));
  }

  absl::Status Execute(const char* sql) {
    return sqlite3_exec(db_.get(), sql, nullptr, nullptr, nullptr) == SQLITE_OK
               ? absl::OkStatus()
               : Error(sqlite3_errmsg(db_.get()));
  }

  absl::Status Error(std::string_view problem) const {
    return MakeError(
        absl::StatusCode::kInternal, "COLMAP_DATABASE", "",
        absl::StrCat("COLMAP's database \"", path_, "\" cannot be used: ", std::string(problem),
                     "; check that COLMAP 3.8 is installed and the disk has room"));
  }

 private:
  const std::string path_;
  std::unique_ptr<sqlite3, CloseDatabase> db_;
};

}  // namespace

absl::StatusOr<std::vector<DatabaseImage>> ReadDatabaseImages(const std::string& path) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READONLY));
  LITAGS_ASSIGN_OR_RETURN(
      const Statement statement,
      db.Prepare("SELECT images.image_id, name, IFNULL(keypoints.rows, 0) FROM images "
                 "LEFT JOIN keypoints USING (image_id) ORDER BY images.image_id"));
  std::vector<DatabaseImage> images;
  while (true) {
    LITAGS_ASSIGN_OR_RETURN(const bool row, db.Step(statement));
    if (!row) return images;
    const unsigned char* name = sqlite3_column_text(statement.get(), 1);
    images.push_back({.id = sqlite3_column_int(statement.get(), 0),
                      .name = name ? reinterpret_cast<const char*>(name) : "",
                      .features = sqlite3_column_int(statement.get(), 2)});
  }
}

absl::StatusOr<std::vector<VerifiedPair>> ReadVerifiedPairs(const std::string& path) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READONLY));
  LITAGS_ASSIGN_OR_RETURN(
      const Statement statement,
      db.Prepare("SELECT pair_id, config FROM two_view_geometries WHERE rows >= ?"));
  sqlite3_bind_int(statement.get(), 1, kMinInliers);
  std::vector<VerifiedPair> pairs;
  while (true) {
    LITAGS_ASSIGN_OR_RETURN(const bool row, db.Step(statement));
    if (!row) return pairs;
    const int64_t pair = sqlite3_column_int64(statement.get(), 0);
    const int config = sqlite3_column_int(statement.get(), 1);
    pairs.push_back({.id1 = static_cast<int>(pair / kMaxImages),
                     .id2 = static_cast<int>(pair % kMaxImages),
                     .flat = config >= kFirstFlat && config <= kLastFlat});
  }
}

absl::StatusOr<std::vector<std::vector<uint8_t>>> ReadDescriptors(
    const std::string& path, const std::vector<DatabaseImage>& images) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READONLY));
  LITAGS_ASSIGN_OR_RETURN(
      const Statement statement,
      db.Prepare("SELECT rows, cols, data FROM descriptors WHERE image_id = ?"));
  std::vector<std::vector<uint8_t>> descriptors(images.size());
  for (size_t i = 0; i < images.size(); ++i) {
    sqlite3_bind_int(statement.get(), 1, images[i].id);
    LITAGS_ASSIGN_OR_RETURN(const bool found, db.Step(statement));
    const int64_t rows = found ? sqlite3_column_int64(statement.get(), 0) : 0;
    const int64_t bytes = found ? sqlite3_column_bytes(statement.get(), 2) : 0;
    constexpr int64_t kSize = kDescriptorSize;
    if (rows != images[i].features || bytes != rows * kSize ||
        (rows > 0 && sqlite3_column_int64(statement.get(), 1) != kSize)) {
      return db.Error(absl::StrCat("image \"", images[i].name, "\" has ", images[i].features,
                                   " keypoints, but ", rows, " descriptors in ", bytes, " bytes"));
    }
    const auto* data = static_cast<const uint8_t*>(sqlite3_column_blob(statement.get(), 2));
    if (bytes > 0) descriptors[i].assign(data, data + bytes);
    sqlite3_reset(statement.get());
  }
  return descriptors;
}

namespace {

// `query` gives numbers of pairs and their matches.
absl::StatusOr<std::vector<ImageMatches>> SelectMatches(const std::string& path,
                                                        std::string_view query) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READONLY));
  LITAGS_ASSIGN_OR_RETURN(const Statement statement, db.Prepare(query));
  std::vector<ImageMatches> pairs;
  while (true) {
    LITAGS_ASSIGN_OR_RETURN(const bool row, db.Step(statement));
    if (!row) return pairs;
    const int64_t pair = sqlite3_column_int64(statement.get(), 0);
    ImageMatches& matches = pairs.emplace_back();
    matches.id1 = static_cast<int>(pair / kMaxImages);
    matches.id2 = static_cast<int>(pair % kMaxImages);
    const size_t bytes = static_cast<size_t>(sqlite3_column_bytes(statement.get(), 1));
    matches.matches.resize(bytes / sizeof(FeatureMatch));
    std::memcpy(matches.matches.data(), sqlite3_column_blob(statement.get(), 1),
                matches.matches.size() * sizeof(FeatureMatch));
  }
}

}  // namespace

absl::StatusOr<std::vector<ImageMatches>> ReadMatches(const std::string& path) {
  return SelectMatches(path, "SELECT pair_id, data FROM matches WHERE rows > 0 ORDER BY pair_id");
}

absl::StatusOr<std::vector<ImageMatches>> ReadVerifiedMatches(const std::string& path) {
  return SelectMatches(path, absl::StrCat("SELECT pair_id, data FROM two_view_geometries WHERE "
                                          "rows >= ",
                                          kMinInliers, " ORDER BY pair_id"));
}

absl::Status WriteMatches(const std::string& path, const std::vector<ImageMatches>& pairs) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  LITAGS_RETURN_IF_ERROR(db.Execute("BEGIN; DELETE FROM matches"));
  LITAGS_ASSIGN_OR_RETURN(
      const Statement add,
      db.Prepare("INSERT INTO matches (pair_id, rows, cols, data) VALUES (?, ?, 2, ?)"));
  for (const ImageMatches& pair : pairs) {
    sqlite3_bind_int64(add.get(), 1, kMaxImages * pair.id1 + pair.id2);
    sqlite3_bind_int64(add.get(), 2, static_cast<int64_t>(pair.matches.size()));
    sqlite3_bind_blob64(add.get(), 3, pair.matches.data(),
                        pair.matches.size() * sizeof(FeatureMatch), SQLITE_STATIC);
    LITAGS_RETURN_IF_ERROR(db.Step(add).status());
    sqlite3_reset(add.get());
  }
  return db.Execute("COMMIT");
}

absl::Status ForgetVerifiedPairs(const std::string& path) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  return db.Execute("DELETE FROM two_view_geometries");
}

absl::Status CopyForVerification(const std::string& from, const std::string& to) {
  std::error_code error;
  std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing, error);
  Database db(to);
  if (error) return db.Error(error.message());
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  return db.Execute("DELETE FROM descriptors; DELETE FROM two_view_geometries; VACUUM");
}

absl::Status TakeVerifiedPairs(const std::vector<std::string>& from, const std::string& path) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  for (const std::string& other : from) {
    LITAGS_ASSIGN_OR_RETURN(const Statement attach, db.Prepare("ATTACH ? AS share"));
    sqlite3_bind_text(attach.get(), 1, other.c_str(), -1, SQLITE_TRANSIENT);
    LITAGS_RETURN_IF_ERROR(db.Step(attach).status());
    LITAGS_RETURN_IF_ERROR(
        db.Execute("INSERT OR REPLACE INTO main.two_view_geometries "
                   "SELECT * FROM share.two_view_geometries; DETACH share"));
  }
  return absl::OkStatus();
}

namespace {

// COLMAP's camera models. Parameters: focal length, principal point, then `coefficients`, 0 here.
struct CameraModel {
  int id;
  size_t coefficients;
};
constexpr CameraModel kSimpleRadial = {2, 1}, kRadialFisheye = {9, 2};

// `known`: not a guess, which COLMAP verifies matches by.
absl::Status SetCameras(const std::string& path, const FocalLengths& focal_lengths,
                        const CameraModel& model, bool known) {
  if (focal_lengths.empty()) return absl::OkStatus();
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  LITAGS_RETURN_IF_ERROR(db.Execute("BEGIN"));
  const char kWhere[] = "WHERE camera_id = (SELECT camera_id FROM images WHERE name = ?1)";
  LITAGS_ASSIGN_OR_RETURN(const Statement size,
                          db.Prepare(absl::StrCat("SELECT width, height FROM cameras ", kWhere)));
  LITAGS_ASSIGN_OR_RETURN(
      const Statement set,
      db.Prepare(absl::StrCat(
          "UPDATE cameras SET model = ?2, params = ?3, prior_focal_length = ?4 ", kWhere)));
  for (const auto& [name, focal_length] : focal_lengths) {
    sqlite3_bind_text(size.get(), 1, name.c_str(), -1, SQLITE_TRANSIENT);
    LITAGS_ASSIGN_OR_RETURN(const bool found, db.Step(size));
    if (found) {
      std::vector<double> params = {focal_length, sqlite3_column_int(size.get(), 0) / 2.0,
                                    sqlite3_column_int(size.get(), 1) / 2.0};
      params.resize(params.size() + model.coefficients);
      sqlite3_bind_text(set.get(), 1, name.c_str(), -1, SQLITE_TRANSIENT);
      sqlite3_bind_int(set.get(), 2, model.id);
      sqlite3_bind_blob(set.get(), 3, params.data(),
                        static_cast<int>(params.size() * sizeof(double)), SQLITE_TRANSIENT);
      sqlite3_bind_int(set.get(), 4, known);
      LITAGS_RETURN_IF_ERROR(db.Step(set).status());
      sqlite3_reset(set.get());
    }
    sqlite3_reset(size.get());
  }
  return db.Execute("COMMIT");
}

}  // namespace

absl::Status SetFocalLengths(const std::string& path, const FocalLengths& focal_lengths) {
  return SetCameras(path, focal_lengths, kSimpleRadial, /*known=*/true);
}

absl::Status SetFisheyes(const std::string& path, const FocalLengths& focal_lengths) {
  return SetCameras(path, focal_lengths, kRadialFisheye, /*known=*/false);
}

absl::Status NumberImages(const std::string& path, const std::vector<std::string>& names) {
  std::map<std::string, size_t> position;
  for (size_t i = 0; i < names.size(); ++i) position.emplace(names[i], i);
  LITAGS_ASSIGN_OR_RETURN(std::vector<DatabaseImage> images, ReadDatabaseImages(path));
  const auto key = [&](const DatabaseImage& image) {
    const auto found = position.find(image.name);
    return std::pair(found == position.end() ? names.size() : found->second, image.name);
  };
  std::sort(images.begin(), images.end(),
            [&](const auto& a, const auto& b) { return key(a) < key(b); });

  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  LITAGS_RETURN_IF_ERROR(db.Execute("BEGIN"));
  for (const char* table : {"images", "keypoints", "descriptors"}) {
    // Out of the way first: a number is one image's at a time.
    LITAGS_RETURN_IF_ERROR(
        db.Execute(absl::StrCat("UPDATE ", table, " SET image_id = image_id + ", kAside).c_str()));
    LITAGS_ASSIGN_OR_RETURN(
        const Statement set,
        db.Prepare(absl::StrCat("UPDATE ", table, " SET image_id = ? WHERE image_id = ?")));
    for (size_t i = 0; i < images.size(); ++i) {
      sqlite3_bind_int(set.get(), 1, static_cast<int>(i) + 1);
      sqlite3_bind_int(set.get(), 2, kAside + images[i].id);
      LITAGS_RETURN_IF_ERROR(db.Step(set).status());
      sqlite3_reset(set.get());
    }
  }
  return db.Execute("COMMIT");
}

absl::StatusOr<std::vector<std::string>> TakeFewFeaturesOut(const std::string& path, int least) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<DatabaseImage> images, ReadDatabaseImages(path));
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READWRITE));
  std::vector<std::string> names;
  for (const DatabaseImage& image : images) {
    if (image.features >= least) continue;
    names.push_back(image.name);
    for (const char* table : {"keypoints", "descriptors"}) {
      LITAGS_RETURN_IF_ERROR(
          db.Execute(absl::StrCat("DELETE FROM ", table, " WHERE image_id = ", image.id).c_str()));
    }
  }
  return names;
}

absl::StatusOr<std::vector<std::vector<Eigen::Vector2d>>> ReadKeypoints(
    const std::string& path, const std::vector<DatabaseImage>& images) {
  Database db(path);
  LITAGS_RETURN_IF_ERROR(db.Open(SQLITE_OPEN_READONLY));
  LITAGS_ASSIGN_OR_RETURN(const Statement statement,
                          db.Prepare("SELECT rows, cols, data FROM keypoints WHERE image_id = ?"));
  std::vector<std::vector<Eigen::Vector2d>> keypoints(images.size());
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].features == 0) continue;
    sqlite3_bind_int(statement.get(), 1, images[i].id);
    LITAGS_ASSIGN_OR_RETURN(const bool found, db.Step(statement));
    const int64_t rows = found ? sqlite3_column_int64(statement.get(), 0) : 0;
    const int64_t cols = found ? sqlite3_column_int64(statement.get(), 1) : 0;
    const int64_t bytes = found ? sqlite3_column_bytes(statement.get(), 2) : 0;
    if (rows != images[i].features || cols < 2 || cols > kMaxKeypointColumns ||
        bytes != rows * cols * static_cast<int64_t>(sizeof(float))) {
      return db.Error(absl::StrCat("image \"", images[i].name, "\" has ", images[i].features,
                                   " keypoints, but ", rows, " rows of ", cols, " in ", bytes,
                                   " bytes"));
    }
    std::vector<float> data(static_cast<size_t>(rows * cols));
    std::memcpy(data.data(), sqlite3_column_blob(statement.get(), 2), static_cast<size_t>(bytes));
    keypoints[i].reserve(static_cast<size_t>(rows));
    for (size_t row = 0; row < static_cast<size_t>(rows); ++row) {
      const float* xy = data.data() + row * static_cast<size_t>(cols);
      keypoints[i].emplace_back(xy[0], xy[1]);
    }
    sqlite3_reset(statement.get());
  }
  return keypoints;
}

}  // namespace litags
