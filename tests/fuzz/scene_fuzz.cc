// Scene files of every version, whose checksums are right and whose sections are anything; what
// loads is drawn.
#include "engine/pipeline/scene_file.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  WriteScratchScene(AsText(data, size));
  const auto scene = LoadSceneFile(ScratchPath());
  if (!scene.ok() || (*scene)->views().empty()) return 0;
  RenderRequest request;
  request.camera = (*scene)->views()[0].camera.Scaled(16, 12);
  request.threads = 1;
  for (const Channel channel : {Channel::kColor, Channel::kOriginal, Channel::kDepth}) {
    request.channel = channel;
    (*scene)->Render(request).status().IgnoreError();
  }
  return 0;
}
