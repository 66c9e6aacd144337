#ifndef LITAGS_ENGINE_CORE_ALIGNED_H_
#define LITAGS_ENGINE_CORE_ALIGNED_H_

#include <sys/mman.h>

#include <cstddef>
#include <new>
#include <vector>

namespace litags {

// Allocates on 64-byte boundaries: one cache line, one AVX-512 vector. Large arrays ask for huge
// pages: kernels jump around in them, and each jump would miss the table of small pages.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  static constexpr size_t kHugePage = size_t{2} << 20;  // x86-64, and AArch64 with 4 KiB pages

  static constexpr std::align_val_t AlignmentOf(size_t bytes) {
    return std::align_val_t{bytes >= kHugePage ? kHugePage : 64};
  }

  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}

  T* allocate(size_t n) {
    const size_t bytes = n * sizeof(T);
    void* p = ::operator new(bytes, AlignmentOf(bytes));
    // A request only: without huge pages everything works, more slowly.
    if (bytes >= kHugePage) (void)madvise(p, bytes, MADV_HUGEPAGE);
    return static_cast<T*>(p);
  }
  void deallocate(T* p, size_t n) { ::operator delete(p, AlignmentOf(n * sizeof(T))); }

  friend bool operator==(AlignedAllocator, AlignedAllocator) { return true; }
};

using AlignedFloats = std::vector<float, AlignedAllocator<float>>;

// Gives a scratch vector n elements of any value. Where it must grow it frees before it allocates:
// resize() would hold, and copy, what nobody reads.
template <class Vector>
void ResizeScratch(size_t n, Vector* v) {
  if (n > v->capacity()) {
    Vector().swap(*v);
    v->reserve(n + n / 8);  // views differ
  }
  v->resize(n);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_ALIGNED_H_
