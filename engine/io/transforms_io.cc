#include "engine/io/transforms_io.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/json_text.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

// Not ordered_json: it copies its members when it grows, by recursion.
using Json = nlohmann::json;

constexpr int kMaxDepth = 16;  // of nested lists and objects; 4 are needed
// Of a frame's keys that are read, and of those beside the frames; some 40 are needed.
constexpr int kMaxValues = 1000;

// The keys that are read. Nothing else of a file takes memory.
constexpr std::string_view kKeys[] = {"file_path",
                                      "mask_path",
                                      "transform_matrix",
                                      "camera_model",
                                      "is_fisheye",
                                      "w",
                                      "h",
                                      "fl_x",
                                      "fl_y",
                                      "cx",
                                      "cy",
                                      "camera_angle_x",
                                      "camera_angle_y",
                                      "k1",
                                      "k2",
                                      "k3",
                                      "k4",
                                      "k5",
                                      "k6",
                                      "p1",
                                      "p2"};

// A value for a message; of lists and objects only the type.
std::string Describe(const Json& value) {
  return value.is_structured() ? value.type_name() : JsonText(value);
}

// Goes through a transforms.json without ever holding more of it than one frame: a file of 16 MiB
// may hold millions of values, of some 100 bytes each.
class FrameParser {
 public:
  // Gets each element of the list "frames".
  using OnFrame = std::function<absl::Status(const Json& frame)>;

  FrameParser(std::string_view text, std::string_view field) : text_(text), field_(field) {}

  // What stands beside the frames, which go to `on_frame`, if that is not null.
  absl::StatusOr<Json> Run(const OnFrame& on_frame) {
    on_frame_ = on_frame;
    frames_ = values_ = 0;
    top_key_.clear();
    has_list_ = is_wanted_ = false;
    const auto keep = [this](int depth, Event event, Json& value) {
      return Keep(depth, event, value);
    };
    try {
      return Json::parse(text_, keep);
    } catch (const Stop& stop) {
      return stop.status;
    } catch (const Json::exception& e) {
      return InvalidField(
          "BAD_JSON", field_,
          absl::StrCat("not valid JSON (NaN and Infinity are not either): ", e.what()));
    }
  }

  bool has_list() const { return has_list_; }
  int frames() const { return frames_; }

 private:
  using Event = Json::parse_event_t;
  struct Stop {  // thrown through the parser
    absl::Status status;
  };

  static bool IsKnown(const Json& key) {
    const auto& name = key.get_ref<const std::string&>();
    return std::find(std::begin(kKeys), std::end(kKeys), name) != std::end(kKeys);
  }

  // Called by the parser for each value and each start; false: it is dropped.
  bool Keep(int depth, Event event, Json& value) {
    if (depth > kMaxDepth) {
      throw Stop{InvalidField("BAD_JSON", field_, "lists are nested too deeply")};
    }
    if (depth == 0 && event == Event::array_start) return false;  // none of ours
    const bool starts = event == Event::object_start || event == Event::array_start;
    const bool ends = event == Event::object_end || event == Event::array_end;
    if (depth == 1 && event == Event::key) {
      top_key_ = value.get<std::string>();
      is_wanted_ = IsKnown(value);
      return is_wanted_ || top_key_ == "frames";
    }
    const bool in_frames = depth >= 1 && top_key_ == "frames";
    if (in_frames && depth == 1) {
      has_list_ = event == Event::array_start || event == Event::array_end;
      return has_list_;
    }
    if (in_frames && !on_frame_) return false;
    if (in_frames && depth == 2) {
      values_ = 0;
      is_wanted_ = true;
      if (starts) return true;
      if (const absl::Status status = on_frame_(value); !status.ok()) throw Stop{status};
      ++frames_;
      return false;
    }
    if (in_frames && depth == 3 && event == Event::key) return is_wanted_ = IsKnown(value);
    if (!ends && is_wanted_ && ++values_ > kMaxValues) {
      throw Stop{InvalidField("BAD_JSON", field_, "a frame holds far too many numbers")};
    }
    return true;
  }

  const std::string_view text_;
  const std::string_view field_;
  OnFrame on_frame_;
  std::string top_key_;     // that is being read
  bool has_list_ = false;   // under "frames"
  bool is_wanted_ = false;  // what is being read
  int frames_ = 0, values_ = 0;
};

// A JSON object with the document's top as fallback: a frame's own keys win.
class Keys {
 public:
  Keys(const Json& frame, const Json& top, std::string where)
      : frame_(frame), top_(top), where_(std::move(where)) {}

  const std::string& where() const { return where_; }

  const Json* Find(const char* key) const {
    for (const Json* object : {&frame_, &top_}) {
      if (const auto it = object->find(key); it != object->end()) return &*it;
    }
    return nullptr;
  }

  // The number under `key`, nullopt if there is none; an error if it is no finite number.
  absl::StatusOr<std::optional<double>> Number(const char* key) const {
    const Json* value = Find(key);
    if (value == nullptr) return std::optional<double>();
    if (!value->is_number() || !std::isfinite(value->get<double>())) {
      return InvalidField(
          "BAD_NUMBER", where_,
          absl::StrCat("'", key, "' is ", Describe(*value), ", not a finite number"));
    }
    return std::optional<double>(value->get<double>());
  }

  absl::StatusOr<double> NumberOr(const char* key, double fallback) const {
    LITAGS_ASSIGN_OR_RETURN(const std::optional<double> value, Number(key));
    return value.value_or(fallback);
  }

  // Whether "is_fisheye" is there and neither false nor 0; an error if it is no boolean and no
  // number.
  absl::StatusOr<bool> IsFisheye() const {
    const Json* value = Find("is_fisheye");
    if (value == nullptr) return false;
    if (value->is_boolean()) return value->get<bool>();
    if (value->is_number()) return value->get<double>() != 0;
    return InvalidField("BAD_NUMBER", where_,
                        absl::StrCat("'is_fisheye' is ", Describe(*value),
                                     ", neither true nor false nor a number"));
  }

 private:
  const Json& frame_;
  const Json& top_;
  std::string where_;
};

absl::StatusOr<int> ReadSide(const Keys& keys, const char* key, int fallback) {
  LITAGS_ASSIGN_OR_RETURN(const double side, keys.NumberOr(key, fallback));
  if (side == 0 && keys.Find(key) == nullptr) {
    return InvalidField(
        "MISSING_KEY", keys.where(),
        absl::StrCat("there is no '", key, "'; add w and h, the photos' size in px"));
  }
  if (!(side >= 1 && side <= kMaxCameraSide) || side != std::floor(side)) {
    return InvalidField("BAD_CAMERA_SIZE", keys.where(),
                        absl::StrCat("'", key, "' is ", side, ", not a number of pixels"));
  }
  return static_cast<int>(side);
}

// Focal length in px: `key`, else from the full field of view `angle_key` over `side` px; nullopt
// if neither is there.
absl::StatusOr<std::optional<double>> ReadFocal(const Keys& keys, const char* key,
                                                const char* angle_key, int side) {
  LITAGS_ASSIGN_OR_RETURN(std::optional<double> focal, keys.Number(key));
  if (focal.has_value()) return focal;
  LITAGS_ASSIGN_OR_RETURN(const std::optional<double> angle, keys.Number(angle_key));
  if (!angle.has_value()) return std::optional<double>();
  if (!(*angle > 0 && *angle < M_PI)) {
    return InvalidField("BAD_FOCAL_LENGTH", keys.where(),
                        absl::StrCat("'", angle_key, "' is ", *angle,
                                     "; a field of view lies between 0 and pi radians"));
  }
  return std::optional<double>(0.5 * side / std::tan(0.5 * *angle));
}

// Lenses that Distortion cannot express are refused, not approximated. k3 is the same coefficient
// everywhere; k4 and beyond are not: of an OPENCV lens nerfstudio has one that OpenCV does not.
absl::Status ReadLens(const Keys& keys, Distortion* lens) {
  const auto unsupported = [&](std::string_view what) {
    return InvalidField("UNSUPPORTED_CAMERA_MODEL", keys.where(),
                        absl::StrCat(Absl(what), " is not supported; undistort the photos first"));
  };
  std::string model;
  if (const Json* given = keys.Find("camera_model"); given != nullptr) {
    constexpr std::string_view kKnown[] = {"OPENCV",       "FULL_OPENCV",    "OPENCV_FISHEYE",
                                           "PINHOLE",      "SIMPLE_PINHOLE", "RADIAL",
                                           "SIMPLE_RADIAL"};
    model = given->is_string() ? given->get<std::string>() : "";
    if (std::find(std::begin(kKnown), std::end(kKnown), model) == std::end(kKnown)) {
      return unsupported(absl::StrCat("camera model ", Describe(*given)));
    }
  }
  LITAGS_ASSIGN_OR_RETURN(const bool is_fisheye, keys.IsFisheye());
  lens->fisheye = is_fisheye || model == "OPENCV_FISHEYE";
  const bool full = model == "FULL_OPENCV";
  const struct {
    const char* key;
    double* value;
    bool known;
  } kCoefficients[] = {{"k1", &lens->k1, true},           {"k2", &lens->k2, true},
                       {"k3", &lens->k3, true},           {"k4", &lens->k4, full || lens->fisheye},
                       {"k5", &lens->k5, full},           {"k6", &lens->k6, full},
                       {"p1", &lens->p1, !lens->fisheye}, {"p2", &lens->p2, !lens->fisheye}};
  for (const auto& [key, value, known] : kCoefficients) {
    LITAGS_ASSIGN_OR_RETURN(*value, keys.NumberOr(key, 0));
    if (*value == 0 || known) continue;
    return unsupported(
        absl::StrCat("lens distortion '", key, "' of ",
                     lens->fisheye ? "a fisheye" : "another camera_model than FULL_OPENCV"));
  }
  return absl::OkStatus();
}

bool IsPanorama(const Keys& keys) {
  const Json* model = keys.Find("camera_model");
  return model != nullptr && *model == Json("EQUIRECTANGULAR");
}

absl::Status ReadIntrinsics(const Keys& keys, int default_width, int default_height, Camera* camera,
                            Distortion* distortion) {
  LITAGS_ASSIGN_OR_RETURN(camera->width, ReadSide(keys, "w", default_width));
  LITAGS_ASSIGN_OR_RETURN(camera->height, ReadSide(keys, "h", default_height));
  if (IsPanorama(keys)) {
    SetPanorama(camera);
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(ReadLens(keys, distortion));
  LITAGS_ASSIGN_OR_RETURN(const std::optional<double> fx,
                          ReadFocal(keys, "fl_x", "camera_angle_x", camera->width));
  LITAGS_ASSIGN_OR_RETURN(const std::optional<double> fy,
                          ReadFocal(keys, "fl_y", "camera_angle_y", camera->height));
  if (!fx.has_value()) {
    return InvalidField("MISSING_KEY", keys.where(),
                        "there is neither 'fl_x' nor 'camera_angle_x'; add the focal length in px");
  }
  camera->fx = *fx;
  camera->fy = fy.value_or(*fx);  // square pixels
  LITAGS_ASSIGN_OR_RETURN(camera->cx, keys.NumberOr("cx", 0.5 * camera->width));
  LITAGS_ASSIGN_OR_RETURN(camera->cy, keys.NumberOr("cy", 0.5 * camera->height));
  return absl::OkStatus();
}

// The 4x4 (or its upper 3x4) as numbers.
absl::StatusOr<cv::Matx34d> ReadMatrix(const Json& frame, const std::string& where) {
  const auto it = frame.find("transform_matrix");
  if (it == frame.end()) {
    return InvalidField("MISSING_KEY", where, "there is no 'transform_matrix'");
  }
  const auto bad = [&] {
    return InvalidField("BAD_POSE", where, "'transform_matrix' is not 4x4 finite numbers");
  };
  if (!it->is_array() || (it->size() != 4 && it->size() != 3 && it->size() != 16)) return bad();
  const bool flat = it->size() == 16;  // row by row
  cv::Matx44d matrix = cv::Matx44d::eye();
  for (int r = 0; r < (flat ? 4 : static_cast<int>(it->size())); ++r) {
    const Json& row = flat ? *it : (*it)[r];
    if (!flat && (!row.is_array() || row.size() != 4)) return bad();
    for (int c = 0; c < 4; ++c) {
      const Json& number = row[flat ? 4 * r + c : c];
      if (!number.is_number() || !std::isfinite(number.get<double>())) return bad();
      matrix(r, c) = number.get<double>();
    }
  }
  for (int c = 0; c < 4; ++c) {
    if (std::abs(matrix(3, c) - (c == 3)) <= 1e-6) continue;
    return InvalidField("BAD_POSE", where,
                        "the last row of 'transform_matrix' is not 0 0 0 1; was it written column "
                        "by column?");
  }
  return matrix.get_minor<3, 4>(0, 0);
}

// OpenGL camera-to-world into cam_from_world. A uniform scale moves the camera's own units, not its
// picture, and is divided out; rounding in the file is removed by taking the nearest rotation.
absl::Status SetPose(const cv::Matx34d& world_from_gl, const std::string& where, Camera* camera) {
  constexpr double kTolerance = 1e-2;  // files with two decimals still pass
  const cv::Matx33d linear = world_from_gl.get_minor<3, 3>(0, 0);
  const double determinant = cv::determinant(linear);
  if (!std::isfinite(determinant) || std::abs(determinant) < 1e-12) {
    return InvalidField("SINGULAR_POSE", where,
                        "'transform_matrix' cannot be inverted; its 3x3 part must be a rotation");
  }
  const cv::Matx33d scaled = linear * (1.0 / std::cbrt(determinant));
  cv::Matx33d u, vt;
  cv::Vec3d singular;
  cv::SVD::compute(scaled, singular, u, vt);
  if (determinant < 0 || singular[0] > 1 + kTolerance || singular[2] < 1 - kTolerance) {
    return InvalidField(
        "NOT_A_ROTATION", where,
        "the 3x3 part of 'transform_matrix' is not a rotation: it mirrors or shears");
  }
  const cv::Matx33d flip(1, 0, 0, 0, -1, 0, 0, 0, -1);  // OpenGL axes to OpenCV axes
  const cv::Matx33d R = flip * (u * vt).t();
  const cv::Vec3d t = R * -cv::Vec3d(world_from_gl(0, 3), world_from_gl(1, 3), world_from_gl(2, 3));
  for (int i = 0; i < 9; ++i) camera->R[i] = R.val[i];
  for (int i = 0; i < 3; ++i) camera->t[i] = t[i];
  return absl::OkStatus();
}

absl::StatusOr<LoadedView> ReadFrame(const Json& frame, const Json& top, const std::string& where,
                                     const PhotoSizes& sizes) {
  if (!frame.is_object()) return InvalidField("BAD_JSON", where, "the frame is not an object");
  const auto path = frame.find("file_path");
  if (path == frame.end() || !path->is_string()) {
    return InvalidField("MISSING_KEY", where, "there is no 'file_path' text");
  }
  LoadedView loaded;
  loaded.view.name = path->get<std::string>();
  const Keys keys(frame, top, where);
  loaded.panorama = IsPanorama(keys);
  loaded.has_size = keys.Find("w") != nullptr && keys.Find("h") != nullptr;
  const PhotoSize size = loaded.has_size ? PhotoSize() : sizes(loaded.view.name);
  LITAGS_RETURN_IF_ERROR(
      ReadIntrinsics(keys, size.width, size.height, &loaded.view.camera, &loaded.distortion));
  LITAGS_ASSIGN_OR_RETURN(const cv::Matx34d matrix, ReadMatrix(frame, where));
  LITAGS_RETURN_IF_ERROR(SetPose(matrix, where, &loaded.view.camera));
  return loaded;
}

}  // namespace

absl::StatusOr<SparseModel> ParseTransforms(std::string_view json, std::string_view field,
                                            const PhotoSizes& sizes, PanoramaNames* panoramas) {
  FrameParser parser(json, field);
  // Twice, since what the frames lack may stand behind them.
  LITAGS_ASSIGN_OR_RETURN(const Json top, parser.Run(nullptr));
  if (!top.is_object() || !parser.has_list()) {
    return InvalidField("MISSING_KEY", field, "there is no list 'frames'; give a transforms.json");
  }
  std::vector<LoadedView> views;
  std::set<std::string> seen;  // frames as they are read
  const auto read = [&](const Json& frame) -> absl::Status {
    const std::string where = absl::StrCat(Absl(field), ".frames[", parser.frames(), "]");
    // Merged captures list frames twice. Those cost no look at their photo.
    if (!seen.insert(JsonText(frame)).second) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(LoadedView view, ReadFrame(frame, top, where, sizes));
    views.push_back(std::move(view));
    return absl::OkStatus();
  };
  LITAGS_RETURN_IF_ERROR(parser.Run(read).status());
  if (views.empty()) return InvalidField("NO_CAMERAS", field, "'frames' is empty");
  return FinishModel(std::move(views), field, nullptr, panoramas);
}

absl::StatusOr<SparseModel> ParseTransforms(std::string_view json, std::string_view field,
                                            int default_width, int default_height) {
  return ParseTransforms(json, field, [&](const std::string&) {
    return PhotoSize{default_width, default_height};
  });
}

std::map<std::string, std::string> MaskPathsOfTransforms(std::string_view json) {
  std::map<std::string, std::string> paths;
  FrameParser parser(json, "cameras");
  const auto read = [&](const Json& frame) -> absl::Status {
    if (!frame.is_object()) return absl::OkStatus();
    const auto photo = frame.find("file_path"), mask = frame.find("mask_path");
    if (photo == frame.end() || !photo->is_string()) return absl::OkStatus();
    std::string& path = paths[photo->get<std::string>()];
    if (mask != frame.end() && mask->is_string()) path = mask->get<std::string>();
    return absl::OkStatus();
  };
  return parser.Run(read).ok() ? paths : std::map<std::string, std::string>();
}

}  // namespace litags
