#include "engine/io/model_util.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "engine/io/file_util.h"
#include "engine/io/io_error.h"

namespace litags {

absl::StatusOr<SparseModel> FinishModel(std::vector<LoadedView> views, std::string_view field,
                                        std::vector<size_t>* order) {
  std::sort(views.begin(), views.end(),
            [](const LoadedView& a, const LoadedView& b) { return a.view.name < b.view.name; });
  SparseModel model;
  for (LoadedView& loaded : views) {
    const std::string& name = loaded.view.name;
    LITAGS_RETURN_IF_ERROR(ValidateFileName(name, field));
    const std::string where = absl::StrCat(Absl(field), "[", name, "]");
    LITAGS_RETURN_IF_ERROR(loaded.view.camera.Validate(where));
    const Distortion& d = loaded.distortion;
    if (!std::isfinite(d.k1) || !std::isfinite(d.k2) || !std::isfinite(d.p1) ||
        !std::isfinite(d.p2)) {
      return InvalidField("NOT_FINITE", where,
                          "a lens distortion coefficient is NaN or infinite; send finite numbers");
    }
    if (!model.views.empty() && model.views.back().name == name) {
      return InvalidField("DUPLICATE_NAME", where,
                          "two cameras have this file name; give every photo its own");
    }
    if (order != nullptr) order->push_back(loaded.source_id);
    model.distortions.push_back(d);
    model.views.push_back(std::move(loaded.view));
  }
  return model;
}

}  // namespace litags
