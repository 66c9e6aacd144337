// What tests of uploads share.
#ifndef LITAGS_SERVER_JOBS_UPLOADS_TEST_UTIL_H_
#define LITAGS_SERVER_JOBS_UPLOADS_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/sweeper.h"
#include "server/jobs/uploads.h"
#include "server/store/digest.h"

namespace litags {

inline FileRecord Photo(const std::string& name, const std::string& bytes,
                        FileRole role = FileRole::kPhoto) {
  return {name, role, static_cast<int64_t>(bytes.size()), Sha256::Hex(bytes), 64, 48};
}

class UploadsTest : public ::testing::Test {
 protected:
  UploadsTest() { Restart({}); }

  // As a server does that starts again on the same data.
  void Restart(UploadLimits limits) {
    sweeper_.reset();
    jobs_.reset();
    blobs_.reset();
    store_.reset();
    store_ = *OpenSqliteJobStore(data_.database());
    blobs_ = *OpenDiskBlobStore(data_.blobs());
    jobs_ = std::make_unique<Jobs>(store_.get(), blobs_.get(), data_, clock_, limits);
    sweeper_ = std::make_unique<Sweeper>(store_.get(), blobs_.get(), &uploads(), data_, clock_);
  }

  Uploads& uploads() { return jobs_->uploads(); }
  std::string NewJob() { return jobs_->Create({})->id; }

  // A whole file at once.
  absl::Status Add(const std::string& id, const std::string& name, const std::string& bytes,
                   FileRole role = FileRole::kPhoto) {
    const FileRecord file = Photo(name, bytes, role);
    auto partial = uploads().Open(id, file, 0);
    if (!partial.ok()) return partial.status();
    LITAGS_RETURN_IF_ERROR((*partial)->Append(bytes));
    return uploads().Add(id, file, (*partial)->path());
  }

  int64_t OffsetOf(const std::string& id, const FileRecord& file) {
    const auto statuses = uploads().Query(id, {file});
    EXPECT_TRUE(statuses.ok()) << statuses.status();
    return statuses.ok() ? (*statuses)[0].offset : -1;
  }

  // Bytes of all files of jobs, the database left out.
  int64_t BytesOnDisk() const {
    int64_t bytes = 0;
    for (const std::string& folder :
         {data_.blobs(), data_.uploads(), data_.scratch(), data_.tmp()}) {
      for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        if (entry.is_regular_file()) bytes += static_cast<int64_t>(entry.file_size());
      }
    }
    return bytes;
  }

  int64_t now_ms_ = 1'000'000'000;
  Clock clock_ = [this] { return now_ms_; };
  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<Jobs> jobs_;
  std::unique_ptr<Sweeper> sweeper_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_UPLOADS_TEST_UTIL_H_
