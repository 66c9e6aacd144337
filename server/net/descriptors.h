#ifndef LITAGS_SERVER_NET_DESCRIPTORS_H_
#define LITAGS_SERVER_NET_DESCRIPTORS_H_

namespace litags {

// Lets this process have descriptors for `connections`, as far as its hard limit allows. Children
// inherit the limit.
void RaiseDescriptorLimit(int connections);

// So many connections the limit of this process leaves room for, beside the store, files on their
// way, and children.
int ConnectionsThatFit();

}  // namespace litags

#endif  // LITAGS_SERVER_NET_DESCRIPTORS_H_
