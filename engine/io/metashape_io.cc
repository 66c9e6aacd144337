#include "engine/io/metashape_io.h"

#include <expat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "engine/core/utf8.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

constexpr size_t kMaxDepth = 32;     // of elements; 8 are needed
constexpr size_t kMaxText = 2000;    // of an element; a pose takes some 400
constexpr size_t kMaxEntries = 1e5;  // sensors and cameras
constexpr size_t kMaxNumbers = 50;   // of a lens; 12 are needed
constexpr size_t kPoseNumbers = 16;  // row by row

// Of an element, as the parser has them: names and values in turn, to the first null.
class Attributes {
 public:
  explicit Attributes(const char* const* pairs) : pairs_(pairs) {}
  // Null if there is none.
  const char* Find(std::string_view name) const {
    for (const char* const* pair = pairs_; *pair != nullptr; pair += 2) {
      if (name == *pair) return pair[1];
    }
    return nullptr;
  }
  std::string Get(std::string_view name) const {
    const char* value = Find(name);
    return value == nullptr ? "" : value;
  }

 private:
  const char* const* pairs_;
};

struct Sensor {
  std::string type;
  double width = 0, height = 0;
  bool of_a_system = false;
  bool adjusted = false;               // lens is
  std::map<std::string, double> lens;  // f, cx, k1 ...
};

struct PlacedCamera {
  std::string label, sensor, component;
  std::array<double, kPoseNumbers> chunk_from_cam = {};
};

// What brings cameras from their own frame to the world: x to scale * rotation * x + translation.
struct ToWorld {
  std::array<double, 9> rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row by row
  std::array<double, 3> translation = {};
  std::array<double, 1> scale = {1};
};

struct Document {
  int chunks = 0;
  std::map<std::string, Sensor> sensors;  // by id
  ToWorld chunk;
  std::map<std::string, ToWorld> components;  // by id; those that have one of their own
  std::vector<PlacedCamera> cameras;
};

absl::Status Unsupported(std::string_view where, std::string_view what,
                         std::string_view remedy = "export undistorted photos and their cameras") {
  return InvalidField("UNSUPPORTED_CAMERA_MODEL", where,
                      absl::StrCat("Metashape's ", Absl(what), " is not read; ", Absl(remedy)));
}

std::string WhereOf(std::string_view field, std::string_view label) {
  return absl::StrCat(Absl(field), ".cameras[", Absl(label), "]");
}

constexpr std::string_view kSystem = "system of several cameras";

// Finite numbers with blanks between them.
bool ReadNumbers(std::string_view text, std::vector<double>* out) {
  out->clear();
  for (const absl::string_view word :
       absl::StrSplit(Absl(text), absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty())) {
    double value = 0;
    if (!absl::SimpleAtod(word, &value) || !std::isfinite(value)) return false;
    out->push_back(value);
  }
  return true;
}

// Takes the document element by element, and keeps of it what is needed.
class Reader {
 public:
  explicit Reader(std::string_view field) : field_(field) {}

  void Start(const std::string& name, const Attributes& attributes) {
    const std::string parent = path_.empty() ? "" : path_.back();
    path_.push_back(name);
    text_.clear();
    if (path_.size() > kMaxDepth) return Fail("BAD_XML", "elements are nested too deeply");
    if (document_.sensors.size() + document_.cameras.size() + document_.components.size() >
        kMaxEntries) {
      return Fail("BAD_XML", "it has too many cameras");
    }
    if (name == "chunk") ++document_.chunks;
    if (name == "sensor" && parent == "sensors") {
      sensor_.emplace();
      sensor_->type = attributes.Get("type");
      sensor_->of_a_system = attributes.Find("master_id") != nullptr;
      id_ = attributes.Get("id");
    } else if (name == "calibration" && sensor_.has_value()) {
      StartCalibration(attributes);
    } else if (name == "resolution" && sensor_.has_value() && !passing_over_) {
      // Missing sides stay 0, which are refused.
      (void)absl::SimpleAtod(attributes.Get("width"), &sensor_->width);
      (void)absl::SimpleAtod(attributes.Get("height"), &sensor_->height);
    } else if (name == "component" && parent == "components") {
      id_ = attributes.Get("id");
    } else if (name == "camera" && (parent == "cameras" || parent == "group")) {
      StartCamera(attributes);
    }
  }

  // Covariances, which nobody reads, are longer than what is kept.
  void Text(std::string_view text) { text_.append(text.substr(0, kMaxText - text_.size())); }

  void End(const std::string& name) {
    path_.pop_back();
    const std::string parent = path_.empty() ? "" : path_.back();
    if (name == "sensor" && sensor_.has_value()) {
      document_.sensors[id_] = *std::exchange(sensor_, std::nullopt);
    } else if (name == "camera" && camera_.has_value()) {
      if (posed_) document_.cameras.push_back(*std::move(camera_));
      camera_.reset();
    } else if (name == "calibration") {
      passing_over_ = false;
    } else if (parent == "calibration" && sensor_.has_value() && !passing_over_) {
      EndLensNumber(name);
    } else if (name == "transform" && parent == "camera" && camera_.has_value()) {
      EndPose();
    } else if (parent == "transform" && path_.size() >= 2) {
      const std::string& of = path_[path_.size() - 2];
      if (of == "chunk") EndTransform(name, &document_.chunk);
      if (of == "component") EndTransform(name, &document_.components[id_]);
    }
    text_.clear();
  }

  const absl::Status& status() const { return status_; }
  Document Take() { return std::move(document_); }

  void Fail(std::string_view reason, std::string_view message) {
    if (status_.ok()) status_ = InvalidField(reason, field_, message);
  }

 private:
  // The adjusted one counts, before or behind the initial one; else the last.
  void StartCalibration(const Attributes& attributes) {
    const bool adjusted = attributes.Get("class") == "adjusted";
    passing_over_ = sensor_->adjusted && !adjusted;
    if (passing_over_) return;
    sensor_->adjusted = adjusted;
    sensor_->lens.clear();
    if (attributes.Find("type") != nullptr) sensor_->type = attributes.Get("type");
  }

  void StartCamera(const Attributes& attributes) {
    posed_ = false;
    const std::string enabled = attributes.Get("enabled");
    if (enabled == "false" || enabled == "0") return;
    camera_.emplace();
    camera_->label = attributes.Get("label");
    camera_->sensor = attributes.Get("sensor_id");
    camera_->component = attributes.Get("component_id");
    // The others of a system have no pose of their own: they stand beside their master.
    if (attributes.Find("master_id") != nullptr && status_.ok()) {
      status_ = Unsupported(WhereOf(field_, camera_->label), kSystem,
                            "disable all but the masters (those without a master_id), and export "
                            "the cameras again");
    }
  }

  void EndLensNumber(const std::string& name) {
    std::vector<double> numbers;
    if (!ReadNumbers(text_, &numbers) || numbers.size() != 1) return;  // "resolution", say
    if (sensor_->lens.size() >= kMaxNumbers) return Fail("BAD_XML", "a lens has too many numbers");
    sensor_->lens[name] = numbers[0];
  }

  void EndPose() {
    std::vector<double> numbers;
    if (!ReadNumbers(text_, &numbers) || numbers.size() != kPoseNumbers) {
      return Fail("BAD_NUMBER", absl::StrCat("the transform of camera '", camera_->label,
                                             "' does not have 16 finite numbers"));
    }
    std::copy_n(numbers.begin(), kPoseNumbers, camera_->chunk_from_cam.begin());
    posed_ = true;
  }

  void EndTransform(const std::string& name, ToWorld* to) {
    const std::span<double> part = name == "rotation"      ? std::span<double>(to->rotation)
                                   : name == "translation" ? to->translation
                                   : name == "scale"       ? to->scale
                                                           : std::span<double>();
    std::vector<double> numbers;
    if (part.empty()) return;
    const bool good = ReadNumbers(text_, &numbers) && numbers.size() == part.size();
    if (good) std::copy(numbers.begin(), numbers.end(), part.begin());
    if (good && to->scale[0] > 0) return;
    Fail("BAD_NUMBER", absl::StrCat("the ", name, " of the chunk or a component is not ",
                                    part.size(), " finite numbers, of a scale above 0"));
  }

  const std::string_view field_;
  absl::Status status_;
  Document document_;
  std::vector<std::string> path_;  // of open elements
  std::string text_;               // of the innermost one
  std::string id_;                 // of sensor_, or of the component
  std::optional<Sensor> sensor_;
  std::optional<PlacedCamera> camera_;
  bool posed_ = false;         // camera_ has its pose
  bool passing_over_ = false;  // the open calibration
};

absl::StatusOr<Document> ReadDocument(std::string_view xml, std::string_view field) {
  struct Context {
    Reader reader;
    XML_Parser parser;
    void StopIfFailed() {
      if (!reader.status().ok()) XML_StopParser(parser, XML_FALSE);
    }
  };
  const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(
      XML_ParserCreate(nullptr), &XML_ParserFree);
  Context context{Reader(field), parser.get()};
  XML_SetUserData(parser.get(), &context);
  XML_SetElementHandler(
      parser.get(),
      [](void* user, const char* name, const char** pairs) {
        auto* to = static_cast<Context*>(user);
        to->reader.Start(name, Attributes(pairs));
        to->StopIfFailed();
      },
      [](void* user, const char* name) {
        auto* to = static_cast<Context*>(user);
        to->reader.End(name);
        to->StopIfFailed();
      });
  XML_SetCharacterDataHandler(parser.get(), [](void* user, const char* text, int length) {
    auto* to = static_cast<Context*>(user);
    to->reader.Text({text, static_cast<size_t>(length)});
    to->StopIfFailed();
  });
  // Entities come with one; Metashape writes none.
  XML_SetStartDoctypeDeclHandler(
      parser.get(), [](void* user, const char*, const char*, const char*, int) {
        auto* to = static_cast<Context*>(user);
        to->reader.Fail("BAD_XML", "it has a DOCTYPE, which Metashape's files have not");
        to->StopIfFailed();
      });
  const XML_Status parsed =
      XML_Parse(parser.get(), xml.data(), static_cast<int>(xml.size()), /*isFinal=*/1);
  LITAGS_RETURN_IF_ERROR(context.reader.status());
  if (parsed != XML_STATUS_OK) {
    return InvalidField("BAD_XML", field,
                        absl::StrCat("line ", XML_GetCurrentLineNumber(parser.get()), ": ",
                                     XML_ErrorString(XML_GetErrorCode(parser.get())),
                                     "; the file is damaged, export the cameras again"));
  }
  return context.reader.Take();
}

// Metashape's P1 and P2 are OpenCV's p2 and p1. Pixels are counted from their corners.
absl::Status ReadLens(const Sensor& sensor, std::string_view where, LoadedView* out) {
  Camera* camera = &out->view.camera;
  LITAGS_RETURN_IF_ERROR(SetSize(sensor.width, sensor.height, where, camera));
  if (sensor.of_a_system) return Unsupported(where, kSystem);
  out->panorama = sensor.type == "spherical";
  if (out->panorama) {
    SetPanorama(camera);
    return absl::OkStatus();
  }
  const bool fisheye = sensor.type == "fisheye" || sensor.type == "equidistant_fisheye";
  if (!fisheye && sensor.type != "frame") {
    return Unsupported(where, absl::StrCat("camera type '", sensor.type, "'"));
  }
  const auto number = [&](const char* name) {
    const auto found = sensor.lens.find(name);
    return found == sensor.lens.end() ? 0 : found->second;
  };
  if (!sensor.lens.contains("f")) {
    return InvalidField("MISSING_KEY", where,
                        "its sensor has no calibration with a focal length 'f'; export the "
                        "cameras after Align Photos, with Metashape 1.2 or later");
  }
  for (const char* name : {"b2", "p3", "p4"}) {
    if (number(name) != 0) return Unsupported(where, absl::StrCat("lens coefficient ", name));
  }
  camera->fx = number("f") + number("b1");
  camera->fy = number("f");
  camera->cx = 0.5 * camera->width + number("cx");
  camera->cy = 0.5 * camera->height + number("cy");
  Distortion* lens = &out->distortion;
  *lens = {.k1 = number("k1"),
           .k2 = number("k2"),
           .p1 = number("p2"),
           .p2 = number("p1"),
           .k3 = number("k3"),
           .fisheye = fisheye};
  if (fisheye) lens->k4 = number("k4");
  if (!fisheye && number("k4") != 0) return Unsupported(where, "lens coefficient k4 of a frame");
  if (fisheye && (lens->p1 != 0 || lens->p2 != 0)) {
    return Unsupported(where, "lens coefficient p1 or p2 of a fisheye");
  }
  return absl::OkStatus();
}

// The pose is chunk_from_cam, with our axes.
absl::Status ReadPose(const PlacedCamera& from, const ToWorld& to, std::string_view where,
                      Camera* camera) {
  const auto& m = from.chunk_from_cam;
  std::array<double, 9> cam_from_world = {};
  std::array<double, 3> center = to.translation;
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 3; ++k) {
      const double rotation = to.rotation[3 * r + k];
      for (int c = 0; c < 3; ++c) cam_from_world[3 * c + r] += rotation * m[4 * k + c];
      center[r] += to.scale[0] * rotation * m[4 * k + 3];
    }
  }
  return SetPlace(cam_from_world, center, where, camera);
}

// Components share no frame.
std::string LargestComponent(const std::vector<PlacedCamera>& cameras) {
  std::map<std::string, size_t> counts;
  for (const PlacedCamera& camera : cameras) ++counts[camera.component];
  const auto largest =
      std::max_element(counts.begin(), counts.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  return largest == counts.end() ? "" : largest->first;
}

}  // namespace

bool IsXml(std::string_view text) {
  text = WithoutByteOrderMark(text);
  const size_t at = text.find_first_not_of(" \t\r\n");
  return at != std::string_view::npos && text[at] == '<';
}

absl::StatusOr<SparseModel> ParseMetashape(std::string_view xml, std::string_view field,
                                           PanoramaNames* panoramas) {
  LITAGS_ASSIGN_OR_RETURN(const Document document, ReadDocument(xml, field));
  if (document.chunks != 1) {
    return InvalidField("NO_CAMERAS", field,
                        absl::StrCat("it has ", document.chunks,
                                     " chunks, where Metashape's exported cameras have one; use "
                                     "File > Export > Export Cameras, Agisoft XML"));
  }
  const std::string component = LargestComponent(document.cameras);
  const auto own = document.components.find(component);
  const ToWorld& to = own == document.components.end() ? document.chunk : own->second;
  std::vector<LoadedView> views;
  for (const PlacedCamera& from : document.cameras) {
    if (from.component != component) continue;
    const std::string where = WhereOf(field, from.label);
    const auto sensor = document.sensors.find(from.sensor);
    if (sensor == document.sensors.end()) {
      return InvalidField("MISSING_KEY", where, "its sensor_id names no sensor");
    }
    LoadedView loaded;
    loaded.view.name = from.label;
    loaded.has_size = true;
    LITAGS_RETURN_IF_ERROR(ReadLens(sensor->second, where, &loaded));
    LITAGS_RETURN_IF_ERROR(ReadPose(from, to, where, &loaded.view.camera));
    views.push_back(std::move(loaded));
  }
  if (views.empty()) {
    return InvalidField("NO_CAMERAS", field,
                        "no camera has a pose; align the photos, then export the cameras");
  }
  return FinishModel(std::move(views), field, nullptr, panoramas);
}

}  // namespace litags
