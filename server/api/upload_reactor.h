#ifndef LITAGS_SERVER_API_UPLOAD_REACTOR_H_
#define LITAGS_SERVER_API_UPLOAD_REACTOR_H_

#include <grpcpp/support/server_callback.h>

#include <memory>

#include "engine/core/cancel.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/cpu_budget.h"
#include "server/api/gate.h"
#include "server/api/stall_timer.h"
#include "server/api/thread_pool.h"
#include "server/api/upload_session.h"

namespace litags {

// One UploadImages stream: its steps run on the pool, one after the other, those of a client that
// took more than its share of the processor later. A client that says nothing for too long is sent
// away. Deletes itself when the call is over.
class UploadReactor : public grpc::ServerReadReactor<v1::UploadImagesRequest> {
 public:
  UploadReactor(std::shared_ptr<Call> call, v1::UploadImagesResponse* response, ThreadPool* pool,
                CpuBudget* budget);

  void OnReadDone(bool ok) override;
  void OnCancel() override { cancel_.Cancel(); }
  void OnDone() override { delete this; }

 private:
  void Read();
  void Queue(bool ok);
  // Works on the message that came, or, without `ok`, on their end; a part of it at a time.
  void Step(bool ok);

  const std::shared_ptr<Call> call_;
  v1::UploadImagesResponse* const response_;
  ThreadPool* const pool_;
  CpuBudget* const budget_;
  CancelToken cancel_;
  UploadSession session_;
  v1::UploadImagesRequest request_;
  StallTimer timer_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_REACTOR_H_
