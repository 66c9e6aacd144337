#ifndef LITAGS_CLIENT_SIBLING_H_
#define LITAGS_CLIENT_SIBLING_H_

#include <string>

namespace litags::client {

// A program that is installed with this one: its path beside it, or else its name alone, which
// execvp() and posix_spawnp() look for in PATH.
std::string SiblingProgram(const std::string& name);

// That it cannot be started, for this errno.
std::string SiblingMissing(const std::string& name, int error);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_SIBLING_H_
