// Progressive denoising module (PDM), forward and VJP. Source: LITA-GS, "Progressive Denoising
// Module".
#ifndef LITAGS_ENGINE_DENOISE_PDM_H_
#define LITAGS_ENGINE_DENOISE_PDM_H_

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/core/image.h"
#include "engine/denoise/pdm_options.h"

namespace litags {

// Where the six arrays of one network F lie in its flat vector:
// w1 [hidden,3,3,3], b1 [hidden], w2 [hidden,hidden,3,3], b2 [hidden], w3 [3,hidden,3,3], b3 [3];
// weights [out,in,ky,kx], correlation (no flip).
struct PdmNetLayout {
  explicit PdmNetLayout(int hidden);
  size_t w1, b1, w2, b2, w3, b3, size;  // offsets and total, in floats
};

// Weights of the module, or their gradients.
struct PdmWeights {
  int hidden = 0;
  std::vector<std::vector<float>> nets;  // one per stage, or a single shared one; PdmNetLayout

  // All zero, with the shape that `options` asks for.
  static PdmWeights Zeros(const PdmOptions& options);

  // Deterministic start. Choice: w1 and w2 are He-normal, all biases and w3 are zero, so F = 0 and
  // the module begins as a fixed, gentle smoothing that leaves flat areas alone: with H = 1 - C its
  // response for K = 3 is 1 - H + H^2 - H^3 / 2, from 1 at DC to 0.63 at the highest frequency. A
  // random w3 would add random colour mixtures of the image's edges instead. Gradients reach w3
  // at the first step, w1 and w2 as soon as w3 has moved.
  static PdmWeights Initial(const PdmOptions& options, uint64_t seed);
};

// LITA-GS Eq. 9 and Eq. 10.
// C = Gaussian filter; Nhat_0 = (R_0 - C(R_0) + N) / 2, Nhat_k = R_k - C(R_k) for k >= 1;
// N_{k+1} = Nhat_k - F(Nhat_k); R_{k+1} = R_0 - N_{k+1}, k = 0..K-1. F: three 3x3 convolutions
// joined by ReLU. Keeps the activations of one forward pass and reuses its buffers. Results are the
// same bytes for any number of threads. Not thread-safe; use one per thread of control.
class Pdm {
 public:
  // `options` must be valid. threads <= 0: all cores.
  explicit Pdm(const PdmOptions& options, int threads = 0);
  ~Pdm();
  Pdm(Pdm&&) noexcept;
  Pdm& operator=(Pdm&&) noexcept;

  // Denoises R0 [3,H,W] with the noise map N [3,H,W] (rendered N_GS). `weights` must have the
  // shape of PdmWeights::Zeros(options).
  void Forward(const PdmWeights& weights, PlanesView R0, PlanesView N);

  // As Forward, for the result alone: R [3,H,W] = R_K (its shape is set). Needs a third of the
  // memory; Backward must not follow.
  void Apply(const PdmWeights& weights, PlanesView R0, PlanesView N, Planes* R);

  // R_k [3,H,W] of the last Forward, k = 1..K; R(K) is the result.
  const Planes& R(int k) const;

  // VJP of the last Forward. v_last [3,H,W] = dL/dR_K; v_previous [3,H,W] = dL/dR_{K-1} or empty
  // (for K = 1 it is dL/dR_0). Overwrites v_R0 [3,H,W], v_N [3,H,W] and v_weights (its shape is
  // set). v_R0 may be v_last.
  void Backward(PlanesView v_last, PlanesView v_previous, PlanesSpan v_R0, PlanesSpan v_N,
                PdmWeights* v_weights);

  const PdmOptions& options() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_PDM_H_
