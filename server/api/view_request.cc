#include "server/api/view_request.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/pipeline/render_rules.h"

namespace litags {
namespace {

static_assert(static_cast<int>(Channel::kColor) + 1 == v1::CHANNEL_COLOR);
static_assert(static_cast<int>(Channel::kLight) + 1 == v1::CHANNEL_LIGHT);
static_assert(static_cast<int>(Channel::kAlpha) + 1 == v1::CHANNEL_ALPHA);

std::array<double, 3> ToArray(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

bool AllFinite(const std::array<double, 3>& v) {
  return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
}

absl::Status NotFinite(const std::string& field) {
  return InvalidInput("POSE_NOT_FINITE", field,
                      absl::StrCat(field, " holds a NaN or an infinity; give finite numbers"));
}

// Picture size from the settings and the aspect ratio of `base`.
absl::Status ResolveSize(const v1::RenderSettings& settings, const Camera& base, int64_t max_pixels,
                         int64_t* width, int64_t* height) {
  *width = settings.width();
  *height = settings.height();
  if (*width < 0 || *height < 0) {
    return InvalidInput("PICTURE_SIZE_INVALID", *width < 0 ? "settings.width" : "settings.height",
                        absl::StrCat("a picture of ", *width, "x", *height,
                                     " px cannot be made; sizes are positive, or 0 for the "
                                     "camera's own"));
  }
  if (*width == 0 && *height == 0) {
    *width = base.width;
    *height = base.height;
  } else if (*width == 0) {
    *width = std::max<int64_t>(1, std::llround(double(*height) * base.width / base.height));
  } else if (*height == 0) {
    *height = std::max<int64_t>(1, std::llround(double(*width) * base.height / base.width));
  }
  if (std::max(*width, *height) > kMaxImageSide) {
    return InvalidInput(
        "PICTURE_SIZE_INVALID", *width > kMaxImageSide ? "settings.width" : "settings.height",
        absl::StrCat("a picture of ", *width, "x", *height,
                     " px cannot be made; no side may have more than ", kMaxImageSide, " px"));
  }
  if (*width * *height > max_pixels) {
    return MakeError(absl::StatusCode::kResourceExhausted, "PICTURE_TOO_LARGE", "settings.width",
                     absl::StrCat("a picture of ", *width, "x", *height, " px exceeds the ",
                                  max_pixels, " px this server renders; ask for a smaller one"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RenderRequest> ResolveContent(const v1::RenderSettings& settings) {
  RenderRequest request;
  if (!v1::Channel_IsValid(settings.channel())) {
    return InvalidInput("CHANNEL_UNKNOWN", "settings.channel",
                        absl::StrCat("the server does not know channel ", settings.channel()));
  }
  if (settings.channel() != v1::CHANNEL_UNSPECIFIED) {
    request.channel = static_cast<Channel>(settings.channel() - 1);
  }
  if (!v1::PictureFormat_IsValid(settings.format())) {
    return InvalidInput("FORMAT_UNKNOWN", "settings.format",
                        absl::StrCat("the server does not know format ", settings.format()));
  }
  request.light = settings.light();
  request.exposure_stops = settings.exposure_stops();
  LITAGS_RETURN_IF_ERROR(CheckLight(request.light, "settings.light"));
  LITAGS_RETURN_IF_ERROR(CheckExposure(request.exposure_stops, "settings.exposure_stops"));
  if (request.light != 0 && request.channel != Channel::kLight) {
    return InvalidInput("LIGHT_INVALID", "settings.light",
                        "light is for CHANNEL_LIGHT only; set the channel or leave it 0");
  }
  if (request.exposure_stops != 0) {
    LITAGS_RETURN_IF_ERROR(CheckExposable(request.channel, "settings.exposure_stops"));
  }
  if (request.channel == Channel::kOriginal) request.light = 1;
  if (settings.jpeg_quality() < 0 || settings.jpeg_quality() > 100) {
    return InvalidInput("JPEG_QUALITY_INVALID", "settings.jpeg_quality",
                        absl::StrCat("jpeg_quality is ", settings.jpeg_quality(),
                                     "; it must be in 1..100, or 0 for the default"));
  }
  return request;
}

absl::StatusOr<PathContent> ResolvePathContent(const v1::RenderPathRequest& request) {
  const v1::RenderSettings& settings = request.settings();
  PathContent content;
  LITAGS_ASSIGN_OR_RETURN(content.first, ResolveContent(settings));
  content.last = content.first;
  if (request.has_light()) {
    LITAGS_RETURN_IF_ERROR(CheckLight(request.light().first(), "light.first"));
    LITAGS_RETURN_IF_ERROR(CheckLight(request.light().last(), "light.last"));
    if (settings.light() != 0 || (settings.channel() != v1::CHANNEL_UNSPECIFIED &&
                                  settings.channel() != v1::CHANNEL_LIGHT)) {
      return InvalidInput("LIGHT_INVALID", "light",
                          "light is said twice; with light along the path leave settings.light 0 "
                          "and settings.channel unset or LIGHT");
    }
    content.first.channel = content.last.channel = Channel::kLight;
    content.first.light = request.light().first();
    content.last.light = request.light().last();
  }
  if (request.has_exposure_stops()) {
    const v1::Ramp& stops = request.exposure_stops();
    LITAGS_RETURN_IF_ERROR(CheckExposure(stops.first(), "exposure_stops.first"));
    LITAGS_RETURN_IF_ERROR(CheckExposure(stops.last(), "exposure_stops.last"));
    LITAGS_RETURN_IF_ERROR(CheckExposable(content.first.channel, "exposure_stops"));
    if (settings.exposure_stops() != 0) {
      return InvalidInput("EXPOSURE_INVALID", "exposure_stops",
                          "exposure is said twice; with exposure_stops along the path leave "
                          "settings.exposure_stops 0");
    }
    content.first.exposure_stops = stops.first();
    content.last.exposure_stops = stops.last();
  }
  return content;
}

RenderRequest PathContent::Frame(int frame, int frames) const {
  const double u = frames > 1 ? static_cast<double>(frame) / (frames - 1) : 0;
  RenderRequest request = first;
  request.light = std::lerp(first.light, last.light, u);
  request.exposure_stops = std::lerp(first.exposure_stops, last.exposure_stops, u);
  return request;
}

absl::StatusOr<Camera> CameraFinder::Find(const std::string& name, const std::string& field) {
  for (const View& view : scene_.views()) {
    if (view.name == name) return view.camera;
  }
  if (!index_) {
    for (const View& view : scene_.views()) names_.push_back(view.name);
    index_.emplace(names_);
  }
  // As names of photos in files of cameras are matched, where only one is meant.
  std::vector<size_t> alike = index_->FindAlike(name);
  if (const auto exact = index_->FindExact(name)) alike = {*exact};
  if (alike.size() == 1) return scene_.views()[alike[0]].camera;
  std::string meant;
  for (const size_t i : alike) absl::StrAppend(&meant, meant.empty() ? "" : " or ", names_[i]);
  return MakeError(absl::StatusCode::kNotFound, "CAMERA_NOT_FOUND", field,
                   absl::StrCat("the scene has no camera \"", name, "\"; ",
                                meant.empty() ? "ListCameras names those it has"
                                              : absl::StrCat("did you mean ", meant, "?")));
}

absl::StatusOr<Camera> ResolveLens(const v1::RenderSettings& settings,
                                   const std::string& camera_name, const std::string& field,
                                   const Scene& scene, int64_t max_pixels) {
  Camera base;
  if (!camera_name.empty()) {
    LITAGS_ASSIGN_OR_RETURN(base, CameraFinder(scene).Find(camera_name, field));
  } else if (!scene.views().empty()) {
    base = scene.views().front().camera;
  } else {
    return MakeError(absl::StatusCode::kInternal, "SCENE_WITHOUT_CAMERAS", "",
                     "the scene file has no cameras; rerun the job");
  }
  int64_t width = 0, height = 0;
  LITAGS_RETURN_IF_ERROR(ResolveSize(settings, base, max_pixels, &width, &height));
  Camera camera = base.Scaled(static_cast<int>(width), static_cast<int>(height));
  if (settings.has_intrinsics()) {
    if (settings.width() == 0 || settings.height() == 0) {
      return InvalidInput("PICTURE_SIZE_INVALID", "settings.width",
                          "intrinsics are in px of the picture; give its width and height too");
    }
    camera.fx = settings.intrinsics().fx();
    camera.fy = settings.intrinsics().fy();
    camera.cx = settings.intrinsics().cx();
    camera.cy = settings.intrinsics().cy();
  } else if (settings.lens_case() == v1::RenderSettings::kVerticalFovDeg) {
    const double fov = settings.vertical_fov_deg();
    if (!(fov > 0 && fov < 180)) {
      return InvalidInput("FIELD_OF_VIEW_INVALID", "settings.vertical_fov_deg",
                          absl::StrCat("vertical_fov_deg is ", fov, "; it must be in (0, 180)"));
    }
    camera.fx = camera.fy = 0.5 * camera.height / std::tan(fov * M_PI / 360);
    camera.cx = 0.5 * camera.width;
    camera.cy = 0.5 * camera.height;
  }
  LITAGS_RETURN_IF_ERROR(camera.Validate("settings.intrinsics", max_pixels));
  return camera;
}

absl::StatusOr<Camera> ResolvePose(const v1::Pose& pose, const Camera& lens, CameraFinder& cameras,
                                   const std::string& field) {
  Camera camera = lens;
  switch (pose.pose_case()) {
    case v1::Pose::kViewmat: {
      const std::string where = field + ".viewmat";
      const auto& values = pose.viewmat().values();
      if (values.size() != 16) {
        return InvalidInput("POSE_SIZE", where,
                            absl::StrCat(where, " has ", values.size(),
                                         " numbers; a 4x4 matrix, row by row, has 16"));
      }
      std::array<double, 16> viewmat;
      std::copy(values.begin(), values.end(), viewmat.begin());
      for (const double v : viewmat) {
        if (!std::isfinite(v)) return NotFinite(where);
      }
      camera.SetViewmat(viewmat);
      const bool last_row = std::abs(viewmat[12]) + std::abs(viewmat[13]) + std::abs(viewmat[14]) +
                                std::abs(viewmat[15] - 1) <
                            1e-6;
      if (!last_row || !camera.Validate(where).ok()) {
        return InvalidInput("POSE_NOT_RIGID", where,
                            absl::StrCat(where,
                                         " is not [R t; 0 0 0 1] with a rotation R; it is "
                                         "world-to-camera, without scale"));
      }
      return camera;
    }
    case v1::Pose::kLookAt: {
      const v1::LookAt& look = pose.look_at();
      const auto eye = ToArray(look.eye()), target = ToArray(look.target());
      const auto up = look.has_up() ? ToArray(look.up()) : cameras.scene().up();
      if (!AllFinite(eye)) return NotFinite(field + ".look_at.eye");
      if (!AllFinite(target)) return NotFinite(field + ".look_at.target");
      if (!AllFinite(up)) return NotFinite(field + ".look_at.up");
      if (!camera.LookAt(eye, target, up).ok()) {
        return InvalidInput("LOOK_AT_DEGENERATE", field + ".look_at",
                            absl::StrCat(field,
                                         ".look_at: eye and target must differ, and up must "
                                         "not be parallel to the line between them"));
      }
      return camera;
    }
    case v1::Pose::kCamera: {
      LITAGS_ASSIGN_OR_RETURN(const Camera named, cameras.Find(pose.camera(), field + ".camera"));
      camera.R = named.R;
      camera.t = named.t;
      return camera;
    }
    case v1::Pose::POSE_NOT_SET:
      break;
  }
  return InvalidInput("POSE_MISSING", field,
                      absl::StrCat(field,
                                   " is not set; give a viewmat, a look_at or the name of a "
                                   "photo's camera"));
}

v1::Camera CameraToProto(const Camera& camera) {
  v1::Camera proto;
  proto.set_width(camera.width);
  proto.set_height(camera.height);
  proto.mutable_intrinsics()->set_fx(camera.fx);
  proto.mutable_intrinsics()->set_fy(camera.fy);
  proto.mutable_intrinsics()->set_cx(camera.cx);
  proto.mutable_intrinsics()->set_cy(camera.cy);
  for (const double v : camera.Viewmat()) proto.mutable_viewmat()->add_values(v);
  return proto;
}

}  // namespace litags
