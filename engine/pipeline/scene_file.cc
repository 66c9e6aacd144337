#include "engine/pipeline/scene_file.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/camera_spread.h"
#include "engine/core/error.h"
#include "engine/core/finite.h"
#include "engine/core/json_text.h"
#include "engine/io/container.h"
#include "engine/pipeline/model_scene.h"
#include "engine/render/renderer.h"

namespace litags {
namespace {

using Json = nlohmann::json;
constexpr char kKind[] = "scene";
// 1: before pixel filters, all of them as 3DGS has it. 3: has an origin that is not 0. 4: has a
// near plane that is not 3DGS's. Each is written only then, so that older programs read what they
// can draw.
constexpr uint32_t kVersion = 4, kWithoutNearPlane = 3, kWithoutOrigin = 2, kOldestVersion = 1;

Json ViewToJson(const View& view) {
  const Camera& c = view.camera;
  return {{"name", view.name},
          {"size", {c.width, c.height}},
          {"K", {c.fx, c.fy, c.cx, c.cy}},
          {"viewmat", c.Viewmat()}};
}

// get<int>() of a 6e49 is undefined; this throws unless the number is whole.
int IntFromJson(const Json& json) {
  return static_cast<int>(json.get_ref<const Json::number_integer_t&>());
}

View ViewFromJson(const Json& json) {
  View view;
  view.name = json.at("name").get<std::string>();
  Camera& c = view.camera;
  c.width = IntFromJson(json.at("size").at(0));
  c.height = IntFromJson(json.at("size").at(1));
  c.fx = json.at("K").at(0).get<double>();
  c.fy = json.at("K").at(1).get<double>();
  c.cx = json.at("K").at(2).get<double>();
  c.cy = json.at("K").at(3).get<double>();
  c.SetViewmat(json.at("viewmat").get<std::array<double, 16>>());
  return view;
}

absl::Status Damaged(const std::string& path, const std::string& what) {
  return MakeError(absl::StatusCode::kDataLoss, "SCENE_CORRUPT", "scene",
                   absl::StrCat(path, ": ", what, "; train the scene again"));
}

// Names of photos need not be UTF-8, as JSON has it: their bytes stand in a section of their own,
// which ends each with a 0.
std::string JoinNames(const std::vector<View>& views) {
  std::string names;
  for (const View& view : views) names.append(view.name).push_back('\0');
  return names;
}

// False if there are not as many names as views.
bool SplitNames(std::string_view names, std::vector<View>* views) {
  for (View& view : *views) {
    const size_t end = names.find('\0');
    if (end == std::string_view::npos) return false;
    view.name = names.substr(0, end);
    names.remove_prefix(end + 1);
  }
  return names.empty();
}

// "Gaussian 3 holds a NaN or an infinity", "the denoiser holds ..."; "" if all is finite.
std::string NotFinite(const Model& model) {
  if (const size_t i = model.splats.FirstNotFinite(); i < model.splats.size()) {
    return absl::StrCat("Gaussian ", i, " holds a NaN or an infinity");
  }
  for (const std::vector<float>& net : model.pdm.nets) {
    if (FirstNotFinite(net.data(), net.size()) < net.size()) {
      return "the denoiser holds a NaN or an infinity";
    }
  }
  return "";
}

Json PdmToJson(const PdmOptions& p) {
  return {{"stages", p.stages},
          {"hidden", p.hidden},
          {"shared", p.shared},
          {"filter_size", p.filter_size},
          {"filter_sigma", p.filter_sigma},
          {"zero_border", p.border == PdmBorder::kZero},
          {"clamp_R", p.clamp_R}};
}

PdmOptions PdmFromJson(const Json& json) {
  return {.stages = IntFromJson(json.at("stages")),
          .hidden = IntFromJson(json.at("hidden")),
          .shared = json.at("shared").get<bool>(),
          .filter_size = IntFromJson(json.at("filter_size")),
          .filter_sigma = json.at("filter_sigma").get<float>(),
          .border = json.at("zero_border").get<bool>() ? PdmBorder::kZero : PdmBorder::kReflect101,
          .clamp_R = json.at("clamp_R").get<bool>()};
}

// What is not in sections of its own: of the Gaussians and the denoiser's `nets` their number.
absl::Status ReadMeta(const Container& file, const std::string& path, Model* model,
                      std::vector<View>* views, size_t* nets) {
  LITAGS_ASSIGN_OR_RETURN(const std::string_view meta, file.Section("meta"));
  LITAGS_ASSIGN_OR_RETURN(const std::string_view splats, file.Section("splats"));
  try {
    const Json json = ParseJson(meta);
    if (json.is_discarded()) return Damaged(path, "its description is no JSON");
    model->lita = json.at("lita").get<bool>();
    model->use_pdm = json.at("use_pdm").get<bool>();
    const bool antialiased = file.version() >= 2 && json.at("antialiased").get<bool>();
    model->pixel_filter = antialiased ? PixelFilter::kMip : PixelFilter::kDilate;
    model->sh_degree = IntFromJson(json.at("sh_degree"));
    model->iteration = IntFromJson(json.at("iteration"));
    const size_t gaussians = json.at("gaussians").get_ref<const Json::number_unsigned_t&>();
    // Before Resize, so that a wrong number cannot ask for all the memory there is.
    const size_t blocks = gaussians / kSplatBlock + (gaussians % kSplatBlock != 0);
    if (blocks != splats.size() / (Splats::kBlockFloats * sizeof(float))) {
      return Damaged(path, "the number of Gaussians does not fit their data");
    }
    model->splats.Resize(gaussians);
    for (const Json& view : json.at("views")) views->push_back(ViewFromJson(view));
    model->pdm_options = PdmFromJson(json.at("pdm"));
    *nets = json.at("pdm").at("nets").get_ref<const Json::number_unsigned_t&>();
    if (file.version() > kWithoutOrigin) json.at("origin").get_to(model->origin);
    if (file.version() > kWithoutNearPlane) json.at("near_plane").get_to(model->near_plane);
    if (json.contains("noise")) model->noise = json.at("noise").get<NoiseCurve>();
    if (json.contains("curve")) model->curve = json.at("curve").get<CodeCurve>();
  } catch (const Json::exception& e) {
    return Damaged(path, e.what());
  }
  if (model->sh_degree < 0 || model->sh_degree > kMaxShDegree) {
    return Damaged(path, absl::StrCat("SH degree ", model->sh_degree, " does not exist"));
  }
  if (!(model->near_plane > 0)) return Damaged(path, "its near plane is not in front of cameras");
  if (const absl::Status s = model->pdm_options.Validate(); !s.ok()) {
    return Damaged(path, std::string(s.message()));
  }
  return absl::OkStatus();
}

absl::Status ReadDenoiser(const Container& file, const std::string& path, size_t nets,
                          Model* model) {
  model->pdm = PdmWeights::Zeros(model->pdm_options);
  if (!model->use_pdm) return absl::OkStatus();
  const absl::Status other_shape = Damaged(path, "the denoiser has another shape");
  if (nets != model->pdm.nets.size()) return other_shape;
  for (size_t k = 0; k < nets; ++k) {
    LITAGS_ASSIGN_OR_RETURN(std::vector<float> net, file.Array<float>(absl::StrCat("pdm", k)));
    if (net.size() != model->pdm.nets[k].size()) return other_shape;
    model->pdm.nets[k] = std::move(net);
  }
  return absl::OkStatus();
}

}  // namespace

SceneFrame FrameOfViews(const std::vector<View>& all) {
  SceneFrame frame;
  if (all.empty()) return frame;
  const std::vector<View> views = NearViews(all);
  // sum (I - d d^T) x = sum (I - d d^T) c over optical axes c + s d.
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero(),
                  up = Eigen::Vector3d::Zero(), forward = Eigen::Vector3d::Zero();
  for (const View& view : views) {
    const auto& R = view.camera.R;
    const auto c = view.camera.Center();
    const Eigen::Vector3d center(c[0], c[1], c[2]), axis(R[6], R[7], R[8]);
    const Eigen::Matrix3d P = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    A += P;
    b += P * center;
    mean += center / views.size();
    forward += axis;
    up -= Eigen::Vector3d(R[3], R[4], R[5]);
  }
  // No common up: any unit vector will do.
  up = up.norm() > 1e-9 ? Eigen::Vector3d(up.normalized()) : -Eigen::Vector3d::UnitY();
  if (forward.norm() > 1e-9) forward.normalize();
  double spread = 0;
  for (const View& view : views) {
    const auto c = view.camera.Center();
    spread = std::max(spread, (Eigen::Vector3d(c[0], c[1], c[2]) - mean).norm());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(A / views.size());
  // One place, to roundings, says nothing of the unit.
  const double ahead = spread > 1e-9 * mean.norm() ? spread : 1;
  Eigen::Vector3d center = mean + forward * ahead;
  if (solver.eigenvalues()[0] > 1e-3) center = A.ldlt().solve(b);
  double radius = 0;
  for (const View& view : views) {
    const auto c = view.camera.Center();
    radius += (Eigen::Vector3d(c[0], c[1], c[2]) - center).norm() / views.size();
  }
  frame.center = {center.x(), center.y(), center.z()};
  frame.up = {up.x(), up.y(), up.z()};
  frame.radius = radius > 0 ? radius : 1;
  return frame;
}

absl::Status SaveScene(const std::string& path, const Model& model,
                       const std::vector<View>& views) {
  if (const std::string what = NotFinite(model); !what.empty()) {
    return MakeError(absl::StatusCode::kInternal, "NOT_FINITE", "scene",
                     absl::StrCat(path, ": ", what, "; the scene is not saved"));
  }
  Json json = {{"lita", model.lita},
               {"use_pdm", model.use_pdm},
               {"antialiased", model.pixel_filter == PixelFilter::kMip},
               {"sh_degree", model.sh_degree},
               {"iteration", model.iteration},
               {"gaussians", model.splats.size()},
               {"views", Json::array()}};
  for (const View& view : views) json["views"].push_back(ViewToJson(view));
  json["pdm"] = PdmToJson(model.pdm_options);
  json["pdm"]["nets"] = model.pdm.nets.size();
  if (model.noise.has_value()) json["noise"] = *model.noise;
  if (model.curve.has_value()) json["curve"] = *model.curve;
  uint32_t version = kWithoutOrigin;
  if (model.origin != std::array<double, 3>{}) version = kWithoutNearPlane;
  if (model.near_plane != RenderSettings().near_plane) version = kVersion;
  if (version > kWithoutOrigin) json["origin"] = model.origin;
  if (version > kWithoutNearPlane) json["near_plane"] = model.near_plane;
  ContainerWriter out(kKind, version);
  out.AddSection("meta", JsonText(json));
  out.AddSection("names", JoinNames(views));
  const AlignedFloats& data = model.splats.data();
  out.AddSectionView("splats",
                     {reinterpret_cast<const char*>(data.data()), data.size() * sizeof(float)});
  for (size_t k = 0; k < model.pdm.nets.size(); ++k) {
    out.AddArrayView(absl::StrCat("pdm", k), model.pdm.nets[k]);
  }
  return out.Commit(path);
}

absl::StatusOr<std::shared_ptr<const Scene>> LoadSceneFile(const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(const Container file,
                          Container::Read(path, kKind, kOldestVersion, kVersion));
  Model model;
  std::vector<View> views;
  size_t nets = 0;
  LITAGS_RETURN_IF_ERROR(ReadMeta(file, path, &model, &views, &nets));
  if (file.Has("names")) {
    LITAGS_ASSIGN_OR_RETURN(const std::string_view names, file.Section("names"));
    if (!SplitNames(names, &views)) return Damaged(path, "the views' names do not fit the views");
  }
  for (const View& view : views) {
    if (const absl::Status s = view.camera.Validate("camera"); !s.ok()) {
      return Damaged(path, absl::StrCat("view ", view.name, ": ", s.message()));
    }
  }
  LITAGS_ASSIGN_OR_RETURN(const std::string_view splats, file.Section("splats"));
  if (splats.size() != model.splats.data().size() * sizeof(float)) {
    return Damaged(path, "the Gaussians are cut short");
  }
  std::memcpy(model.splats.data().data(), splats.data(), splats.size());
  // Lanes past the last Gaussian are zero, whatever was read.
  model.splats.Resize(model.splats.size());
  LITAGS_RETURN_IF_ERROR(ReadDenoiser(file, path, nets, &model));
  if (const std::string what = NotFinite(model); !what.empty()) return Damaged(path, what);
  return MakeScene(std::move(model), std::move(views));
}

}  // namespace litags
