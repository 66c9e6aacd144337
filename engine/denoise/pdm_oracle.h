// The PDM written down once more for the tests: scalar, double precision, straight from the
// equations, sharing no code with the module.
#ifndef LITAGS_ENGINE_DENOISE_PDM_ORACLE_H_
#define LITAGS_ENGINE_DENOISE_PDM_ORACLE_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/denoise/pdm.h"

namespace litags {

struct OraclePdm {
  using Map = std::vector<double>;  // [C,H,W]

  PdmOptions options;
  int height, width;
  std::vector<Map> nets;  // PdmNetLayout
  Map R0, N;

  // R_1..R_K.
  std::vector<Map> Forward() const {
    std::vector<Map> R = {R0};
    for (int k = 0; k < options.stages; ++k) {
      Map nhat = Blur(R[k]);
      for (size_t i = 0; i < nhat.size(); ++i) {
        nhat[i] = R[k][i] - nhat[i];
        if (k == 0) nhat[i] = (nhat[i] + N[i]) / 2;
      }
      const Map f = Network(nets[options.shared ? 0 : k], nhat);
      Map next(nhat.size());
      for (size_t i = 0; i < nhat.size(); ++i) {
        next[i] = R0[i] - (nhat[i] - f[i]);
        if (options.clamp_R) next[i] = std::clamp(next[i], 0.0, 1.0);
      }
      R.push_back(next);
    }
    R.erase(R.begin());
    return R;
  }

  Map Network(const Map& net, const Map& x) const {
    const PdmNetLayout at(options.hidden);
    const int hidden = options.hidden;
    const Map h1 = Conv(x, 3, hidden, &net[at.w1], &net[at.b1], true);
    const Map h2 = Conv(h1, hidden, hidden, &net[at.w2], &net[at.b2], true);
    return Conv(h2, hidden, 3, &net[at.w3], &net[at.b3], false);
  }

 private:
  Map Conv(const Map& in, int in_channels, int out_channels, const double* w, const double* b,
           bool relu) const {
    Map out(size_t(out_channels) * height * width);
    for (int o = 0; o < out_channels; ++o) {
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          double sum = b[o];
          for (int c = 0; c < in_channels; ++c) {
            for (int ky = 0; ky < 3; ++ky) {
              for (int kx = 0; kx < 3; ++kx) {
                const int yy = y + ky - 1, xx = x + kx - 1;
                if (yy < 0 || yy >= height || xx < 0 || xx >= width) continue;
                sum += w[((o * in_channels + c) * 3 + ky) * 3 + kx] *
                       in[(size_t(c) * height + yy) * width + xx];
              }
            }
          }
          out[(size_t(o) * height + y) * width + x] = relu ? std::max(sum, 0.0) : sum;
        }
      }
    }
    return out;
  }

  // Index of the pixel that stands for position i outside [0, n); -1: nothing does.
  int Border(int i, int n) const {
    while (i < 0 || i >= n) {
      if (options.border == PdmBorder::kZero) return -1;
      if (n == 1) return 0;
      i = i < 0 ? -i : 2 * (n - 1) - i;
    }
    return i;
  }

  Map Blur(const Map& in) const {
    const int radius = options.filter_size / 2;
    std::vector<double> g;
    double norm = 0;
    for (int d = -radius; d <= radius; ++d) {
      g.push_back(std::exp(-0.5 * d * d / std::pow(options.filter_sigma, 2)));
      norm += g.back();
    }
    Map out(in.size(), 0.0);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          for (int dy = -radius; dy <= radius; ++dy) {
            for (int dx = -radius; dx <= radius; ++dx) {
              const int yy = Border(y + dy, height), xx = Border(x + dx, width);
              if (yy < 0 || xx < 0) continue;
              out[(size_t(c) * height + y) * width + x] +=
                  g[dy + radius] * g[dx + radius] / (norm * norm) *
                  in[(size_t(c) * height + yy) * width + xx];
            }
          }
        }
      }
    }
    return out;
  }
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_PDM_ORACLE_H_
