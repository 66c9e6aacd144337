// Options of the progressive denoising module (pdm.h).
#ifndef LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_
#define LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_

#include "absl/status/status.h"

namespace litags {

// What the Gaussian filter C sees outside the image. F's convolutions always pad with zeros.
enum class PdmBorder { kReflect101, kZero };

struct PdmOptions {
  int stages = 3;             // K, 1..8 (paper: 3)
  int hidden = 16;            // channels inside F, 1..64. Choice: the paper gives no width
  bool shared = true;         // one F for all stages. Choice: the paper does not say
  int filter_size = 3;        // px, odd, 1..15: C is filter_size x filter_size
  float filter_sigma = 0.5f;  // px, > 0. Choice: the paper gives no width
  PdmBorder border = PdmBorder::kReflect101;
  bool clamp_R = false;  // clamp R_1..R_K to [0, 1], as the authors' release does

  // INVALID_ARGUMENT naming the field that is out of range.
  absl::Status Validate() const;

  bool operator==(const PdmOptions&) const = default;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_PDM_OPTIONS_H_
