#ifndef LITAGS_SERVER_TESTING_CUTTING_PROXY_H_
#define LITAGS_SERVER_TESTING_CUTTING_PROXY_H_

#include <atomic>
#include <list>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace litags {

// Passes TCP connections on to a port of this machine, and cuts one where a test wants it cut.
class CuttingProxy {
 public:
  enum Cut {
    kBeforeRequest,  // the request with the text is not passed on
    kAfterRequest,   // it is, but not its answer
  };

  explicit CuttingProxy(int to_port);
  ~CuttingProxy();

  int port() const { return port_; }
  // The same PostgreSQL URL by way of this proxy.
  std::string Through(const std::string& url) const;

  // Cuts the next connection on which a client's message holds `text`.
  void CutAt(const std::string& text, Cut cut);
  bool has_cut() const { return has_cut_; }

 private:
  void Accept();
  void Pass(int client);
  void CutAll();
  // Whether what a client sent is where to cut.
  bool IsCut(const std::string& bytes, Cut* cut);

  const int to_port_;
  int listener_ = -1, port_ = 0;
  std::atomic<bool> ends_{false}, has_cut_{false};
  std::mutex mutex_;
  std::string text_;  // empty: cut nothing
  Cut cut_ = kBeforeRequest;
  std::vector<int> sockets_;
  std::list<std::thread> threads_;
  std::thread accepter_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_CUTTING_PROXY_H_
