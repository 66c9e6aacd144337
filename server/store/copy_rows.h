// All rows of a job store in another one, whichever databases they are.
#ifndef LITAGS_SERVER_STORE_COPY_ROWS_H_
#define LITAGS_SERVER_STORE_COPY_ROWS_H_

#include <cstdint>
#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/data_dir.h"
#include "server/store/open_stores.h"

namespace litags {

// What the rows of a table amount to, in no order.
struct RowSum {
  int64_t rows = 0;
  std::string digest;  // of names and values of all columns, hex
  bool operator==(const RowSum&) const = default;
};
using RowSums = std::map<std::string, RowSum>;  // by table

// What a store holds, brought to the newest layout. Errors of the stores.
absl::StatusOr<RowSums> ReadRowSums(const StorePlaces& places, const DataDir& data);

// Brings both stores to the newest layout, then copies every row of every table but `workers`, in
// one transaction: the target has all or none. The target becomes the same installation. Tables and
// columns are those that the databases say they have. If the target has jobs already, they must be
// the same, and nothing is written. Returns what both stores hold, read anew from each.
//
// `wanted`: ReadRowSums() of the source before anything of it was copied, blobs included. Nobody
// may use the stores since. FAILED_PRECONDITION (TARGET_NOT_EMPTY, LAYOUTS_DIFFER), DATA_LOSS
// (COPY_DIFFERS), and the errors of the stores.
absl::StatusOr<RowSums> CopyRows(const StorePlaces& from, const StorePlaces& to,
                                 const DataDir& data, const RowSums& wanted);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_COPY_ROWS_H_
