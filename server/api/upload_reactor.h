#ifndef LITAGS_SERVER_API_UPLOAD_REACTOR_H_
#define LITAGS_SERVER_API_UPLOAD_REACTOR_H_

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <cstdint>
#include <memory>
#include <mutex>

#include "engine/core/cancel.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/cpu_budget.h"
#include "server/api/gate.h"
#include "server/api/stall_timer.h"
#include "server/api/thread_pool.h"
#include "server/api/upload_session.h"
#include "server/net/shared_room.h"

namespace litags {

// What all uploads share.
struct UploadResources {
  ThreadPool* pool;
  FileReader* reader;
  CpuBudget* cpu;
  SharedRoom* archives;  // that are being unpacked, each in a process of its own
};

// One UploadImages stream: its steps run on the pool, one after the other, those of a client that
// took more than its share of the processor later. A client that says nothing for too long, or
// whose token was taken back, is sent away. Deletes itself when the call is over.
class UploadReactor : public grpc::ServerReadReactor<grpc::ByteBuffer> {
 public:
  UploadReactor(std::shared_ptr<Call> call, grpc::ByteBuffer* response,
                const UploadResources& shared);
  ~UploadReactor() override {
    CountArchive(false);
    CountRead();
  }

  void OnReadDone(bool ok) override;
  void OnCancel() override { cancel_.Cancel(); }
  void OnDone() override { delete this; }

 private:
  void Read();
  void Queue(bool ok);
  // Works on the message that came, or, without `ok`, on their end; a part of it at a time.
  void Step(bool ok);
  absl::Status Take();      // the message that was read
  absl::Status Complete();  // after the last
  // Until the client may take another step; 0: now.
  double SecondsToWait() const;
  void CountArchive(bool unpacks);
  void CountRead();  // the message, if there is one
  // Whether the call waits for the client; whoever gets true goes on with it, alone.
  bool StopWaiting();

  const std::shared_ptr<Call> call_;
  grpc::ByteBuffer* const response_;
  const UploadResources shared_;
  CancelToken cancel_;
  UploadSession session_;
  bool archive_counted_ = false;
  grpc::ByteBuffer bytes_;
  int64_t waiting_bytes_ = 0;  // of a message that came and was not taken
  StallTimer timer_;
  std::mutex mutex_;
  bool waiting_ = false;
  TokenWatch::Ticket ticket_;  // last: its end waits for what it calls
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_REACTOR_H_
