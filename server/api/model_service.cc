#include "server/api/model_service.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/pipeline/render_rules.h"
#include "server/api/answer_stream.h"
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

// One ExportModel stream: writes the file, then sends it piece by piece.
class ExportStream : public AnswerStream<v1::ExportModelResponse> {
 public:
  ExportStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
               const v1::ExportModelRequest& request, SceneCache* scenes, ThreadPool* pool,
               const std::string& tmp, SharedRoom* room)
      : AnswerStream(std::move(call), context, pool),
        request_(request),
        scenes_(scenes),
        path_(absl::StrCat(tmp, "/export-", RandomHex(8))),
        room_(room) {
    Begin();
  }
  ~ExportStream() override {
    if (file_bytes_ > 0) room_->Add(call().client().name, -file_bytes_);
  }

 private:
  absl::StatusOr<bool> Next(v1::ExportModelResponse* message) override {
    if (!file_.is_open()) {
      const absl::Status status = Prepare(message->mutable_header());
      unlink(path_.c_str());  // what is open stays readable, and nothing is left behind
      LITAGS_RETURN_IF_ERROR(status);
      return true;
    }
    std::string* chunk = message->mutable_chunk();
    chunk->resize(kChunkBytes);
    file_.read(chunk->data(), static_cast<std::streamsize>(chunk->size()));
    chunk->resize(static_cast<size_t>(file_.gcount()));
    return !chunk->empty();
  }

  absl::Status CheckRoom() override {
    if (file_.is_open() || room_->IsFor(call().client().name)) return AnswerStream::CheckRoom();
    return MakeError(absl::StatusCode::kResourceExhausted, "RENDER_QUEUE_FULL", "",
                     "the disk space for models that clients have not read yet is used up; read "
                     "those asked for, and try again in a minute");
  }

  absl::Status Prepare(v1::ExportHeader* header) {
    LITAGS_ASSIGN_OR_RETURN(const auto scene, scenes_->Get(call().jobs(), request_.name()));
    LITAGS_RETURN_IF_ERROR(WriteModel(*scene, request_, path_));
    std::error_code error;
    const auto size = std::filesystem::file_size(path_, error);
    file_.open(path_, std::ios::binary);
    if (error || !file_) {
      return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                       "the exported file cannot be read back");
    }
    file_bytes_ = static_cast<int64_t>(size);
    room_->Add(call().client().name, file_bytes_);
    header->set_size_bytes(file_bytes_);
    header->set_iteration(scene->iteration());
    header->set_gaussians(scene->num_gaussians());
    return absl::OkStatus();
  }

  const v1::ExportModelRequest request_;
  SceneCache* const scenes_;
  const std::string path_;
  SharedRoom* const room_;
  std::ifstream file_;
  int64_t file_bytes_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::ExportModelResponse>* ModelServiceImpl::ExportModel(
    grpc::CallbackServerContext* context, const v1::ExportModelRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::ExportModelResponse>>(
      gate_, context, {"ExportModel", CallKind::kPictureStream}, [&](std::shared_ptr<Call> call) {
        return new ExportStream(std::move(call), context, *request, scenes_, pool_, tmp_, &room_);
      });
}

}  // namespace litags
