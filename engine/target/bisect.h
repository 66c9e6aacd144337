// Inverts a function.
#ifndef LITAGS_ENGINE_TARGET_BISECT_H_
#define LITAGS_ENGINE_TARGET_BISECT_H_

namespace litags {

// x in [low, high] with f(x) = y, for a growing f.
template <class F>
double Bisect(const F& f, double y, double low, double high) {
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (f(middle) < y ? low : high) = middle;
  }
  return high;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_BISECT_H_
