#ifndef LITAGS_SERVER_TESTING_BLOB_STORE_KIND_H_
#define LITAGS_SERVER_TESTING_BLOB_STORE_KIND_H_

#include <memory>
#include <string>

#include "server/store/blob_store.h"

namespace litags {

// An empty store of the kind that a test program is linked with; null if it cannot be had on this
// machine. `dir` is a temporary folder of the test.
std::unique_ptr<BlobStore> MakeTestedBlobStore(const std::string& dir);

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_BLOB_STORE_KIND_H_
