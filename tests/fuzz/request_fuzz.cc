// Requests as clients send them: jobs, pictures, paths, files. The first byte says which.

#include "engine/core/check.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/api/camera_path.h"
#include "server/api/convert.h"
#include "server/api/upload_files.h"
#include "server/api/view_request.h"
#include "server/jobs/codec.h"
#include "server/testing/fake_engine.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags {
namespace {

constexpr int64_t kMaxPixels = 16'000'000;

const Scene& TheScene() {
  static const std::shared_ptr<const Scene> scene = [] {
    WriteScratchFile("50 7\na.png\nb.png\nc.png\n");
    return *MakeFakeEngine()->LoadScene(ScratchPath());
  }();
  return *scene;
}

// What a handler hands on must be what the engine takes.
void CheckCamera(const Camera& camera) {
  LITAGS_CHECK(camera.Validate("camera", kMaxPixels).ok());
  LITAGS_CHECK(int64_t{camera.width} * camera.height <= kMaxPixels);
}

void FuzzJob(const std::string& bytes) {
  v1::CreateJobRequest request;
  if (!request.ParseFromString(bytes)) return;
  if (const auto policy = PolicyFromProto(request.policy()); policy.ok()) {
    LITAGS_CHECK(policy->Validate().ok());
  }
  const auto options = OptionsFromProto(request.options());
  if (!options.ok()) return;
  LITAGS_CHECK(options->Validate().ok());
  const auto stored = Decode<ReconstructOptions>(Encode(*options));
  LITAGS_CHECK(stored.ok());
  LITAGS_CHECK(OptionsToProto(*stored).SerializeAsString() ==
               OptionsToProto(*options).SerializeAsString());
}

void FuzzView(const std::string& bytes) {
  v1::RenderViewRequest request;
  if (!request.ParseFromString(bytes)) return;
  ResolveContent(request.settings()).status().IgnoreError();
  const auto lens = ResolveLens(request.settings(), request.pose().camera(), "pose.camera",
                                TheScene(), kMaxPixels);
  if (!lens.ok()) return;
  const auto camera = ResolvePose(request.pose(), *lens, TheScene(), "pose");
  if (camera.ok()) CheckCamera(*camera);
}

void FuzzPath(const std::string& bytes) {
  v1::RenderPathRequest request;
  if (!request.ParseFromString(bytes)) return;
  ResolvePathContent(request).status().IgnoreError();
  const auto lens =
      ResolveLens(request.settings(), "", "keyframes.poses[0].camera", TheScene(), kMaxPixels);
  if (!lens.ok()) return;
  const auto cameras = ResolvePath(request, *lens, TheScene());
  if (!cameras.ok()) return;
  for (const Camera& camera : *cameras) CheckCamera(camera);
}

// A file as it is announced: its name becomes one on disk.
void FuzzFile(const std::string& bytes) {
  v1::FileHeader header;
  if (!header.ParseFromString(bytes)) return;
  const UploadLimits limits;
  const auto file = ParseFileHeader(header, limits);
  if (!file.ok()) return;
  const FileRecord& record = file->record;
  LITAGS_CHECK(!record.name.empty() && record.name.size() <= 255 && record.name.front() != '.');
  LITAGS_CHECK(record.name.find_first_of(std::string_view("/\\\0", 3)) == std::string::npos);
  LITAGS_CHECK(record.size_bytes > 0 && record.sha256.size() == 64);
  LITAGS_CHECK(header.offset() >= 0 && header.offset() <= record.size_bytes);
}

}  // namespace
}  // namespace litags

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string bytes{litags::AsText(data + 1, size - 1)};
  switch (data[0] % 4) {
    case 0:
      litags::FuzzJob(bytes);
      break;
    case 1:
      litags::FuzzView(bytes);
      break;
    case 2:
      litags::FuzzPath(bytes);
      break;
    default:
      litags::FuzzFile(bytes);
  }
  return 0;
}
