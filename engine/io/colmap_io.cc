#include "engine/io/colmap_io.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <unordered_map>
#include <vector>

#include "engine/io/byte_reader.h"
#include "engine/io/colmap_models.h"
#include "engine/io/colmap_text.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

struct Intrinsics {
  Camera camera;
  Distortion distortion;
  std::string_view unread = "";  // name of a model that no image may use
};

struct Observation {
  double x, y;
};

// images.bin as read: observations stay beside the view until the points refer to them.
struct LoadedImages {
  std::vector<LoadedView> views;
  std::vector<std::vector<Observation>> observations;  // by source_id
  std::unordered_map<uint32_t, size_t> source_ids;     // by COLMAP's image id
};

absl::Status Truncated(std::string_view field) {
  return InvalidField("MODEL_TRUNCATED", field,
                      "the file ends early or states impossible counts; export the model again");
}

absl::Status Corrupt(std::string_view field, std::string_view what) {
  return InvalidField("MODEL_CORRUPT", field, absl::StrCat(Absl(what), "; export the model again"));
}

absl::Status NoImage(std::string_view field) {
  return InvalidField("NO_CAMERAS", field, "it holds no image");
}

absl::Status Unsupported(std::string_view field, uint32_t camera, std::string_view model) {
  return InvalidField("UNSUPPORTED_CAMERA_MODEL", field,
                      absl::StrCat("camera ", camera, " has COLMAP's camera model ", Absl(model),
                                   ", which is not read; undistort the photos (colmap "
                                   "image_undistorter), or choose OPENCV, FULL_OPENCV or "
                                   "OPENCV_FISHEYE"));
}

Intrinsics MakeIntrinsics(int32_t model, uint64_t width, uint64_t height, const double* p) {
  Intrinsics out;
  Camera& camera = out.camera;
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  const bool two_focals =
      model == kPinhole || model == kOpenCv || model == kOpenCvFisheye || model == kFullOpenCv;
  camera.fx = p[0];
  camera.fy = two_focals ? p[1] : p[0];
  const double* rest = p + (two_focals ? 2 : 1);
  camera.cx = rest[0];
  camera.cy = rest[1];
  Distortion& d = out.distortion;
  d.fisheye = model == kOpenCvFisheye || model == kSimpleRadialFisheye || model == kRadialFisheye;
  if (model >= kSimpleRadial) d.k1 = rest[2];
  if (model >= kRadial && model != kSimpleRadialFisheye) d.k2 = rest[3];
  if (model == kOpenCvFisheye) {
    d.k3 = rest[4];
    d.k4 = rest[5];
  }
  if (model == kOpenCv || model == kFullOpenCv) {
    d.p1 = rest[4];
    d.p2 = rest[5];
  }
  if (model == kFullOpenCv) {
    d.k3 = rest[6];
    d.k4 = rest[7];
    d.k5 = rest[8];
    d.k6 = rest[9];
  }
  return out;
}

absl::StatusOr<std::map<uint32_t, Intrinsics>> ParseCameras(std::string_view bytes,
                                                            std::string_view field) {
  ByteReader reader(bytes);
  uint64_t count = 0;
  if (!reader.Read(&count)) return Truncated(field);
  std::map<uint32_t, Intrinsics> cameras;
  for (uint64_t i = 0; i < count; ++i) {
    uint32_t id = 0;
    int32_t model = 0;
    uint64_t width = 0, height = 0;
    if (!reader.Read(&id) || !reader.Read(&model) || !reader.Read(&width) ||
        !reader.Read(&height)) {
      return Truncated(field);
    }
    const ColmapModelInfo* info = FindColmapModel(model);
    if (info == nullptr) return Unsupported(field, id, absl::StrCat("number ", model));
    if (width > kMaxCameraSide || height > kMaxCameraSide)
      return Corrupt(field, "a camera has an absurd size");
    double params[kMaxColmapParams] = {};
    for (int k = 0; k < info->params; ++k) {
      if (!reader.Read(&params[k])) return Truncated(field);
    }
    Intrinsics intrinsics;
    if (model == kFov) {
      intrinsics.unread = info->name;
    } else {
      intrinsics = MakeIntrinsics(model, width, height, params);
    }
    if (!cameras.emplace(id, intrinsics).second) {
      return Corrupt(field, absl::StrCat("camera id ", id, " occurs twice"));
    }
  }
  return cameras;
}

// COLMAP stores a unit quaternion wxyz; rounding is divided out. False if it has no direction.
bool SetRotation(const std::array<double, 4>& q, Camera* camera) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(norm > 1e-6) || !std::isfinite(norm)) return false;
  const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  camera->R = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
               2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
               2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  return true;
}

// The unit quaternion wxyz, w >= 0, of a rotation (Shepperd's method: divide by the largest).
std::array<double, 4> QuaternionFromRotation(const std::array<double, 9>& R) {
  const double trace = R[0] + R[4] + R[8];
  const std::array<double, 4> squares = {1 + trace, 1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace,
                                         1 + 2 * R[8] - trace};       // 4 w^2, 4 x^2, 4 y^2, 4 z^2
  const double wx = R[7] - R[5], wy = R[2] - R[6], wz = R[3] - R[1];  // 4 w x, ...
  const double xy = R[1] + R[3], xz = R[2] + R[6], yz = R[5] + R[7];  // 4 x y, ...
  const double products[4][4] = {{squares[0], wx, wy, wz},
                                 {wx, squares[1], xy, xz},
                                 {wy, xy, squares[2], yz},
                                 {wz, xz, yz, squares[3]}};
  int largest = 0;
  for (int i = 1; i < 4; ++i) {
    if (squares[i] > squares[largest]) largest = i;
  }
  const double divisor = 2 * std::sqrt(squares[largest]) * (products[largest][0] < 0 ? -1.0 : 1.0);
  std::array<double, 4> q;
  for (int i = 0; i < 4; ++i) q[i] = products[largest][i] / divisor;
  return q;
}

absl::Status ReadObservations(ByteReader* reader, std::string_view field,
                              std::vector<Observation>* out) {
  uint64_t count = 0;
  if (!reader->Read(&count) || !reader->CanHold(count, 24)) return Truncated(field);
  out->resize(count);
  for (Observation& o : *out) {
    uint64_t point_id = 0;  // points3D.bin says the same from the other side
    if (!reader->Read(&o.x) || !reader->Read(&o.y) || !reader->Read(&point_id)) {
      return Truncated(field);
    }
    if (!std::isfinite(o.x) || !std::isfinite(o.y)) {
      return InvalidField("NOT_FINITE", field, "an image position is NaN or infinite");
    }
  }
  return absl::OkStatus();
}

// Whether an image may use this camera.
absl::Status CheckCamera(uint32_t id, const Intrinsics& intrinsics, std::string_view field) {
  if (!intrinsics.unread.empty()) return Unsupported(field, id, intrinsics.unread);
  LoadedView loaded;
  loaded.view = {absl::StrCat(id), intrinsics.camera};
  loaded.distortion = intrinsics.distortion;
  loaded.has_size = true;
  return FinishModel({loaded}, field, nullptr).status();
}

// COLMAP keeps cameras of images that it took out of the model, however wrong they are: one that is
// right is enough.
absl::Status CheckCameras(std::string_view bytes, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const auto cameras, ParseCameras(bytes, field));
  if (cameras.empty()) return InvalidField("NO_CAMERAS", field, "it holds no camera");
  absl::Status first;
  for (const auto& [id, intrinsics] : cameras) {
    const absl::Status status = CheckCamera(id, intrinsics, field);
    if (status.ok()) return status;
    first.Update(status);
  }
  return first;
}

// `cameras`: null, any camera will do, and observations are checked only.
absl::StatusOr<LoadedImages> ParseImages(std::string_view bytes,
                                         const std::map<uint32_t, Intrinsics>* cameras,
                                         std::string_view field) {
  const Intrinsics any = MakeIntrinsics(kSimplePinhole, 1, 1, std::array{1.0, 0.5, 0.5}.data());
  ByteReader reader(bytes);
  uint64_t count = 0;
  if (!reader.Read(&count)) return Truncated(field);
  LoadedImages images;
  for (uint64_t i = 0; i < count; ++i) {
    uint32_t id = 0, camera_id = 0;
    std::array<double, 4> q = {};
    std::array<double, 3> t = {};
    std::string_view name;
    if (!reader.Read(&id)) return Truncated(field);
    for (double& v : q) {
      if (!reader.Read(&v)) return Truncated(field);
    }
    for (double& v : t) {
      if (!reader.Read(&v)) return Truncated(field);
    }
    if (!reader.Read(&camera_id) || !reader.ReadCString(&name)) return Truncated(field);
    const Intrinsics* camera = &any;
    if (cameras != nullptr) {
      const auto found = cameras->find(camera_id);
      if (found == cameras->end()) {
        return Corrupt(field, absl::StrCat("image ", id, " uses camera ", camera_id,
                                           ", which does not exist"));
      }
      camera = &found->second;
    }
    if (!camera->unread.empty()) return Unsupported(field, camera_id, camera->unread);
    LoadedView loaded;
    loaded.view.name = name;
    loaded.view.camera = camera->camera;
    loaded.view.camera.t = t;
    loaded.distortion = camera->distortion;
    loaded.source_id = images.views.size();
    if (!SetRotation(q, &loaded.view.camera)) {
      return Corrupt(field, absl::StrCat("image ", id, " has no valid rotation"));
    }
    if (!images.source_ids.emplace(id, loaded.source_id).second) {
      return Corrupt(field, absl::StrCat("image id ", id, " occurs twice"));
    }
    images.views.push_back(std::move(loaded));
    std::vector<Observation> observations;
    LITAGS_RETURN_IF_ERROR(ReadObservations(&reader, field, &observations));
    if (cameras != nullptr) images.observations.push_back(std::move(observations));
  }
  return images;
}

// `view_of_source[i]` is the place of image source_id i in the sorted model. `points`: null, they
// are checked only.
absl::Status ParsePoints(std::string_view bytes, const LoadedImages& images,
                         const std::vector<int>& view_of_source, std::string_view field,
                         std::vector<SparsePoint>* points) {
  ByteReader reader(bytes);
  uint64_t count = 0;
  if (!reader.Read(&count)) return Truncated(field);
  for (uint64_t i = 0; i < count; ++i) {
    SparsePoint point;
    uint64_t id = 0, track_length = 0;
    if (!reader.Read(&id)) return Truncated(field);
    for (double& v : point.xyz) {
      if (!reader.Read(&v)) return Truncated(field);
      if (!std::isfinite(v)) return InvalidField("NOT_FINITE", field, "a point is NaN or infinite");
    }
    for (uint8_t& v : point.rgb) {
      if (!reader.Read(&v)) return Truncated(field);
    }
    if (!reader.Read(&point.error) || !reader.Read(&track_length) ||
        !reader.CanHold(track_length, 8)) {
      return Truncated(field);
    }
    if (!(point.error >= 0) || !std::isfinite(point.error)) point.error = -1;  // COLMAP's "unknown"
    if (points != nullptr) point.track.reserve(track_length);
    for (uint64_t k = 0; k < track_length; ++k) {
      uint32_t image_id = 0, index = 0;
      if (!reader.Read(&image_id) || !reader.Read(&index)) return Truncated(field);
      // Converters of LiDAR and SLAM maps write a placeholder, image 0 and observation 0.
      const auto source = images.source_ids.find(image_id);
      if (source == images.source_ids.end() ||
          index >= images.observations[source->second].size()) {
        continue;
      }
      const Observation& o = images.observations[source->second][index];
      point.track.push_back({view_of_source[source->second], o.x, o.y});
    }
    if (points != nullptr) points->push_back(std::move(point));
  }
  return absl::OkStatus();
}

// Distinct intrinsics of a model; `camera_of_view` gets each view's index into them.
std::vector<Intrinsics> CollectIntrinsics(const SparseModel& model,
                                          std::vector<size_t>* camera_of_view) {
  std::vector<Intrinsics> cameras;
  std::map<std::array<double, 15>, size_t> known;
  for (size_t i = 0; i < model.views.size(); ++i) {
    const Camera& c = model.views[i].camera;
    const Distortion& d = model.distortions[i];
    const std::array<double, 15> key = {double(c.width),
                                        double(c.height),
                                        c.fx,
                                        c.fy,
                                        c.cx,
                                        c.cy,
                                        d.k1,
                                        d.k2,
                                        d.p1,
                                        d.p2,
                                        d.k3,
                                        d.k4,
                                        d.k5,
                                        d.k6,
                                        double(d.fisheye)};
    const auto [it, added] = known.emplace(key, cameras.size());
    if (added) cameras.push_back({c, d});
    camera_of_view->push_back(it->second);
  }
  return cameras;
}

std::string EncodeCameras(const std::vector<Intrinsics>& cameras) {
  std::string out;
  AppendNumber(&out, uint64_t{cameras.size()});
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i].camera;
    const Distortion& d = cameras[i].distortion;
    AppendNumber(&out, static_cast<uint32_t>(i + 1));
    AppendNumber(&out, int32_t{d.IsZero()   ? kPinhole
                               : d.fisheye  ? kOpenCvFisheye
                               : d.IsFull() ? kFullOpenCv
                                            : kOpenCv});
    AppendNumber(&out, static_cast<uint64_t>(c.width));
    AppendNumber(&out, static_cast<uint64_t>(c.height));
    for (double v : {c.fx, c.fy, c.cx, c.cy}) AppendNumber(&out, v);
    if (d.IsZero()) continue;
    for (double v : {d.k1, d.k2}) AppendNumber(&out, v);
    if (!d.fisheye) {
      for (double v : {d.p1, d.p2}) AppendNumber(&out, v);
    }
    if (d.fisheye || d.IsFull()) {
      for (double v : {d.k3, d.k4}) AppendNumber(&out, v);
    }
    if (!d.fisheye && d.IsFull()) {
      for (double v : {d.k5, d.k6}) AppendNumber(&out, v);
    }
  }
  return out;
}

struct WrittenObservation {
  double x, y;
  uint64_t point_id;
};

std::string EncodeImages(const SparseModel& model, const std::vector<size_t>& camera_of_view,
                         const std::vector<std::vector<WrittenObservation>>& observations) {
  std::string out;
  AppendNumber(&out, uint64_t{model.views.size()});
  for (size_t i = 0; i < model.views.size(); ++i) {
    const View& view = model.views[i];
    AppendNumber(&out, static_cast<uint32_t>(i + 1));
    for (double v : QuaternionFromRotation(view.camera.R)) AppendNumber(&out, v);
    for (double v : view.camera.t) AppendNumber(&out, v);
    AppendNumber(&out, static_cast<uint32_t>(camera_of_view[i] + 1));
    out.append(view.name.c_str(), view.name.size() + 1);
    AppendNumber(&out, uint64_t{observations[i].size()});
    for (const WrittenObservation& o : observations[i]) {
      AppendNumber(&out, o.x);
      AppendNumber(&out, o.y);
      AppendNumber(&out, o.point_id);
    }
  }
  return out;
}

// `suffix`: of the files' names in errors.
absl::StatusOr<SparseModel> ParseModel(std::string_view cameras_bin, std::string_view images_bin,
                                       std::string_view points_bin, std::string_view field,
                                       const char* suffix) {
  const std::string images_name = absl::StrCat(Absl(field), "/images", suffix);
  LITAGS_ASSIGN_OR_RETURN(const auto cameras,
                          ParseCameras(cameras_bin, absl::StrCat(Absl(field), "/cameras", suffix)));
  LITAGS_ASSIGN_OR_RETURN(LoadedImages images, ParseImages(images_bin, &cameras, images_name));
  if (images.views.empty()) return NoImage(images_name);

  std::vector<size_t> order;
  LITAGS_ASSIGN_OR_RETURN(SparseModel model,
                          FinishModel(std::move(images.views), images_name, &order));
  std::vector<int> view_of_source(order.size());
  for (size_t i = 0; i < order.size(); ++i) view_of_source[order[i]] = static_cast<int>(i);

  const std::string points_name = absl::StrCat(Absl(field), "/points3D", suffix);
  LITAGS_RETURN_IF_ERROR(
      ParsePoints(points_bin, images, view_of_source, points_name, &model.points));
  return model;
}

}  // namespace

absl::StatusOr<SparseModel> ParseColmapModel(std::string_view cameras_bin,
                                             std::string_view images_bin,
                                             std::string_view points_bin, std::string_view field) {
  return ParseModel(cameras_bin, images_bin, points_bin, field, ".bin");
}

absl::StatusOr<SparseModel> ParseColmapText(std::string_view cameras_txt,
                                            std::string_view images_txt,
                                            std::string_view points_txt, std::string_view field) {
  const auto binary = [&](ColmapPart part, std::string_view text, const char* file) {
    return BinaryFromText(part, text, absl::StrCat(Absl(field), file));
  };
  LITAGS_ASSIGN_OR_RETURN(const std::string cameras,
                          binary(ColmapPart::kCameras, cameras_txt, "/cameras.txt"));
  LITAGS_ASSIGN_OR_RETURN(const std::string images,
                          binary(ColmapPart::kImages, images_txt, "/images.txt"));
  LITAGS_ASSIGN_OR_RETURN(const std::string points,
                          binary(ColmapPart::kPoints, points_txt, "/points3D.txt"));
  return ParseModel(cameras, images, points, field, ".txt");
}

absl::StatusOr<std::vector<std::string>> CheckColmapFile(std::string_view name,
                                                         std::string_view bytes,
                                                         std::string_view field) {
  const ColmapPart part = name.starts_with("cameras")  ? ColmapPart::kCameras
                          : name.starts_with("images") ? ColmapPart::kImages
                                                       : ColmapPart::kPoints;
  std::string binary;
  if (name.ends_with(".txt")) {
    LITAGS_ASSIGN_OR_RETURN(binary, BinaryFromText(part, bytes, field));
    bytes = binary;
  }
  if (part == ColmapPart::kPoints) {
    LITAGS_RETURN_IF_ERROR(ParsePoints(bytes, {}, {}, field, nullptr));
    return std::vector<std::string>();
  }
  if (part == ColmapPart::kCameras) {
    LITAGS_RETURN_IF_ERROR(CheckCameras(bytes, field));
    return std::vector<std::string>();
  }
  LITAGS_ASSIGN_OR_RETURN(LoadedImages images, ParseImages(bytes, nullptr, field));
  if (images.views.empty()) return NoImage(field);
  LITAGS_ASSIGN_OR_RETURN(SparseModel model, FinishModel(std::move(images.views), field, nullptr));
  return std::move(model.paths);
}

absl::StatusOr<SparseModel> ReadColmapModel(const std::string& dir, std::string_view field) {
  std::error_code ignored;  // ReadFile says what is wrong
  const bool text = !std::filesystem::exists(dir + "/cameras.bin", ignored) &&
                    std::filesystem::exists(dir + "/cameras.txt", ignored);
  std::string bytes[3];
  constexpr const char* kFiles[3] = {"/cameras", "/images", "/points3D"};
  for (int i = 0; i < 3; ++i) {
    const std::string name = absl::StrCat(kFiles[i], text ? ".txt" : ".bin");
    if (i == 2 && !std::filesystem::exists(dir + name, ignored)) {  // cameras without points
      if (!text) AppendNumber(&bytes[i], uint64_t{0});
      continue;
    }
    LITAGS_ASSIGN_OR_RETURN(
        bytes[i], ReadFile(dir + name, absl::StrCat(Absl(field), name), kMaxModelFileBytes));
  }
  return (text ? ParseColmapText : ParseColmapModel)(bytes[0], bytes[1], bytes[2], field);
}

absl::StatusOr<ColmapFiles> EncodeColmapModel(const SparseModel& model) {
  std::vector<size_t> camera_of_view;
  const std::vector<Intrinsics> cameras = CollectIntrinsics(model, &camera_of_view);
  std::vector<std::vector<WrittenObservation>> observations(model.views.size());
  std::string points;
  AppendNumber(&points, uint64_t{model.points.size()});
  for (size_t i = 0; i < model.points.size(); ++i) {
    const SparsePoint& point = model.points[i];
    const uint64_t id = i + 1;
    AppendNumber(&points, id);
    for (double v : point.xyz) AppendNumber(&points, v);
    for (uint8_t v : point.rgb) AppendNumber(&points, v);
    AppendNumber(&points, point.error);
    AppendNumber(&points, uint64_t{point.track.size()});
    for (const TrackElement& element : point.track) {
      if (element.view < 0 || size_t(element.view) >= model.views.size()) {
        return InvalidField("BAD_TRACK", "points", "a track names a view that does not exist");
      }
      AppendNumber(&points, static_cast<uint32_t>(element.view + 1));
      AppendNumber(&points, static_cast<uint32_t>(observations[element.view].size()));
      observations[element.view].push_back({element.x, element.y, id});
    }
  }
  return ColmapFiles{EncodeCameras(cameras), EncodeImages(model, camera_of_view, observations),
                     std::move(points)};
}

absl::Status WriteColmapModel(const std::string& dir, const SparseModel& model) {
  LITAGS_ASSIGN_OR_RETURN(const ColmapFiles files, EncodeColmapModel(model));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(dir + "/cameras.bin", files.cameras));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(dir + "/images.bin", files.images));
  return WriteFileAtomically(dir + "/points3D.bin", files.points);
}

}  // namespace litags
