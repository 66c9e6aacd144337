// Room on an SQLite job store's disk for when that is full: a deletion writes before it frees
// anything, and so does a server that starts. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQLITE_RESERVE_H_
#define LITAGS_SERVER_STORE_SQLITE_RESERVE_H_

#include <cstdint>
#include <string>

namespace litags {

// Deleting a job of 10,000 files and 20,000 events writes 10 MiB.
constexpr int64_t kReserveBytes = int64_t{16} << 20;

// Makes the file "STORE-reserve", or makes it whole again, where the disk has room to spare.
// Whether it is whole.
bool FillReserve(const std::string& store_path);

// Gives a part of it back to the disk, for who writes next. False: nothing was left.
bool DrawOnReserve(const std::string& store_path);

// The same, where the disk has no room for the shared memory of a store that is opened. The kernel
// ends a process (SIGBUS) that writes to memory of a file and finds no room on its disk.
void DrawOnReserveToOpen(const std::string& store_path);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQLITE_RESERVE_H_
