#include "server/api/model_service.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/pipeline/render_rules.h"
#include "server/api/scene_calls.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kChunkBytes = size_t{256} << 10;

absl::StatusOr<SceneFormat> FormatOf(v1::ModelFormat format) {
  switch (format) {
    case v1::MODEL_FORMAT_UNSPECIFIED:
    case v1::MODEL_FORMAT_PLY:
      return SceneFormat::kPly;
    case v1::MODEL_FORMAT_SPZ:
      return SceneFormat::kSpz;
    case v1::MODEL_FORMAT_SPZ_V4:
      return SceneFormat::kSpzV4;
    case v1::MODEL_FORMAT_COMPRESSED_PLY:
      return SceneFormat::kCompressedPly;
    case v1::MODEL_FORMAT_SPLAT:
      return SceneFormat::kSplat;
    case v1::MODEL_FORMAT_GLB:
      return SceneFormat::kGlb;
    case v1::MODEL_FORMAT_USDA:
      return SceneFormat::kUsda;
    case v1::MODEL_FORMAT_SOG:
      return SceneFormat::kSog;
    case v1::MODEL_FORMAT_COLMAP:
      return SceneFormat::kColmap;
    case v1::MODEL_FORMAT_HTML:
      return SceneFormat::kHtml;
    case v1::MODEL_FORMAT_POINTS:
      return SceneFormat::kPoints;
    case v1::MODEL_FORMAT_LAS:
      return SceneFormat::kLas;
    case v1::MODEL_FORMAT_MESH_PLY:
      return SceneFormat::kMeshPly;
    case v1::MODEL_FORMAT_MESH_GLB:
      return SceneFormat::kMeshGlb;
    default:
      return InvalidInput("FORMAT_UNKNOWN", "format",
                          absl::StrCat("the server does not know format ", format));
  }
}

absl::StatusOr<UpAxis> AxisOf(v1::UpAxis axis) {
  switch (axis) {
    case v1::UP_AXIS_UNSPECIFIED:
      return UpAxis::kOfFormat;
    case v1::UP_AXIS_KEEP:
      return UpAxis::kKeep;
    case v1::UP_AXIS_X:
      return UpAxis::kX;
    case v1::UP_AXIS_NEGATIVE_X:
      return UpAxis::kNegativeX;
    case v1::UP_AXIS_Y:
      return UpAxis::kY;
    case v1::UP_AXIS_NEGATIVE_Y:
      return UpAxis::kNegativeY;
    case v1::UP_AXIS_Z:
      return UpAxis::kZ;
    case v1::UP_AXIS_NEGATIVE_Z:
      return UpAxis::kNegativeZ;
    default:
      return InvalidInput("EXPORT_OPTION_INVALID", "up",
                          absl::StrCat("up: the server does not know axis ", int{axis}));
  }
}

std::array<double, 3> ArrayOf(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

absl::StatusOr<ExportRequest> RequestOf(const v1::ExportModelRequest& request, int threads,
                                        const CancelToken& cancel) {
  ExportRequest out;
  LITAGS_ASSIGN_OR_RETURN(out.format, FormatOf(request.format()));
  out.light = request.light();
  out.exposure_stops = request.exposure_stops();
  LITAGS_ASSIGN_OR_RETURN(out.up, AxisOf(request.up()));
  if (request.has_scale()) out.scale = request.scale();
  if (request.has_crop()) {
    out.crop = Box{ArrayOf(request.crop().min()), ArrayOf(request.crop().max())};
  }
  out.max_splats = request.max_splats();
  out.antialiased = request.antialiased();
  out.threads = threads;
  out.cancel = cancel;
  return out;
}

// That a file which holds the scene as it was trained is asked for without changes.
absl::Status CheckUnchanged(const v1::ExportModelRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckLight(request.light(), "light"));
  if (request.light() != 0) {
    return InvalidInput("LIGHT_INVALID", "light",
                        "light is not for this format; leave it 0, or take format PLY");
  }
  if (request.exposure_stops() != 0 || request.has_scale() || request.has_crop() ||
      request.max_splats() != 0 || request.up() != v1::UP_AXIS_UNSPECIFIED ||
      request.antialiased()) {
    return InvalidInput("EXPORT_OPTION_INVALID", "format",
                        "format: PLY_FULL and LITAGS hold the scene as it was trained; leave the "
                        "other options out, or take format PLY");
  }
  return absl::OkStatus();
}

// Writes the file; returns how many Gaussians it holds, or points, or triangles.
absl::StatusOr<int64_t> WriteModel(const Scene& scene, const v1::ExportModelRequest& request,
                                   int threads, const CancelToken& cancel,
                                   const std::string& path) {
  const bool own = request.format() == v1::MODEL_FORMAT_LITAGS;
  if (own || request.format() == v1::MODEL_FORMAT_PLY_FULL) {
    LITAGS_RETURN_IF_ERROR(CheckUnchanged(request));
    LITAGS_RETURN_IF_ERROR(own ? scene.Save(path) : scene.ExportFullPly(path));
    return scene.num_gaussians();
  }
  LITAGS_ASSIGN_OR_RETURN(ExportRequest wanted, RequestOf(request, threads, cancel));
  LITAGS_RETURN_IF_ERROR(CheckExport(wanted));
  return scene.Export(path, wanted);
}

// One ExportModel stream: writes the file, then sends it piece by piece.
class ExportStream : public SceneStream<v1::ExportModelResponse> {
 public:
  ExportStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
               const v1::ExportModelRequest& request, SceneCache* scenes, ThreadPool* writes,
               ThreadPool* sends, const std::string& tmp, int threads, SharedRoom* room)
      : SceneStream(std::move(call), context, writes, scenes),
        request_(request),
        sends_(sends),
        path_(absl::StrCat(tmp, "/export-", RandomHex(8))),
        threads_(threads),
        room_(room) {
    Begin();
  }
  ~ExportStream() override {
    if (file_bytes_ > 0) room_->Add(call().client().name, -file_bytes_);
  }

 private:
  absl::StatusOr<Made> Next(v1::ExportModelResponse* message) override {
    if (!file_.is_open()) {
      LITAGS_ASSIGN_OR_RETURN(const auto scene, GetScene(request_.name()));
      if (!scene) return Made::kLater;
      const absl::Status status = Prepare(*scene, message->mutable_header());
      unlink(path_.c_str());  // what is open stays readable, and nothing is left behind
      LITAGS_RETURN_IF_ERROR(status);
      MoveTo(sends_);
      return Made::kMessage;
    }
    std::string* chunk = message->mutable_chunk();
    chunk->resize(std::min(kChunkBytes, static_cast<size_t>(file_bytes_ - sent_bytes_)));
    file_.read(chunk->data(), static_cast<std::streamsize>(chunk->size()));
    chunk->resize(static_cast<size_t>(file_.gcount()));
    if (chunk->empty()) return CannotReadBack();
    sent_bytes_ += static_cast<int64_t>(chunk->size());
    return Made::kMessage;
  }

  bool IsDone() const override { return file_.is_open() && sent_bytes_ == file_bytes_; }

  absl::Status CheckRoom() override {
    if (file_.is_open() || room_->IsFor(call().client().name)) return AnswerStream::CheckRoom();
    return MakeError(absl::StatusCode::kResourceExhausted, "RENDER_QUEUE_FULL", "",
                     "the disk space for models that clients have not read yet is used up; read "
                     "those asked for, and try again in a minute");
  }

  static absl::Status CannotReadBack() {
    return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                     "the exported file cannot be read back");
  }

  absl::Status Prepare(const Scene& scene, v1::ExportHeader* header) {
    LITAGS_ASSIGN_OR_RETURN(const int64_t elements,
                            WriteModel(scene, request_, threads_, cancel(), path_));
    std::error_code error;
    const auto size = std::filesystem::file_size(path_, error);
    file_.open(path_, std::ios::binary);
    if (error || !file_) return CannotReadBack();
    file_bytes_ = static_cast<int64_t>(size);
    room_->Add(call().client().name, file_bytes_);
    header->set_size_bytes(file_bytes_);
    header->set_iteration(scene.iteration());
    header->set_elements(elements);
    return absl::OkStatus();
  }

  const v1::ExportModelRequest& request_;  // gRPC's, which outlives this
  ThreadPool* const sends_;
  const std::string path_;
  const int threads_;
  SharedRoom* const room_;
  std::ifstream file_;
  int64_t file_bytes_ = 0, sent_bytes_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::ExportModelResponse>* ModelServiceImpl::ExportModel(
    grpc::CallbackServerContext* context, const v1::ExportModelRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::ExportModelResponse>>(
      gate_, context, {"ExportModel", CallKind::kPictureStream}, request,
      [&](std::shared_ptr<Call> call) {
        return new ExportStream(std::move(call), context, *request, scenes_, writes_, sends_, tmp_,
                                threads_, &room_);
      });
}

}  // namespace litags
