#ifndef LITAGS_SERVER_API_UPLOAD_REACTOR_H_
#define LITAGS_SERVER_API_UPLOAD_REACTOR_H_

#include <grpcpp/alarm.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <memory>
#include <mutex>

#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/gate.h"
#include "server/api/thread_pool.h"
#include "server/api/upload_session.h"

namespace litags {

// One UploadImages stream: its steps run on the pool, one after the other, and a client that says
// nothing for too long is sent away. Deletes itself when the call is over.
class UploadReactor : public grpc::ServerReadReactor<v1::UploadImagesRequest> {
 public:
  UploadReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
                v1::UploadImagesResponse* response, ThreadPool* pool);

  void OnReadDone(bool ok) override;
  void OnDone() override { delete this; }

 private:
  // Which read is awaited. Alarms outlive the call, hence shared.
  struct Awaited {
    static constexpr int64_t kNone = 0, kStalled = -1;
    std::mutex mutex;
    int64_t read = kNone;
  };

  void Read();
  void Step(bool ok);

  const std::shared_ptr<Call> call_;
  grpc::CallbackServerContext* const context_;
  v1::UploadImagesResponse* const response_;
  ThreadPool* const pool_;
  UploadSession session_;
  v1::UploadImagesRequest request_;
  const std::shared_ptr<Awaited> awaited_ = std::make_shared<Awaited>();
  int64_t reads_ = 0;
  std::unique_ptr<grpc::Alarm> alarm_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_REACTOR_H_
