// HTTP/1.1 on one connection.
#ifndef LITAGS_SERVER_WEB_CONNECTION_H_
#define LITAGS_SERVER_WEB_CONNECTION_H_

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <functional>
#include <memory>
#include <string>

#include "server/net/peer.h"
#include "server/web/exchange.h"

namespace litags::web {

struct ConnectionLimits {
  double head_seconds = 60;     // until the head of the next request is there
  double silence_seconds = 60;  // between two pieces of a body
  double unread_seconds = 60;   // until an answer is read, and one more for each MiB
};

// What connections share. Must outlive them.
struct ConnectionEnvironment {
  ConnectionLimits limits;
  Handler handler;
  std::function<void(const Peer& peer)> admit;  // a call of its was let in
  std::atomic<bool> stopping = false;
};

struct Caller {
  Peer peer;
  std::string text;     // for logs
  std::string network;  // who it is for limits
};

// Serves requests until the connection ends; `socket`'s executor is a strand. `tls` null:
// plaintext.
void ServeConnection(boost::asio::ip::tcp::socket socket,
                     std::shared_ptr<boost::asio::ssl::context> tls, Caller caller,
                     ConnectionEnvironment* environment);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_CONNECTION_H_
