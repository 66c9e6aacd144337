#ifndef LITAGS_SERVER_TESTING_FAULTY_BLOB_STORE_H_
#define LITAGS_SERVER_TESTING_FAULTY_BLOB_STORE_H_

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/blob_store.h"

namespace litags {

// Another blob store, whose calls that read or write blobs fail as a test wants it.
class FaultyBlobStore : public BlobStore {
 public:
  explicit FaultyBlobStore(BlobStore* blobs) : blobs_(blobs) {}

  // OK, as by default: the call goes on to the other store.
  std::function<absl::Status(std::string_view key)> on_read = [](auto) { return absl::OkStatus(); };
  std::function<absl::Status(std::string_view key)> on_write = on_read;

  absl::Status Put(std::string_view key, std::string_view bytes) override {
    const absl::Status fault = on_write(key);
    return fault.ok() ? blobs_->Put(key, bytes) : fault;
  }
  absl::Status PutFile(std::string_view key, const std::string& path) override {
    const absl::Status fault = on_write(key);
    return fault.ok() ? blobs_->PutFile(key, path) : fault;
  }
  absl::StatusOr<bool> Has(std::string_view key) override { return blobs_->Has(key); }
  absl::StatusOr<std::string> Get(std::string_view key) override {
    const absl::Status fault = on_read(key);
    return fault.ok() ? blobs_->Get(key) : fault;
  }
  absl::Status Fetch(std::string_view key, const std::string& path) override {
    const absl::Status fault = on_read(key);
    return fault.ok() ? blobs_->Fetch(key, path) : fault;
  }
  absl::Status Link(std::string_view from, std::string_view to) override {
    return blobs_->Link(from, to);
  }
  absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) override {
    return blobs_->List(prefix);
  }
  absl::StatusOr<double> QuietSeconds(std::string_view prefix) override {
    return blobs_->QuietSeconds(prefix);
  }
  absl::Status Remove(std::string_view key) override { return blobs_->Remove(key); }
  absl::Status RemoveFolder(std::string_view prefix) override {
    return blobs_->RemoveFolder(prefix);
  }

 private:
  BlobStore* const blobs_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_FAULTY_BLOB_STORE_H_
