#ifndef LITAGS_ENGINE_CORE_UNIQUE_FD_H_
#define LITAGS_ENGINE_CORE_UNIQUE_FD_H_

#include <unistd.h>

#include <utility>

namespace litags {

// A file descriptor with one owner, who closes it.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~UniqueFd() { Close(); }
  // False if the kernel says only now that something written did not arrive (errno says why).
  bool Close() { return fd_ < 0 || close(std::exchange(fd_, -1)) == 0; }
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_UNIQUE_FD_H_
