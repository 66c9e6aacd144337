#ifndef LITAGS_SERVER_WORKER_LOG_H_
#define LITAGS_SERVER_WORKER_LOG_H_

#include <string>

namespace litags {

// Logs go to stderr, one line per event: time, level, program, text with key=value pairs
// ("job=ID"). Returns false, having said so, for an unknown level.
bool SetUpLog(const std::string& level, const std::string& program);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_LOG_H_
