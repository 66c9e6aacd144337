#include "engine/io/openmvg_io.h"

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/bounded_json.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kDropped[] = {"structure", "control_points"};

absl::Status Bad(std::string_view where, std::string_view what) {
  return InvalidField("MISSING_KEY", where,
                      absl::StrCat(Absl(what), "; write the file again with OpenMVG"));
}

// "ptr_wrapper": {"data": ...}, as its library writes objects.
const Json& DataOf(const Json& value) {
  return Member(Member(Member(value, "value"), "ptr_wrapper"), "data");
}

absl::Status ReadDistortion(const std::string& type, const Json& data, std::string_view where,
                            Distortion* d) {
  std::vector<double> k;
  const auto read = [&](const char* key, size_t count) {
    k.assign(count, 0);
    return ReadNumbers(Member(data, key), k);
  };
  if (type == "pinhole") return absl::OkStatus();
  bool good = false;
  if (type == "pinhole_radial_k1") {
    good = read("disto_k1", 1);
    if (good) d->k1 = k[0];
  } else if (type == "pinhole_radial_k3") {
    good = read("disto_k3", 3);
    if (good) d->k1 = k[0], d->k2 = k[1], d->k3 = k[2];
  } else if (type == "pinhole_brown_t2") {
    good = read("disto_t2", 5);
    if (good) d->k1 = k[0], d->k2 = k[1], d->k3 = k[2], d->p1 = k[3], d->p2 = k[4];
  } else if (type == "fisheye") {
    good = read("fisheye", 4);
    if (good) *d = {.k1 = k[0], .k2 = k[1], .k3 = k[2], .k4 = k[3], .fisheye = true};
  } else {
    return InvalidField(
        "UNSUPPORTED_CAMERA_MODEL", where,
        absl::StrCat("OpenMVG's lens '", type, "' is not read; undistort the photos first"));
  }
  return good ? absl::OkStatus() : Bad(where, absl::StrCat("the lens '", type, "' lacks numbers"));
}

// It has a size and nothing else, as a member of its base class.
absl::Status ReadSphere(const Json& data, std::string_view where, Camera* camera) {
  const Json& base = Member(data, "value0");
  const Json& size = base.is_object() ? base : data;
  double width = 0, height = 0;
  if (!ReadNumber(Member(size, "width"), &width) || !ReadNumber(Member(size, "height"), &height)) {
    return Bad(where, "it lacks width or height");
  }
  LITAGS_RETURN_IF_ERROR(SetSize(width, height, where, camera));
  SetPanorama(camera);
  return absl::OkStatus();
}

// By key. Only the first lens of a type names it; the others have its number.
absl::StatusOr<std::map<std::string, LoadedView>> ReadLenses(const Json& list,
                                                             std::string_view field) {
  constexpr uint32_t kFirst = 0x80000000;
  std::map<std::string, LoadedView> lenses;
  std::map<uint32_t, std::string> types;
  for (const Json& entry : list) {
    const std::string key = TextOf(Member(entry, "key"));
    const std::string where = absl::StrCat(Absl(field), ".intrinsics[", key, "]");
    const Json& value = Member(entry, "value");
    const Json& id = Member(value, "polymorphic_id");
    const uint32_t number = id.is_number_unsigned() ? id.get<uint32_t>() & ~kFirst : 0;
    if (const Json& name = Member(value, "polymorphic_name"); name.is_string()) {
      types[number] = name.get<std::string>();
    }
    const Json& data = DataOf(entry);
    LoadedView lens;
    lens.panorama = types.contains(number) && types[number] == "spherical";
    if (lens.panorama) {
      LITAGS_RETURN_IF_ERROR(ReadSphere(data, where, &lens.view.camera));
      lenses[key] = lens;
      continue;
    }
    double width = 0, height = 0, center[2] = {};
    if (!ReadNumber(Member(data, "width"), &width) ||
        !ReadNumber(Member(data, "height"), &height) ||
        !ReadNumber(Member(data, "focal_length"), &lens.view.camera.fx) ||
        !ReadNumbers(Member(data, "principal_point"), center) || !types.contains(number)) {
      return Bad(where, "it lacks its type, width, height, focal_length or principal_point");
    }
    LITAGS_RETURN_IF_ERROR(SetSize(width, height, where, &lens.view.camera));
    lens.has_size = true;
    lens.view.camera.fy = lens.view.camera.fx;
    lens.view.camera.cx = center[0] + 0.5;
    lens.view.camera.cy = center[1] + 0.5;
    LITAGS_RETURN_IF_ERROR(ReadDistortion(types[number], data, where, &lens.distortion));
    lenses[key] = lens;
  }
  return lenses;
}

}  // namespace

bool IsOpenMvg(std::string_view json) {
  return json.find("\"sfm_data_version\"") != std::string_view::npos;
}

absl::StatusOr<SparseModel> ParseOpenMvg(std::string_view json, std::string_view field,
                                         PanoramaNames* panoramas) {
  LITAGS_ASSIGN_OR_RETURN(const Json top, ParseBoundedJson(json, field, kDropped));
  LITAGS_ASSIGN_OR_RETURN(const auto lenses, ReadLenses(Member(top, "intrinsics"), field));
  std::map<std::string, const Json*> poses;
  for (const Json& entry : Member(top, "extrinsics")) {
    poses[TextOf(Member(entry, "key"))] = &Member(entry, "value");
  }
  std::vector<LoadedView> views;
  for (const Json& entry : Member(top, "views")) {
    const Json& data = DataOf(entry);
    const auto pose = poses.find(TextOf(Member(data, "id_pose")));
    if (pose == poses.end()) continue;  // OpenMVG could not place it
    const std::string folder = TextOf(Member(data, "local_path"));
    const std::string file = TextOf(Member(data, "filename"));
    const std::string name = folder.empty() ? file : absl::StrCat(folder, "/", file);
    const std::string where = absl::StrCat(Absl(field), ".views[", name, "]");
    const auto lens = lenses.find(TextOf(Member(data, "id_intrinsic")));
    if (lens == lenses.end()) return Bad(where, "its id_intrinsic names no lens");
    LoadedView loaded = lens->second;
    loaded.view.name = name;
    double rows[9], center[3];
    const Json& rotation = Member(*pose->second, "rotation");
    bool good = rotation.is_array() && rotation.size() == 3 &&
                ReadNumbers(Member(*pose->second, "center"), center);
    for (size_t r = 0; good && r < 3; ++r) {
      good = ReadNumbers(rotation[r], std::span(rows).subspan(3 * r, 3));
    }
    if (!good) return Bad(where, "its pose lacks rotation or center");
    LITAGS_RETURN_IF_ERROR(SetPlace(rows, center, where, &loaded.view.camera));
    views.push_back(std::move(loaded));
  }
  if (views.empty()) {
    return InvalidField("NO_CAMERAS", field,
                        "no view has a pose; give the file that OpenMVG's reconstruction wrote");
  }
  return FinishModel(std::move(views), field, nullptr, panoramas);
}

}  // namespace litags
