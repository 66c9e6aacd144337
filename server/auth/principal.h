#ifndef LITAGS_SERVER_AUTH_PRINCIPAL_H_
#define LITAGS_SERVER_AUTH_PRINCIPAL_H_

#include <string>

namespace litags {

// Who calls. Without authentication everybody is the operator: no name, and an administrator.
struct Principal {
  std::string name;
  bool admin = false;  // sees and changes everybody's jobs
};

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_PRINCIPAL_H_
