// COLMAP's binary model: three pieces, cameras.bin, images.bin and points3D.bin.
#include "engine/core/check.h"
#include "engine/io/colmap_io.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  std::vector<std::string> pieces = SplitPieces(AsText(data, size));
  pieces.resize(3);
  const auto model = ParseColmapModel(pieces[0], pieces[1], pieces[2], "cameras");
  if (!model.ok()) return 0;
  LITAGS_CHECK(model->distortions.size() == model->views.size());
  for (const SparsePoint& point : model->points) {
    for (const TrackElement& seen : point.track) {
      LITAGS_CHECK(seen.view >= 0 && static_cast<size_t>(seen.view) < model->views.size());
    }
  }
  return 0;
}
