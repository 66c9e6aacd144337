#ifndef LITAGS_SERVER_API_MODEL_SERVICE_H_
#define LITAGS_SERVER_API_MODEL_SERVICE_H_

#include <string>

#include "litags/v1/model_service.grpc.pb.h"
#include "server/api/gate.h"
#include "server/api/scene_cache.h"
#include "server/api/thread_pool.h"
#include "server/net/shared_room.h"

namespace litags {

// Handlers of litags.v1.ModelService.
class ModelServiceImpl : public v1::ModelService::CallbackService {
 public:
  // All must outlive this; `tmp` is a folder for files in flight, which may hold `max_bytes`.
  // Files are written by one pool and sent by another. Pictures that an export makes use `threads`.
  ModelServiceImpl(Gate* gate, SceneCache* scenes, ThreadPool* writes, ThreadPool* sends,
                   std::string tmp, int64_t max_bytes, int threads)
      : gate_(gate),
        scenes_(scenes),
        writes_(writes),
        sends_(sends),
        tmp_(std::move(tmp)),
        threads_(threads),
        room_(max_bytes) {}

  grpc::ServerWriteReactor<v1::ExportModelResponse>* ExportModel(
      grpc::CallbackServerContext* context, const v1::ExportModelRequest* request) override;

 private:
  Gate* const gate_;
  SceneCache* const scenes_;
  ThreadPool* const writes_;
  ThreadPool* const sends_;
  const std::string tmp_;
  const int threads_;
  SharedRoom room_;  // of files that are being read
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_MODEL_SERVICE_H_
