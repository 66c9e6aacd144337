#ifndef LITAGS_ENGINE_CORE_ALIGNED_H_
#define LITAGS_ENGINE_CORE_ALIGNED_H_

#include <cstddef>
#include <new>
#include <vector>

namespace litags {

// Allocates on 64-byte boundaries: one cache line, one AVX-512 vector.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};

  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}

  T* allocate(size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, size_t) { ::operator delete(p, kAlignment); }

  friend bool operator==(AlignedAllocator, AlignedAllocator) { return true; }
};

using AlignedFloats = std::vector<float, AlignedAllocator<float>>;

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_ALIGNED_H_
