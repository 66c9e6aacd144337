#ifndef LITAGS_SERVER_TESTING_FREE_PORT_H_
#define LITAGS_SERVER_TESTING_FREE_PORT_H_

namespace litags {

// A port on loopback that was free just now.
int FreePort();

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_FREE_PORT_H_
