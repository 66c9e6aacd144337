#include "engine/eval/lpips.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr char kField[] = "--lpips";

// Codes to [-1, 1].
Planes Signed(const ImageU8& picture) {
  return OnnxPhoto(picture, {.mean = {0.5, 0.5, 0.5}, .std = {0.5, 0.5, 0.5}});
}

}  // namespace

absl::StatusOr<Lpips> Lpips::Load(const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(OnnxNet net, OnnxNet::Load(path, kField));
  return Lpips(std::move(net));
}

absl::StatusOr<double> Lpips::Distance(const ImageU8& a, const ImageU8& b) {
  if (a.empty() || a.width != b.width || a.height != b.height) {
    return InvalidInput("SIZE_MISMATCH", "lpips",
                        absl::StrCat("lpips: pictures of ", a.width, "x", a.height, " and ",
                                     b.width, "x", b.height, " px; compare equal sizes"));
  }
  LITAGS_ASSIGN_OR_RETURN(const Planes out, net_.Run({{"in0", Signed(a)}, {"in1", Signed(b)}}));
  if (out.data.size() != 1) {
    return InvalidInput("ONNX_OUTPUT", kField,
                        absl::StrCat(kField, ": the network gives ", out.data.size(),
                                     " numbers, not one distance; export it with spatial=False"));
  }
  return out.data[0];
}

}  // namespace litags
