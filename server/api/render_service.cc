#include "server/api/render_service.h"

#include <chrono>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/camera_path.h"
#include "server/api/grpc_order.h"
#include "server/api/picture.h"
#include "server/api/status.h"
#include "server/api/unary.h"
#include "server/api/view_request.h"

namespace litags {
namespace {

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

// One RenderPath stream: renders a frame, sends it, renders the next. Deletes itself when the call
// is over.
class PathReactor : public grpc::ServerWriteReactor<v1::RenderPathResponse> {
 public:
  PathReactor(std::shared_ptr<Call> call, const v1::RenderPathRequest& request, SceneCache* scenes,
              ThreadPool* pool, RenderLimits limits)
      : call_(std::move(call)), request_(request), scenes_(scenes), pool_(pool), limits_(limits) {
    const absl::Status accepted = pool_->Try([this] { Begin(); });
    if (!accepted.ok()) Finish(call_->End(accepted));
  }

  void OnWriteDone(bool ok) override {
    AfterStart(this);
    if (!ok) return Finish(call_->End(CallCancelled()));
    pool_->Run([this] { SendNext(); });
  }

  void OnCancel() override { cancel_.Cancel(); }

  void OnDone() override { delete this; }

 private:
  void Begin() {
    if (const absl::Status status = Resolve(); !status.ok()) return Finish(call_->End(status));
    SendNext();
  }

  absl::Status Resolve() {
    LITAGS_ASSIGN_OR_RETURN(scene_, scenes_->Get(call_->jobs(), request_.name()));
    LITAGS_ASSIGN_OR_RETURN(content_, ResolvePathContent(request_));
    std::string lens_camera;
    if (request_.has_keyframes() && request_.keyframes().poses_size() > 0) {
      lens_camera = request_.keyframes().poses(0).camera();
    }
    LITAGS_ASSIGN_OR_RETURN(const Camera lens, ResolveLens(request_.settings(), lens_camera,
                                                           *scene_, limits_.max_pixels));
    LITAGS_ASSIGN_OR_RETURN(cameras_, ResolvePath(request_, lens, *scene_));
    return absl::OkStatus();
  }

  void SendNext() {
    if (cancel_.IsCancelled()) return Finish(call_->End(CallCancelled()));
    if (next_ == cameras_.size()) return Finish(call_->End(absl::OkStatus()));
    message_.Clear();
    const int frame = static_cast<int>(next_), frames = static_cast<int>(cameras_.size());
    message_.set_frame(frame);
    message_.set_frames(frames);
    RenderRequest render = content_.Frame(frame, frames);
    render.camera = cameras_[next_++];
    render.threads = limits_.threads;
    render.cancel = cancel_;
    const absl::Status status =
        Render(*call_, *scene_, render, request_.settings(), message_.mutable_view());
    if (!status.ok()) return Finish(call_->End(status));
    BeforeStart(this);
    StartWrite(&message_);
  }

  const std::shared_ptr<Call> call_;
  const v1::RenderPathRequest request_;
  SceneCache* const scenes_;
  ThreadPool* const pool_;
  const RenderLimits limits_;
  CancelToken cancel_;
  std::shared_ptr<const Scene> scene_;
  PathContent content_;
  std::vector<Camera> cameras_;
  size_t next_ = 0;
  v1::RenderPathResponse message_;
};

}  // namespace

grpc::ServerUnaryReactor* RenderServiceImpl::RenderView(grpc::CallbackServerContext* context,
                                                        const v1::RenderViewRequest* request,
                                                        v1::RenderedView* response) {
  const CallName name{"RenderView", CallKind::kPicture};
  const auto work = [=, this](Call& call, const CancelToken& cancel) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const auto scene, scenes_->Get(call.jobs(), request->name()));
    LITAGS_ASSIGN_OR_RETURN(RenderRequest render, ResolveContent(request->settings()));
    LITAGS_ASSIGN_OR_RETURN(
        const Camera lens,
        ResolveLens(request->settings(), request->pose().camera(), *scene, limits_.max_pixels));
    LITAGS_ASSIGN_OR_RETURN(render.camera, ResolvePose(request->pose(), lens, *scene, "pose"));
    render.threads = limits_.threads;
    render.cancel = cancel;
    return Render(call, *scene, render, request->settings(), response);
  };
  return RunUnary(gate_, context, name, pool_, work);
}

grpc::ServerWriteReactor<v1::RenderPathResponse>* RenderServiceImpl::RenderPath(
    grpc::CallbackServerContext* context, const v1::RenderPathRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::RenderPathResponse>>(
      gate_, context, {"RenderPath", CallKind::kPictureStream}, [&](std::shared_ptr<Call> call) {
        return new PathReactor(std::move(call), *request, scenes_, pool_, limits_);
      });
}

grpc::ServerUnaryReactor* RenderServiceImpl::ListCameras(grpc::CallbackServerContext* context,
                                                         const v1::ListCamerasRequest* request,
                                                         v1::ListCamerasResponse* response) {
  const CallName name{"ListCameras", CallKind::kPicture};
  const auto work = [=, this](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const auto scene, scenes_->Get(call.jobs(), request->name()));
    for (const View& view : scene->views()) {
      v1::NamedCamera* camera = response->add_cameras();
      camera->set_name(view.name);
      *camera->mutable_camera() = CameraToProto(view.camera);
    }
    *response->mutable_center() = ToProto(scene->center());
    *response->mutable_up() = ToProto(scene->up());
    response->set_radius(scene->radius());
    response->set_iteration(scene->iteration());
    response->set_gaussians(scene->num_gaussians());
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, name, pool_, work);
}

}  // namespace litags
