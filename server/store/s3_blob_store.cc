#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/unique_fd.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"
#include "server/store/s3_client.h"

namespace litags {
namespace {

// Blobs whose key ends in a SHA-256 are checked against it.
std::string DigestIn(std::string_view key) {
  const std::string_view name = key.substr(key.rfind('/') + 1);
  return IsDigest(name) ? std::string(name) : "";
}

// "2026-11-21T15:32:21.000Z" as seconds since 1970; 0 if it is no time.
double SecondsOf(const std::string& time) {
  std::tm parts{};
  return strptime(time.c_str(), "%Y-%m-%dT%H:%M:%S", &parts) ? static_cast<double>(timegm(&parts))
                                                             : 0;
}

class S3BlobStore : public BlobStore {
 public:
  explicit S3BlobStore(S3Options options) : client_(std::move(options)) {}

  absl::Status Open() {
    S3Request request;
    request.query = {{"list-type", "2"}, {"max-keys", "1"}};
    return client_.Send(request).status();
  }

  absl::Status Put(std::string_view key, std::string_view bytes) override {
    size_t at = 0;
    return Upload(key, static_cast<int64_t>(bytes.size()), [&](size_t wanted) {
      const std::string part(bytes.substr(at, wanted));
      at += part.size();
      return absl::StatusOr<std::string>(part);
    });
  }

  absl::Status PutFile(std::string_view key, const std::string& path) override {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (error) return FileError("read", path, error.value());
    std::ifstream file(path, std::ios::binary);
    LITAGS_RETURN_IF_ERROR(
        Upload(key, static_cast<int64_t>(size), [&](size_t wanted) -> absl::StatusOr<std::string> {
          std::string part(wanted, '\0');
          file.read(part.data(), static_cast<std::streamsize>(wanted));
          if (file.gcount() != static_cast<std::streamsize>(wanted)) {
            return FileError("read", path, EIO);
          }
          return part;
        }));
    unlink(path.c_str());
    return absl::OkStatus();
  }

  absl::StatusOr<bool> Has(std::string_view key) override {
    const absl::Status status = SizeOf(key).status();
    if (absl::IsNotFound(status)) return false;
    LITAGS_RETURN_IF_ERROR(status);
    return true;
  }

  absl::StatusOr<std::string> Get(std::string_view key) override {
    std::string bytes;
    LITAGS_RETURN_IF_ERROR(Download(key, [&](const std::string& part) {
      bytes += part;
      return absl::OkStatus();
    }));
    return bytes;
  }

  absl::Status Fetch(std::string_view key, const std::string& path) override {
    UniqueFd fd(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (!fd.valid()) return FileError("create", path, errno);
    absl::Status status = Download(key, [&](const std::string& part) {
      const int error = WriteAll(fd.get(), part);
      return error ? FileError("write", path, error) : absl::OkStatus();
    });
    // Some file systems say only here that there was no room.
    if (!fd.Close() && status.ok()) status = FileError("write", path, errno);
    if (!status.ok()) unlink(path.c_str());
    return status;
  }

  absl::Status Link(std::string_view from, std::string_view to) override {
    if (from == to) return SizeOf(to).status();  // S3 copies no blob onto itself
    const S3Options& options = client_.options();
    S3Request request{"PUT", std::string(to), {}, {}, {}};
    request.headers = {absl::StrCat("x-amz-copy-source: /", options.bucket, "/", options.prefix,
                                    std::string(from))};
    LITAGS_ASSIGN_OR_RETURN(const S3Answer answer, client_.Send(request));
    return CheckLateError(answer, "copy");
  }

  absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) override {
    const std::string folder = absl::StrCat(client_.options().prefix, std::string(prefix), "/");
    std::vector<std::string> names;
    LITAGS_RETURN_IF_ERROR(ListPages(folder, "/", [&](const std::string& page) {
      for (const char* tag : {"Key", "Prefix"}) {
        for (std::string name : XmlTexts(page, tag)) {
          if (!name.starts_with(folder) || name == folder) continue;
          name.erase(0, folder.size());
          if (name.back() == '/') name.pop_back();
          names.push_back(std::move(name));
        }
      }
    }));
    return names;
  }

  absl::StatusOr<double> QuietSeconds(std::string_view prefix) override {
    double newest = -std::numeric_limits<double>::infinity();
    LITAGS_RETURN_IF_ERROR(
        ListPages(absl::StrCat(client_.options().prefix, std::string(prefix), "/"), "",
                  [&](const std::string& page) {
                    for (const std::string& time : XmlTexts(page, "LastModified")) {
                      newest = std::max(newest, SecondsOf(time));
                    }
                  }));
    return static_cast<double>(std::time(nullptr)) - newest;
  }

  absl::Status Remove(std::string_view key) override {
    const absl::Status status =
        client_.Send(S3Request{"DELETE", std::string(key), {}, {}, {}}).status();
    return absl::IsNotFound(status) ? absl::OkStatus() : status;
  }

  absl::Status RemoveFolder(std::string_view prefix) override {
    const std::string& root = client_.options().prefix;
    std::vector<std::string> keys;
    LITAGS_RETURN_IF_ERROR(
        ListPages(absl::StrCat(root, std::string(prefix), "/"), "", [&](const std::string& page) {
          for (const std::string& key : XmlTexts(page, "Key")) {
            keys.push_back(key.substr(root.size()));
          }
        }));
    for (const std::string& key : keys) LITAGS_RETURN_IF_ERROR(Remove(key));
    return absl::OkStatus();
  }

  // Uploads in parts that nobody completes: their parts are paid for, and no listing shows them.
  void RemoveTemporary() override {
    const std::string& root = client_.options().prefix;
    std::string key, upload;  // where the next page begins
    do {
      S3Request request;
      if (!key.empty()) request.query = {{"key-marker", key}};
      request.query.push_back({"prefix", root + "jobs/"});
      if (!upload.empty()) request.query.push_back({"upload-id-marker", upload});
      request.query.push_back({"uploads", ""});
      const auto page = client_.Send(request);
      if (!page.ok()) return;  // the next time, then
      for (const std::string& found : XmlTexts(page->body, "Upload")) AbortIfAbandoned(found);
      const bool more = XmlText(page->body, "IsTruncated") == "true";
      key = more ? XmlText(page->body, "NextKeyMarker") : "";
      upload = XmlText(page->body, "NextUploadIdMarker");
    } while (!key.empty());
  }

 private:
  void AbortIfAbandoned(const std::string& upload) {
    const std::string key = XmlText(upload, "Key"), root = client_.options().prefix;
    const double begun = SecondsOf(XmlText(upload, "Initiated"));
    const double age = static_cast<double>(std::time(nullptr)) - begun;
    if (begun == 0 || age < client_.options().abandoned_seconds || !key.starts_with(root)) return;
    client_
        .Send(S3Request{
            "DELETE", key.substr(root.size()), {{"uploadId", XmlText(upload, "UploadId")}}, {}, {}})
        .IgnoreError();
  }

  using NextPart = absl::FunctionRef<absl::StatusOr<std::string>(size_t)>;

  // In one request, or in parts that become a blob when all are there.
  absl::Status Upload(std::string_view key, int64_t size, NextPart next) {
    if (size <= client_.options().part_bytes) {
      LITAGS_ASSIGN_OR_RETURN(const std::string bytes, next(static_cast<size_t>(size)));
      return WriteError(client_.Send(S3Request{"PUT", std::string(key), {}, {}, bytes}).status());
    }
    const auto begun = client_.Send(S3Request{"POST", std::string(key), {{"uploads", ""}}, {}, {}});
    if (!begun.ok()) return WriteError(begun.status());
    const std::string upload = XmlText(begun->body, "UploadId");
    const absl::Status status = WriteError(UploadParts(key, upload, size, next));
    if (!status.ok()) {  // else its parts stay, and are paid for
      client_.Send(S3Request{"DELETE", std::string(key), {{"uploadId", upload}}, {}, {}})
          .IgnoreError();
    }
    return status;
  }

  absl::Status UploadParts(std::string_view key, const std::string& upload, int64_t size,
                           NextPart next) {
    std::string list = "<CompleteMultipartUpload>";
    int number = 0;
    for (int64_t done = 0; done < size;) {
      const int64_t wanted = std::min(client_.options().part_bytes, size - done);
      LITAGS_ASSIGN_OR_RETURN(const std::string part, next(static_cast<size_t>(wanted)));
      LITAGS_ASSIGN_OR_RETURN(
          const S3Answer answer,
          client_.Send(S3Request{"PUT",
                                 std::string(key),
                                 {{"partNumber", absl::StrCat(++number)}, {"uploadId", upload}},
                                 {},
                                 part}));
      const auto etag = answer.headers.find("etag");
      absl::StrAppend(&list, "<Part><PartNumber>", number, "</PartNumber><ETag>",
                      etag == answer.headers.end() ? "" : etag->second, "</ETag></Part>");
      done += wanted;
    }
    list += "</CompleteMultipartUpload>";
    const auto answer =
        client_.Send(S3Request{"POST", std::string(key), {{"uploadId", upload}}, {}, list});
    if (answer.ok()) return CheckLateError(*answer, "complete");
    // Sent again after an answer that was lost, it may find the upload completed and forgotten.
    if (absl::IsNotFound(answer.status()) && SizeOf(key).value_or(-1) == size) {
      return absl::OkStatus();
    }
    return answer.status();
  }

  // A blob that is written need not be there: 404 says that the store did not take it.
  static absl::Status WriteError(const absl::Status& status) {
    if (!absl::IsNotFound(status)) return status;
    return MakeError(
        absl::StatusCode::kInternal, "STORE_FAILED", "",
        absl::StrCat("the blob store answered a write with 404: ", std::string(status.message())));
  }

  absl::StatusOr<int64_t> SizeOf(std::string_view key) {
    LITAGS_ASSIGN_OR_RETURN(const S3Answer head,
                            client_.Send(S3Request{"HEAD", std::string(key), {}, {}, {}}));
    const auto length = head.headers.find("content-length");
    return length == head.headers.end() ? 0 : std::atoll(length->second.c_str());
  }

  // Long operations answer 200 before they know how they end.
  static absl::Status CheckLateError(const S3Answer& answer, const char* action) {
    if (answer.body.find("<Error>") == std::string::npos) return absl::OkStatus();
    return MakeError(absl::StatusCode::kUnavailable, "BLOBS_UNAVAILABLE", "",
                     absl::StrCat("the blob store could not ", action, ": ",
                                  XmlText(answer.body, "Code"), "; try again in a moment"));
  }

  // By ranges of part_bytes, so that a broken connection costs one of them.
  absl::Status Download(std::string_view key,
                        absl::FunctionRef<absl::Status(const std::string&)> keep) {
    LITAGS_ASSIGN_OR_RETURN(const int64_t size, SizeOf(key));
    const int64_t part_bytes = client_.options().part_bytes;
    Sha256 sha;
    for (int64_t at = 0; at < size;) {
      const int64_t end = std::min(size, at + part_bytes);
      S3Request request{"GET", std::string(key), {}, {}, {}};
      request.headers = {absl::StrCat("range: bytes=", at, "-", end - 1)};
      LITAGS_ASSIGN_OR_RETURN(const S3Answer answer, client_.Send(request));
      if (static_cast<int64_t>(answer.body.size()) != end - at) return Damaged(key);
      sha.Update(answer.body);
      LITAGS_RETURN_IF_ERROR(keep(answer.body));
      at = end;
    }
    const std::string digest = DigestIn(key);
    return digest.empty() || sha.HexDigest() == digest ? absl::OkStatus() : Damaged(key);
  }

  static absl::Status Damaged(std::string_view key) {
    return MakeError(absl::StatusCode::kDataLoss, "BLOB_DAMAGED", "",
                     absl::StrCat("the blob store gave other bytes than were stored as ",
                                  std::string(key), "; put back a backup"));
  }

  absl::Status ListPages(const std::string& prefix, const char* delimiter,
                         absl::FunctionRef<void(const std::string&)> take) {
    for (std::string token;;) {
      S3Request request;
      if (!token.empty()) request.query.push_back({"continuation-token", token});
      if (*delimiter) request.query.push_back({"delimiter", delimiter});
      const std::string page_names = absl::StrCat(client_.options().page_names);
      request.query.insert(request.query.end(),
                           {{"list-type", "2"}, {"max-keys", page_names}, {"prefix", prefix}});
      LITAGS_ASSIGN_OR_RETURN(const S3Answer page, client_.Send(request));
      take(page.body);
      token = XmlText(page.body, "NextContinuationToken");
      if (token.empty()) return absl::OkStatus();
    }
  }

  S3Client client_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<BlobStore>> OpenS3BlobStore(S3Options options) {
  if (options.access_key.empty() || options.secret_key.empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "BLOBS_DENIED", "blobs",
                     "S3 needs AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment");
  }
  auto store = std::make_unique<S3BlobStore>(std::move(options));
  LITAGS_RETURN_IF_ERROR(store->Open());
  return std::unique_ptr<BlobStore>(std::move(store));
}

}  // namespace litags
