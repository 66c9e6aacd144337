#ifndef LITAGS_SERVER_WORKER_LOG_H_
#define LITAGS_SERVER_WORKER_LOG_H_

#include <string>

namespace litags {

// Logs go to stderr, one line per event. A message begins with the things it is about, as
// "key=value" words without spaces ("job=ID client=NAME"); text for humans follows.
//
//   text  time, level, program, message
//   json  an object with "time", "level", "program", "message", and a member for each such word
//
// Control characters of a message never reach the terminal or break a line. Returns false, having
// said so, for an unknown level; `format` is "text" or "json".
bool SetUpLog(const std::string& level, const std::string& format, const std::string& program);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_LOG_H_
