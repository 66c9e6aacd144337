#include "server/api/render_service.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "engine/core/error.h"
#include "server/api/camera_path.h"
#include "server/api/list_page.h"
#include "server/api/picture.h"
#include "server/api/scene_calls.h"
#include "server/api/view_request.h"

namespace litags {
namespace {

constexpr int kDefaultCameras = 1000, kMaxCameras = 10000;

v1::Vector3 ToProto(const std::array<double, 3>& v) {
  v1::Vector3 proto;
  proto.set_x(v[0]);
  proto.set_y(v[1]);
  proto.set_z(v[2]);
  return proto;
}

absl::Status Render(Call& call, const Scene& scene, const RenderRequest& request,
                    const v1::RenderSettings& settings, v1::RenderedView* view) {
  const auto start = std::chrono::steady_clock::now();
  LITAGS_ASSIGN_OR_RETURN(const Planes planes, scene.Render(request));
  view->set_iteration(scene.iteration());
  *view->mutable_camera() = CameraToProto(request.camera);
  view->set_light(request.light);
  view->set_exposure_stops(request.exposure_stops);
  LITAGS_RETURN_IF_ERROR(
      EncodePicture(planes, request.channel, settings.format(), settings.jpeg_quality(), view));
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  call.metrics().AddPicture(elapsed.count());
  return absl::OkStatus();
}

// One RenderPath stream: a frame a message.
class PathStream : public SceneStream<v1::RenderPathResponse> {
 public:
  PathStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
             const v1::RenderPathRequest& request, SceneCache* scenes, ThreadPool* pool,
             RenderLimits limits)
      : SceneStream(std::move(call), context, pool, scenes), request_(request), limits_(limits) {
    Begin();
  }

 private:
  absl::StatusOr<Made> Next(v1::RenderPathResponse* message) override {
    LITAGS_ASSIGN_OR_RETURN(const auto scene, GetScene(request_.name()));
    if (!scene) return Made::kLater;
    if (!resolved_) LITAGS_RETURN_IF_ERROR(Resolve(*scene));
    const int frame = static_cast<int>(next_), frames = static_cast<int>(cameras_.size());
    message->Clear();
    message->set_frame(frame);
    message->set_frames(frames);
    RenderRequest render = content_.Frame(frame, frames);
    render.camera = cameras_[next_++];
    render.threads = limits_.threads;
    render.cancel = cancel();
    LITAGS_RETURN_IF_ERROR(
        Render(call(), *scene, render, request_.settings(), message->mutable_view()));
    return Made::kMessage;
  }

  bool IsDone() const override { return resolved_ && next_ == cameras_.size(); }

  absl::Status Resolve(const Scene& scene) {
    LITAGS_ASSIGN_OR_RETURN(content_, ResolvePathContent(request_));
    std::string lens_camera;
    if (request_.has_keyframes() && request_.keyframes().poses_size() > 0) {
      lens_camera = request_.keyframes().poses(0).camera();
    }
    LITAGS_ASSIGN_OR_RETURN(const Camera lens,
                            ResolveLens(request_.settings(), lens_camera,
                                        "keyframes.poses[0].camera", scene, limits_.max_pixels));
    LITAGS_ASSIGN_OR_RETURN(std::vector<Camera> cameras,
                            ResolvePath(request_, lens, scene, cancel()));
    LITAGS_RETURN_IF_ERROR(call().Keep(static_cast<int64_t>(cameras.capacity() * sizeof(Camera))));
    cameras_ = std::move(cameras);
    resolved_ = true;
    return absl::OkStatus();
  }

  const v1::RenderPathRequest& request_;  // gRPC's, which outlives this
  const RenderLimits limits_;
  bool resolved_ = false;
  PathContent content_;
  std::vector<Camera> cameras_;
  size_t next_ = 0;
};

}  // namespace

grpc::ServerUnaryReactor* RenderServiceImpl::RenderView(grpc::CallbackServerContext* context,
                                                        const v1::RenderViewRequest* request,
                                                        v1::RenderedView* response) {
  const CallName name{"RenderView", CallKind::kPicture};
  const auto check = [](const Call& call) { return call.CheckRoom(); };
  const auto work = [=, this](Call& call, const CancelToken& cancel,
                              const Scene& scene) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(RenderRequest render, ResolveContent(request->settings()));
    LITAGS_ASSIGN_OR_RETURN(
        const Camera lens, ResolveLens(request->settings(), request->pose().camera(), "pose.camera",
                                       scene, limits_.max_pixels));
    LITAGS_ASSIGN_OR_RETURN(render.camera, ResolvePose(request->pose(), lens, scene, "pose"));
    render.threads = limits_.threads;
    render.cancel = cancel;
    LITAGS_RETURN_IF_ERROR(Render(call, scene, render, request->settings(), response));
    call.Hold(static_cast<int64_t>(response->ByteSizeLong()));
    return absl::OkStatus();
  };
  return RunWithScene(gate_, context, name, pool_, scenes_, request, check, work);
}

grpc::ServerWriteReactor<v1::RenderPathResponse>* RenderServiceImpl::RenderPath(
    grpc::CallbackServerContext* context, const v1::RenderPathRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::RenderPathResponse>>(
      gate_, context, {"RenderPath", CallKind::kPictureStream}, request,
      [&](std::shared_ptr<Call> call) {
        return new PathStream(std::move(call), context, *request, scenes_, pool_, limits_);
      });
}

grpc::ServerUnaryReactor* RenderServiceImpl::ListCameras(grpc::CallbackServerContext* context,
                                                         const v1::ListCamerasRequest* request,
                                                         v1::ListCamerasResponse* response) {
  const CallName name{"ListCameras", CallKind::kPicture};
  const auto check = [](const Call& call) { return call.CheckRoom(); };
  const auto work = [=](Call& call, const CancelToken&, const Scene& scene) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(PageRoom room,
                            PageRoom::Make(request->page_size(), kDefaultCameras, kMaxCameras));
    const std::string& token = request->page_token();
    if (token.size() % 2 != 0 || !std::all_of(token.begin(), token.end(), absl::ascii_isxdigit)) {
      return BadPageToken("ListCameras");
    }
    const std::string last = absl::HexStringToBytes(token);  // of the page before, by name
    for (const View& view : scene.views()) {
      if (!token.empty() && view.name <= last) continue;
      v1::NamedCamera camera;
      camera.set_name(view.name);
      *camera.mutable_camera() = CameraToProto(view.camera);
      if (!room.Takes(camera.ByteSizeLong())) {
        const std::string& shown = response->cameras().rbegin()->name();
        response->set_next_page_token(absl::BytesToHexString(shown));
        break;
      }
      *response->add_cameras() = std::move(camera);
    }
    *response->mutable_center() = ToProto(scene.center());
    *response->mutable_up() = ToProto(scene.up());
    response->set_radius(scene.radius());
    response->set_iteration(scene.iteration());
    response->set_gaussians(scene.num_gaussians());
    call.Hold(static_cast<int64_t>(response->ByteSizeLong()));
    return absl::OkStatus();
  };
  return RunWithScene(gate_, context, name, pool_, scenes_, request, check, work);
}

}  // namespace litags
