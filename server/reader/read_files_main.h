#ifndef LITAGS_SERVER_READER_READ_FILES_MAIN_H_
#define LITAGS_SERVER_READER_READ_FILES_MAIN_H_

namespace litags {

// The word behind `litags-server` that makes it the program of MakeRemoteReader().
inline constexpr char kReadFilesCommand[] = "read-files";

// Waits on stdin, a Channel, for files to read, and forks a process for each. Never touches their
// bytes itself. Ends when the channel does, and returns the exit code.
int ReadFilesMain();

}  // namespace litags

#endif  // LITAGS_SERVER_READER_READ_FILES_MAIN_H_
