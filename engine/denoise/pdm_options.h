// Options of the progressive denoising module (pdm.h).
#ifndef LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_
#define LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_

#include <utility>

#include "absl/status/status.h"
#include "engine/core/fields.h"

namespace litags {

// What the Gaussian filter C sees outside the image. F's convolutions always pad with zeros.
enum class PdmBorder { kReflect101, kZero };

template <>
struct EnumWords<PdmBorder> {
  static constexpr std::pair<PdmBorder, const char*> kWords[] = {
      {PdmBorder::kReflect101, "reflect-101"}, {PdmBorder::kZero, "zero"}};
};

struct PdmOptions {
  int stages = 3;             // K; paper
  int hidden = 16;            // channels inside F. Choice: the paper gives no width
  bool shared = true;         // one F for all stages. Choice: the paper does not say
  int filter_size = 3;        // px: C is filter_size x filter_size
  float filter_sigma = 0.5f;  // px. Choice: the paper gives no width
  PdmBorder border = PdmBorder::kReflect101;
  bool clamp_R = false;  // clamp R_1..R_K to [0, 1], as the authors' release does

  // INVALID_ARGUMENT (BAD_OPTION) naming the field that breaks its rule.
  absl::Status Validate() const { return CheckFields(*this, ""); }

  bool operator==(const PdmOptions&) const = default;
};

template <class T, class Visit>
void VisitFields(FieldsOf<PdmOptions>, T& p, Visit&& visit) {
  visit("pdm_stages", p.stages, FieldRule{.least = 1, .most = 8});
  visit("pdm_hidden", p.hidden, FieldRule{.least = 1, .most = 64});
  visit("pdm_shared", p.shared, FieldRule());
  visit("pdm_filter_size", p.filter_size, FieldRule{.least = 1, .most = 15, .odd = true});
  visit("pdm_filter_sigma", p.filter_sigma, FieldRule{.least = 0, .above_least = true});
  visit("pdm_border", p.border, FieldRule());
  visit("pdm_clamp", p.clamp_R, FieldRule());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_
