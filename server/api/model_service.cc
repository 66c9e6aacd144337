#include "server/api/model_service.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/grpc_order.h"
#include "server/api/status.h"
#include "server/api/unary.h"
#include "server/api/view_request.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;

absl::Status WriteModel(const Scene& scene, const v1::ExportModelRequest& request,
                        const std::string& path) {
  const v1::ModelFormat format = request.format();
  LITAGS_RETURN_IF_ERROR(CheckLight(request.light(), "light"));
  if (request.light() != 0 && format != v1::MODEL_FORMAT_UNSPECIFIED &&
      format != v1::MODEL_FORMAT_PLY) {
    return InvalidInput("LIGHT_INVALID", "light",
                        "light is for format PLY only; leave it 0 for the others");
  }
  switch (format) {
    case v1::MODEL_FORMAT_UNSPECIFIED:
    case v1::MODEL_FORMAT_PLY:
      return scene.ExportPly(path, request.light());
    case v1::MODEL_FORMAT_PLY_ORIGINAL_LIGHT:
      return scene.ExportPly(path, /*light=*/1);
    case v1::MODEL_FORMAT_PLY_FULL:
      return scene.ExportFullPly(path);
    default:
      return InvalidInput("FORMAT_UNKNOWN", "format",
                          absl::StrCat("the server does not know format ", format));
  }
}

// One ExportModel stream: writes the file, then sends it piece by piece. Deletes itself when the
// call is over.
class ExportReactor : public grpc::ServerWriteReactor<v1::ExportModelResponse> {
 public:
  ExportReactor(std::shared_ptr<Call> call, const v1::ExportModelRequest& request,
                SceneCache* scenes, ThreadPool* pool, const std::string& tmp)
      : call_(std::move(call)),
        request_(request),
        scenes_(scenes),
        pool_(pool),
        path_(absl::StrCat(tmp, "/export-", RandomHex(8))) {
    const absl::Status accepted = pool_->Try([this] { Begin(); });
    if (!accepted.ok()) Finish(call_->End(accepted));
  }

  void OnWriteDone(bool ok) override {
    AfterStart(this);
    if (!ok) return Finish(call_->End(CallCancelled()));
    pool_->Run([this] { SendChunk(); });
  }

  void OnCancel() override { cancel_.Cancel(); }

  void OnDone() override { delete this; }

 private:
  void Begin() {
    const absl::Status status = Prepare();
    unlink(path_.c_str());  // what is open stays readable, and nothing is left behind
    if (!status.ok()) return Finish(call_->End(status));
    BeforeStart(this);
    StartWrite(&message_);
  }

  absl::Status Prepare() {
    if (cancel_.IsCancelled()) return CallCancelled();
    LITAGS_ASSIGN_OR_RETURN(const auto scene, scenes_->Get(call_->jobs(), request_.name()));
    LITAGS_RETURN_IF_ERROR(WriteModel(*scene, request_, path_));
    std::error_code error;
    const auto size = std::filesystem::file_size(path_, error);
    file_.open(path_, std::ios::binary);
    if (error || !file_) {
      return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                       "the exported file cannot be read back");
    }
    message_.mutable_header()->set_size_bytes(static_cast<int64_t>(size));
    message_.mutable_header()->set_iteration(scene->iteration());
    message_.mutable_header()->set_gaussians(scene->num_gaussians());
    return absl::OkStatus();
  }

  void SendChunk() {
    if (cancel_.IsCancelled()) return Finish(call_->End(CallCancelled()));
    std::string* chunk = message_.mutable_chunk();
    chunk->resize(kChunkBytes);
    file_.read(chunk->data(), static_cast<std::streamsize>(chunk->size()));
    chunk->resize(static_cast<size_t>(file_.gcount()));
    if (chunk->empty()) return Finish(call_->End(absl::OkStatus()));
    BeforeStart(this);
    StartWrite(&message_);
  }

  const std::shared_ptr<Call> call_;
  const v1::ExportModelRequest request_;
  SceneCache* const scenes_;
  ThreadPool* const pool_;
  const std::string path_;
  CancelToken cancel_;
  std::ifstream file_;
  v1::ExportModelResponse message_;
};

}  // namespace

grpc::ServerWriteReactor<v1::ExportModelResponse>* ModelServiceImpl::ExportModel(
    grpc::CallbackServerContext* context, const v1::ExportModelRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::ExportModelResponse>>(
      gate_, context, {"ExportModel", CallKind::kPictureStream}, [&](std::shared_ptr<Call> call) {
        return new ExportReactor(std::move(call), *request, scenes_, pool_, tmp_);
      });
}

}  // namespace litags
