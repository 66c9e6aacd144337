#ifndef LITAGS_SERVER_TESTING_CERTIFICATES_H_
#define LITAGS_SERVER_TESTING_CERTIFICATES_H_

#include <memory>
#include <string>

namespace litags {

// A certificate authority of a test. Writes PEM files into `folder`: "NAME.crt" and "NAME.key".
class TestAuthority {
 public:
  // Makes "ca.crt".
  explicit TestAuthority(std::string folder);
  ~TestAuthority();

  // A certificate for common name `name`, for servers at 127.0.0.1 and localhost and for clients,
  // in force from now for `seconds` (negative: it has ended).
  void Issue(const std::string& name, long seconds = 3600);
  // The same with a key that is too short for any use.
  void IssueWeak(const std::string& name);

  std::string Path(const std::string& file) const { return folder_ + "/" + file; }
  std::string Read(const std::string& file) const;

 private:
  struct Keys;
  void Write(const std::string& name, long seconds, bool weak);

  const std::string folder_;
  std::unique_ptr<Keys> keys_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_CERTIFICATES_H_
