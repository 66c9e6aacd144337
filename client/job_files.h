// The files of a job, and what the server found in them before cameras are searched for.
#ifndef LITAGS_CLIENT_JOB_FILES_H_
#define LITAGS_CLIENT_JOB_FILES_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/client.h"

namespace litags::client {

// All pages of ListFiles. Errors as there.
absl::StatusOr<std::vector<v1::JobFile>> ListAllFiles(Client& client, const std::string& job);

// What of the files would be used, as "12 photos would be used, 1 is left out; 640x480 px; 28 mm;
// light: -0.4 to +0.6 stops from the middle photo; 2 masks", then a line for each photo that is
// left out. Whether photos have one of the cameras that were sent, it leaves open. No line ends
// with a newline.
std::vector<std::string> DescribeFiles(const std::vector<v1::JobFile>& files);

// A line for each file, each ending with a newline: role, bytes, size, of photos mean code, light
// in stops and sharpness beside the job's middle photo, the name and why it is left out.
std::string FileTable(const std::vector<v1::JobFile>& files);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_JOB_FILES_H_
