#include "server/reader/channel.h"

#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr size_t kMaxFiles = 2;
constexpr char kBetween[] = {'\0'};

}  // namespace

std::string MakePacket(char kind, absl::Span<const std::string> texts) {
  return absl::StrCat(std::string(1, kind),
                      absl::StrJoin(texts, absl::string_view(kBetween, sizeof(kBetween))));
}

std::vector<std::string> TextsOf(std::string_view packet) {
  packet.remove_prefix(std::min<size_t>(1, packet.size()));
  return absl::StrSplit(absl::string_view(packet.data(), packet.size()), kBetween[0]);
}

absl::StatusOr<std::pair<Channel, Channel>> Channel::MakePair() {
  int fds[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, fds) != 0) {
    return MakeError(absl::StatusCode::kResourceExhausted, "PROCESS_LIMIT", "",
                     absl::StrCat("socketpair failed: ", strerror(errno),
                                  "; too many open files or too little memory"));
  }
  return std::pair(Channel(UniqueFd(fds[0])), Channel(UniqueFd(fds[1])));
}

bool Channel::Send(std::string_view packet, std::initializer_list<int> files) const {
  iovec bytes = {const_cast<char*>(packet.data()), packet.size()};
  alignas(cmsghdr) char room[CMSG_SPACE(kMaxFiles * sizeof(int))] = {};
  msghdr message = {};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  if (files.size() > 0) {
    message.msg_control = room;
    message.msg_controllen = CMSG_SPACE(files.size() * sizeof(int));
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(files.size() * sizeof(int));
    std::memcpy(CMSG_DATA(header), files.begin(), files.size() * sizeof(int));
  }
  ssize_t sent;
  do {
    sent = sendmsg(fd_.get(), &message, MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  return sent == static_cast<ssize_t>(packet.size());
}

std::optional<std::string> Channel::Receive(std::vector<UniqueFd>* files) const {
  std::string packet(kMaxPacketBytes, '\0');
  iovec bytes = {packet.data(), packet.size()};
  alignas(cmsghdr) char room[CMSG_SPACE(kMaxFiles * sizeof(int))];
  msghdr message = {};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  if (files) {
    message.msg_control = room;
    message.msg_controllen = sizeof(room);
  }
  ssize_t received;
  // An end that closes before it has read everything resets the connection; the packets that it
  // sent come after that error.
  do {
    received = recvmsg(fd_.get(), &message, MSG_CMSG_CLOEXEC);
  } while (received < 0 && (errno == EINTR || errno == ECONNRESET));
  if (received <= 0) return std::nullopt;
  for (cmsghdr* header = files ? CMSG_FIRSTHDR(&message) : nullptr; header != nullptr;
       header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS) continue;
    for (size_t at = CMSG_LEN(0); at + sizeof(int) <= header->cmsg_len; at += sizeof(int)) {
      int fd;
      std::memcpy(&fd, CMSG_DATA(header) + at - CMSG_LEN(0), sizeof(fd));
      files->emplace_back(fd);
    }
  }
  if ((message.msg_flags & MSG_TRUNC) != 0) return std::nullopt;
  packet.resize(static_cast<size_t>(received));
  return packet;
}

}  // namespace litags
