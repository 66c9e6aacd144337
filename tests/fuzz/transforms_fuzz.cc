// transforms.json and files of cameras in its place; what is read is written and read again.
#include <string>

#include "engine/core/check.h"
#include "engine/io/cameras_io.h"
#include "engine/io/sparse_model.h"
#include "engine/io/transforms_io.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  const auto model = ParseCameras(AsText(data, size), "cameras", [](const std::string&) {
    return PhotoSize{64, 48};
  });
  if (!model.ok()) return 0;
  LITAGS_CHECK(model->distortions.size() == model->views.size());
  for (const View& view : model->views) LITAGS_CHECK(view.camera.Validate("camera").ok());
  if (model->views.empty()) return 0;
  // Of a file without sizes they are held to their photos' only by the job.
  for (const View& view : model->views) {
    if (!CheckIntrinsics(view.camera, "camera").ok()) return 0;
  }
  const auto again = ParseTransforms(FormatTransforms(*model, "low"), "cameras");
  LITAGS_CHECK(again.ok() && again->views.size() == model->views.size());
  return 0;
}
