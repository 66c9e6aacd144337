// The way of a capture's files to the server.
#ifndef LITAGS_CLIENT_UPLOAD_H_
#define LITAGS_CLIENT_UPLOAD_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/capture.h"
#include "client/client.h"

namespace litags::client {

struct UploadProgress {
  int files_done = 0;  // acknowledged by the server
  int files = 0;
  int64_t bytes_done = 0;
  int64_t bytes = 0;
  // What of archives the service has no use for; of very many the first.
  std::vector<std::string> skipped;
  size_t skipped_total = 0;
  std::vector<std::string> left_out;  // why, of each photo that the service does not take
};

// Fills in the files' digests. Photos that cannot be sent from here, as a link to what is gone, are
// taken out of `files`, and their masks, as long as three remain; so are masks whose names
// cannot be sent, and broken depth maps of no other photo. Returns why, of each. With `strict`, and
// of any other file, it is an error. The Python package has the same rule (files.py).
// INVALID_ARGUMENT (FILE_UNREADABLE, BAD_FILE_NAME); CANCELLED soon after `interrupt` was raised.
absl::StatusOr<std::vector<std::string>> ReadFiles(
    std::vector<LocalFile>& files, const Interrupt& interrupt,
    absl::FunctionRef<void(const LocalFile&)> on_file, bool strict = false);

// Sends the files to a job in state UPLOADING and returns when the server has acknowledged all. It
// brings cameras and depth maps to the front of `files`: if one is refused, no photo has been sent.
// They go in streams of a few megabytes each; before each, and after a broken one, the server is
// asked what it has, so that no byte that arrived is sent again. A photo that the service cannot
// read, or whose name it does not take, is left out, and its mask, as long as three remain; with
// `strict` it is an error.
// `on_progress` is called at the start, after each stream and after each photo that is left out.
// INVALID_ARGUMENT (FILE_UNREADABLE, FILE_CHANGED) for trouble on this side, else the errors of
// UploadImages.
absl::Status UploadFiles(Client& client, const std::string& job, std::vector<LocalFile>& files,
                         absl::FunctionRef<void(const UploadProgress&)> on_progress,
                         bool strict = false);

// A digest over roles, names and contents of all files, for CreateJobRequest.content_digest; fills
// in their own digests. `on_file` is told each before it is read. The Python package makes the same
// (files.py). INVALID_ARGUMENT (FILE_UNREADABLE, BAD_FILE_NAME); CANCELLED soon after `interrupt`
// was raised.
absl::StatusOr<std::string> ContentDigest(std::vector<LocalFile>& files, const Interrupt& interrupt,
                                          absl::FunctionRef<void(const LocalFile&)> on_file);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_UPLOAD_H_
