// Gaussians as .ply; what is read is written and read again.
#include "engine/core/check.h"
#include "engine/io/ply.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  const auto scene = DecodePly(AsText(data, size), "scene", 10'000);
  if (!scene.ok()) return 0;
  LITAGS_CHECK(scene->splats.size() <= 10'000);
  const auto again = DecodePly(EncodePly(scene->splats, scene->lita_attributes), "scene");
  LITAGS_CHECK(again.ok() && again->splats.size() == scene->splats.size());
  return 0;
}
