#ifndef LITAGS_SERVER_NET_DESCRIPTORS_H_
#define LITAGS_SERVER_NET_DESCRIPTORS_H_

namespace litags {

// Connections of two listeners.
struct ConnectionShares {
  int first = 0, second = 0;
};

// Lets this process have descriptors for so many connections of each, as far as its hard limit
// allows, beside the store, files on their way, and children, which inherit the limit. What each
// listener may have then: where not all fit, none gets less than half unless it wants less.
ConnectionShares ShareDescriptors(ConnectionShares wanted);

}  // namespace litags

#endif  // LITAGS_SERVER_NET_DESCRIPTORS_H_
