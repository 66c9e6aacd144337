#ifndef LITAGS_SERVER_API_UPLOAD_REACTOR_H_
#define LITAGS_SERVER_API_UPLOAD_REACTOR_H_

#include <grpcpp/support/server_callback.h>

#include <memory>

#include "engine/core/cancel.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/gate.h"
#include "server/api/stall_timer.h"
#include "server/api/thread_pool.h"
#include "server/api/upload_session.h"

namespace litags {

// One UploadImages stream: its steps run on the pool, one after the other, and a client that says
// nothing for too long is sent away. Deletes itself when the call is over.
class UploadReactor : public grpc::ServerReadReactor<v1::UploadImagesRequest> {
 public:
  UploadReactor(std::shared_ptr<Call> call, v1::UploadImagesResponse* response, ThreadPool* pool,
                FileReader* reader);

  void OnReadDone(bool ok) override;
  void OnCancel() override { cancel_.Cancel(); }
  void OnDone() override { delete this; }

 private:
  void Read();
  void Step(bool ok);

  const std::shared_ptr<Call> call_;
  v1::UploadImagesResponse* const response_;
  ThreadPool* const pool_;
  CancelToken cancel_;
  UploadSession session_;
  v1::UploadImagesRequest request_;
  StallTimer timer_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_REACTOR_H_
