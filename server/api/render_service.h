#ifndef LITAGS_SERVER_API_RENDER_SERVICE_H_
#define LITAGS_SERVER_API_RENDER_SERVICE_H_

#include <cstdint>

#include "litags/v1/render_service.grpc.pb.h"
#include "server/api/gate.h"
#include "server/api/scene_cache.h"
#include "server/api/thread_pool.h"

namespace litags {

struct RenderLimits {
  int64_t max_pixels = int64_t{16} << 20;  // per picture
  int threads = 1;                         // per picture
};

// Handlers of litags.v1.RenderService. All work runs on the render pool, so that pictures cannot
// hold up calls about jobs.
class RenderServiceImpl : public v1::RenderService::CallbackService {
 public:
  // All must outlive this.
  RenderServiceImpl(Gate* gate, SceneCache* scenes, ThreadPool* pool, RenderLimits limits = {})
      : gate_(gate), scenes_(scenes), pool_(pool), limits_(limits) {}

  grpc::ServerUnaryReactor* RenderView(grpc::CallbackServerContext* context,
                                       const v1::RenderViewRequest* request,
                                       v1::RenderedView* response) override;
  grpc::ServerWriteReactor<v1::RenderPathResponse>* RenderPath(
      grpc::CallbackServerContext* context, const v1::RenderPathRequest* request) override;
  grpc::ServerUnaryReactor* ListCameras(grpc::CallbackServerContext* context,
                                        const v1::ListCamerasRequest* request,
                                        v1::ListCamerasResponse* response) override;

 private:
  Gate* const gate_;
  SceneCache* const scenes_;
  ThreadPool* const pool_;
  const RenderLimits limits_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_RENDER_SERVICE_H_
