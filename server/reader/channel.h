// Packets between the server and the processes that read strangers' files for it.
#ifndef LITAGS_SERVER_READER_CHANNEL_H_
#define LITAGS_SERVER_READER_CHANNEL_H_

#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/unique_fd.h"

namespace litags {

inline constexpr size_t kMaxPacketBytes = size_t{64} << 10;

// What a packet is: its first byte.
namespace packet {
// To the program: read this file, or unpack this archive.
inline constexpr char kCheck = 'C', kUnpack = 'U';
// From a process: here I am; an entry of the archive; bytes of it; its end; the verdict, the last.
inline constexpr char kHello = 'H', kEntry = 'E', kBytes = 'B', kEndOfEntry = 'F', kVerdict = 'V';
// To a process: whether the entry is wanted.
inline constexpr char kWanted = 'W', kNotWanted = 'N';
}  // namespace packet

// The kind, and texts without NUL bytes.
std::string MakePacket(char kind, absl::Span<const std::string> texts);
std::vector<std::string> TextsOf(std::string_view packet);

// One end of a connection that keeps packets apart.
class Channel {
 public:
  Channel() = default;
  explicit Channel(UniqueFd fd) : fd_(std::move(fd)) {}
  static absl::StatusOr<std::pair<Channel, Channel>> MakePair();

  int fd() const { return fd_.get(); }

  // `files` go with the packet. False if the other side is gone.
  bool Send(std::string_view packet, std::initializer_list<int> files = {}) const;
  // Waits for the next packet, which is not empty; nullopt if the other side is gone, or sends what
  // is no packet. Files that came with it are dropped if `files` is null.
  std::optional<std::string> Receive(std::vector<UniqueFd>* files = nullptr) const;

 private:
  UniqueFd fd_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_READER_CHANNEL_H_
