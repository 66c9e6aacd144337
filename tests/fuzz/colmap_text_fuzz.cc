// COLMAP's text model: three pieces, cameras.txt, images.txt and points3D.txt.
#include "engine/core/check.h"
#include "engine/io/colmap_io.h"
#include "engine/io/colmap_text.h"
#include "tests/fuzz/check_model.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  std::vector<std::string> pieces = SplitPieces(AsText(data, size));
  pieces.resize(3);
  const auto bytes = BinaryFromText(pieces[0], pieces[1], pieces[2], "cameras");
  if (!bytes.ok()) return 0;
  LITAGS_CHECK(bytes->cameras.size() + bytes->images.size() + bytes->points.size() <=
               6 * size + 24);
  const auto model = ParseColmapText(pieces[0], pieces[1], pieces[2], "cameras");
  // The same numbers, from which there is the same model or none.
  const auto binary = ParseColmapModel(bytes->cameras, bytes->images, bytes->points, "cameras");
  LITAGS_CHECK(model.ok() == binary.ok());
  if (!model.ok()) return 0;
  CheckModel(*model);
  return 0;
}
