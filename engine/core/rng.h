#ifndef LITAGS_ENGINE_CORE_RNG_H_
#define LITAGS_ENGINE_CORE_RNG_H_

#include <cmath>
#include <cstdint>
#include <numbers>

namespace litags {

// Counter-based random numbers: a pure function of (seed, stream, counter), so nothing has to be
// saved to resume a run and threads need no shared state. SplitMix64's finaliser (Steele et al.
// 2014), applied twice.
class CounterRng {
 public:
  CounterRng(uint64_t seed, uint64_t stream) : key_(Mix(seed ^ Mix(stream + kGolden))) {}

  uint64_t Bits(uint64_t counter) const { return Mix(key_ + (counter + 1) * kGolden); }

  // Uniform in [0, n); n > 0. The bias is below n / 2^64.
  uint64_t Below(uint64_t counter, uint64_t n) const {
    return static_cast<uint64_t>((static_cast<unsigned __int128>(Bits(counter)) * n) >> 64);
  }

  // Uniform in (0, 1).
  double Uniform(uint64_t counter) const {
    return (static_cast<double>(Bits(counter) >> 11) + 0.5) * 0x1.0p-53;
  }

  // Standard normal (Box-Muller over two derived uniforms).
  double Normal(uint64_t counter) const {
    const double u = Uniform(2 * counter), v = Uniform(2 * counter + 1);
    return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
  }

 private:
  static constexpr uint64_t kGolden = 0x9E3779B97F4A7C15ull;
  static uint64_t Mix(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  uint64_t key_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_RNG_H_
