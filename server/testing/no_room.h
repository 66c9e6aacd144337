#ifndef LITAGS_SERVER_TESTING_NO_ROOM_H_
#define LITAGS_SERVER_TESTING_NO_ROOM_H_

#include <signal.h>
#include <sys/resource.h>

namespace litags {

// While it lives, this process can make no file longer than that, as on a full disk.
class NoRoom {
 public:
  explicit NoRoom(rlim_t longest_bytes = 1) : handler_(signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit none = {longest_bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &none);
  }
  ~NoRoom() {
    setrlimit(RLIMIT_FSIZE, &before_);
    signal(SIGXFSZ, handler_);
  }
  NoRoom(const NoRoom&) = delete;
  NoRoom& operator=(const NoRoom&) = delete;

 private:
  void (*const handler_)(int);
  rlimit before_ = {};
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_NO_ROOM_H_
