#include "engine/denoise/pdm.h"

#include <algorithm>

#include "engine/core/aligned.h"
#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/denoise/conv_net.h"
#include "engine/denoise/high_pass.h"
#include "engine/denoise/padded_rows.h"

namespace litags {
namespace {

// True where the clamp to [0, 1] passes the gradient; `v` is the value before it.
bool InsideClamp(float v) { return v >= 0.0f && v <= 1.0f; }

}  // namespace

struct Pdm::Impl {
  Impl(const PdmOptions& pdm_options, int num_threads)
      : options(pdm_options),
        threads(num_threads > 0 ? num_threads : DefaultThreadCount()),
        high_pass(pdm_options),
        stages(pdm_options.stages),
        r(std::max(3, pdm_options.stages + 1)),
        R(pdm_options.stages) {
    const int num_nets = options.shared ? 1 : options.stages;
    for (int i = 0; i < num_nets; ++i) nets.emplace_back(options.hidden);
  }

  ConvNet& net(int k) { return nets[options.shared ? 0 : k]; }

  // One forward pass with the activations of stage k in stages[slot] and R_k in r[from].
  void Stage(PlanesView N, int k, int slot, int from, int to);
  void Start(const PdmWeights& weights, PlanesView R0, PlanesView N);

  // Calls body(y, c, scratch) for the three channels of every row.
  template <typename Body>
  void ForEachRow(const Body& body) {
    ParallelFor(threads, height, [&](size_t y, int thread) {
      for (int c = 0; c < 3; ++c) body(static_cast<int>(y), c, scratch[thread].data());
    });
  }

  void NoiseEstimate(PlanesView N, int k, int slot, int from);
  void CopyClamped(const PaddedRows& from, Planes* out);
  void StartGradient(PlanesView v_last, PlanesSpan v_R0);
  void NoiseEstimateVjp(int k, PlanesView v_previous, PlanesSpan v_R0, PlanesSpan v_N);

  PdmOptions options;
  int threads;
  int height = 0, width = 0;
  HighPass high_pass;
  std::vector<ConvNet> nets;
  std::vector<ConvNetActivations> stages;
  std::vector<PaddedRows> r;           // R_0..R_K before the clamp
  std::vector<Planes> R;               // R_1..R_K
  PaddedRows v_r, v_nhat;              // dL/dR_{k+1} before the clamp, dL/dNhat_k
  std::vector<AlignedFloats> scratch;  // per thread
};

void Pdm::Impl::Start(const PdmWeights& weights, PlanesView R0, PlanesView N) {
  LITAGS_CHECK(R0.channels == 3 && SameSize(R0, N));
  LITAGS_CHECK(weights.hidden == options.hidden && weights.nets.size() == nets.size());
  if (R0.height != height || R0.width != width) {
    height = R0.height;
    width = R0.width;
    high_pass.Resize(height, width);
    scratch.assign(threads, AlignedFloats(high_pass.ScratchSize(), 0.0f));
  }
  for (size_t i = 0; i < nets.size(); ++i) nets[i].SetWeights(weights.nets[i].data());
  r[0].Resize(3, height, width);
  ForEachRow([&](int y, int c, float*) {
    std::copy_n(R0.plane(c) + size_t(y) * width, width, r[0].row(y, c));
  });
}

// LITA-GS Eq. 10: R_{k+1} = R_0 - (Nhat_k - F(Nhat_k)).
void Pdm::Impl::Stage(PlanesView N, int k, int slot, int from, int to) {
  stages[slot].Resize(options.hidden, height, width);
  r[to].Resize(3, height, width);
  NoiseEstimate(N, k, slot, from);
  net(k).Forward(threads, &stages[slot], r[0], &r[to]);
}

// LITA-GS Eq. 9: Nhat_0 = (R_0 - C(R_0) + N) / 2; Nhat_k = R_k - C(R_k).
void Pdm::Impl::NoiseEstimate(PlanesView N, int k, int slot, int from) {
  ForEachRow([&](int y, int c, float* row_scratch) {
    float* nhat = stages[slot].in.row(y, c);
    high_pass.Row(r[from], c, y, k > 0 && options.clamp_R, row_scratch, nhat);
    if (k > 0) return;
    const float* noise = N.plane(c) + size_t(y) * width;
    for (int x = 0; x < width; ++x) nhat[x] = 0.5f * (nhat[x] + noise[x]);
  });
}

void Pdm::Impl::CopyClamped(const PaddedRows& from, Planes* out) {
  out->channels = 3;
  out->height = height;
  out->width = width;
  out->data.resize(3 * out->plane_size());
  ForEachRow([&](int y, int c, float*) {
    const float* value = from.row(y, c);
    float* to = out->plane(c) + size_t(y) * width;
    for (int x = 0; x < width; ++x) {
      to[x] = options.clamp_R ? std::min(std::max(value[x], 0.0f), 1.0f) : value[x];
    }
  });
}

void Pdm::Impl::StartGradient(PlanesView v_last, PlanesSpan v_R0) {
  ForEachRow([&](int y, int c, float*) {
    const size_t at = size_t(y) * width;
    const float* v = v_last.plane(c) + at;
    const float* value = r[options.stages].row(y, c);
    float* out = v_r.row(y, c);
    for (int x = 0; x < width; ++x) {
      out[x] = !options.clamp_R || InsideClamp(value[x]) ? v[x] : 0.0f;
    }
    std::copy_n(out, width, v_R0.plane(c) + at);
  });
}

// From dL/dNhat_k to dL/dR_k, which is added to v_R0 as R_k = R_0 - N_k (k >= 1).
void Pdm::Impl::NoiseEstimateVjp(int k, PlanesView v_previous, PlanesSpan v_R0, PlanesSpan v_N) {
  const bool add_previous = k == options.stages - 1 && !v_previous.empty();
  ForEachRow([&](int y, int c, float* row_scratch) {
    const size_t at = size_t(y) * width;
    float* out = v_r.row(y, c);
    high_pass.AdjointRow(v_nhat, c, y, row_scratch, out);
    if (k == 0) {
      const float* v = v_nhat.row(y, c);
      float* noise = v_N.plane(c) + at;
      for (int x = 0; x < width; ++x) out[x] *= 0.5f;
      for (int x = 0; x < width; ++x) noise[x] = 0.5f * v[x];
    }
    if (add_previous) {
      const float* v = v_previous.plane(c) + at;
      for (int x = 0; x < width; ++x) out[x] += v[x];
    }
    if (k > 0 && options.clamp_R) {
      const float* value = r[k].row(y, c);
      for (int x = 0; x < width; ++x) out[x] = InsideClamp(value[x]) ? out[x] : 0.0f;
    }
    float* total = v_R0.plane(c) + at;
    for (int x = 0; x < width; ++x) total[x] += out[x];
  });
}

Pdm::Pdm(const PdmOptions& options, int threads) : impl_(std::make_unique<Impl>(options, threads)) {
  LITAGS_CHECK(options.Validate().ok());
}
Pdm::~Pdm() = default;
Pdm::Pdm(Pdm&&) noexcept = default;
Pdm& Pdm::operator=(Pdm&&) noexcept = default;

void Pdm::Forward(const PdmWeights& weights, PlanesView R0, PlanesView N) {
  Impl& m = *impl_;
  m.Start(weights, R0, N);
  for (int k = 0; k < m.options.stages; ++k) {
    m.Stage(N, k, k, k, k + 1);
    m.CopyClamped(m.r[k + 1], &m.R[k]);
  }
}

void Pdm::Apply(const PdmWeights& weights, PlanesView R0, PlanesView N, Planes* R) {
  Impl& m = *impl_;
  m.Start(weights, R0, N);
  // Stage k reads R_k and writes R_{k+1}, in turn in two buffers beside R_0.
  const auto buffer = [](int k) { return k == 0 ? 0 : 1 + k % 2; };
  for (int k = 0; k < m.options.stages; ++k) m.Stage(N, k, 0, buffer(k), buffer(k + 1));
  m.CopyClamped(m.r[buffer(m.options.stages)], R);
}

const Planes& Pdm::R(int k) const {
  LITAGS_CHECK(k >= 1 && k <= impl_->options.stages);
  return impl_->R[k - 1];
}

void Pdm::Backward(PlanesView v_last, PlanesView v_previous, PlanesSpan v_R0, PlanesSpan v_N,
                   PdmWeights* v_weights) {
  Impl& m = *impl_;
  LITAGS_CHECK(SameSize(v_last, m.R.back()) && SameSize(v_R0, v_last) && SameSize(v_N, v_last));
  LITAGS_CHECK(v_previous.empty() || SameSize(v_previous, v_last));
  *v_weights = PdmWeights::Zeros(m.options);
  for (PaddedRows* rows : {&m.v_r, &m.v_nhat}) rows->Resize(3, m.height, m.width);

  m.StartGradient(v_last, v_R0);
  for (int k = m.options.stages - 1; k >= 0; --k) {
    // R_{k+1} = R_0 - Nhat_k + F(Nhat_k).
    float* v_net = v_weights->nets[m.options.shared ? 0 : k].data();
    m.net(k).Backward(m.threads, m.stages[k], m.v_r, &m.v_nhat, v_net);
    m.NoiseEstimateVjp(k, v_previous, v_R0, v_N);
  }
}

const PdmOptions& Pdm::options() const { return impl_->options; }

}  // namespace litags
