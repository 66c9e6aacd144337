#ifndef LITAGS_SERVER_API_SERVER_INFO_H_
#define LITAGS_SERVER_API_SERVER_INFO_H_

#include "absl/status/statusor.h"
#include "litags/v1/server_info.pb.h"
#include "server/api/gate.h"

namespace litags {

// What this server is and allows the caller.
absl::StatusOr<v1::ServerInfo> DescribeServer(const Call& call);

}  // namespace litags

#endif  // LITAGS_SERVER_API_SERVER_INFO_H_
