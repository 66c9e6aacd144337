// COLMAP's binary model: three pieces, cameras.bin, images.bin and points3D.bin.
#include "engine/io/colmap_io.h"
#include "tests/fuzz/check_model.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  std::vector<std::string> pieces = SplitPieces(AsText(data, size));
  pieces.resize(3);
  const auto model = ParseColmapModel(pieces[0], pieces[1], pieces[2], "cameras");
  CheckParts(pieces, ".bin", model);
  if (model.ok()) CheckModel(*model);
  return 0;
}
