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
  const auto model = ParseColmapText(pieces[0], pieces[1], pieces[2], "cameras");
  CheckParts(pieces, ".txt", model);
  std::vector<std::string> binary;
  for (const ColmapPart part : {ColmapPart::kCameras, ColmapPart::kImages, ColmapPart::kPoints}) {
    const std::string& text = pieces[binary.size()];
    const auto bytes = BinaryFromText(part, text, "cameras");
    if (!bytes.ok()) return 0;
    LITAGS_CHECK(bytes->size() <= 6 * text.size() + 8);
    binary.push_back(*bytes);
  }
  // The same numbers, from which there is the same model or none.
  LITAGS_CHECK(model.ok() == ParseColmapModel(binary[0], binary[1], binary[2], "cameras").ok());
  if (model.ok()) CheckModel(*model);
  return 0;
}
