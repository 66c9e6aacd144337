#include "client/upload.h"

#include <openssl/evp.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/types/span.h"
#include "client/report/text.h"
#include "client/status.h"
#include "proto/litags/v1/limits.h"

namespace litags::client {
namespace {

constexpr size_t kChunkBytes = 256 << 10;
// One stream acknowledges at most this much (or one larger file).
constexpr int64_t kStreamBytes = 8 << 20;
constexpr size_t kStreamFiles = 500;
static_assert(kChunkBytes <= v1::kMaxChunkBytes && kStreamFiles <= v1::kMaxQueryFiles);
constexpr std::chrono::seconds kQueryPatience{60};

absl::Status FillDigest(LocalFile& file, const Interrupt& interrupt) {
  if (!file.trouble.ok()) return file.trouble;
  if (!file.sha256.empty()) return absl::OkStatus();
  auto digest = FileSha256(file.path, interrupt, file.tail);
  if (!digest.ok()) return digest.status();
  file.sha256 = *std::move(digest);
  return absl::OkStatus();
}

void FillHeader(const LocalFile& file, v1::FileHeader* header) {
  header->set_file_name(file.name);
  header->set_role(file.role);
  header->set_size_bytes(file.size_bytes);
  header->set_sha256(file.sha256);
}

// The bytes of a file from `offset` on, as chunks, counted in `*sent`; `*open` turns false when the
// server takes no more.
absl::Status SendBytes(const LocalFile& file, int64_t offset,
                       grpc::ClientWriter<v1::UploadImagesRequest>& writer, bool* open,
                       int64_t* sent) {
  v1::UploadImagesRequest request;
  std::ifstream in(file.path, std::ios::binary);
  in.seekg(offset);
  std::string chunk(kChunkBytes, '\0');
  const int64_t on_disk = file.size_bytes - static_cast<int64_t>(file.tail.size());
  for (int64_t left = file.size_bytes - offset; left > 0 && *open;) {
    const int64_t at = file.size_bytes - left, end = at < on_disk ? on_disk : file.size_bytes;
    const auto n = static_cast<std::streamsize>(std::min<int64_t>(end - at, kChunkBytes));
    if (at >= on_disk) {
      file.tail.copy(chunk.data(), static_cast<size_t>(n), static_cast<size_t>(at - on_disk));
    } else if (!in.read(chunk.data(), n)) {
      return BadInput("FILE_CHANGED", file.path,
                      absl::StrCat(file.path,
                                   ": became shorter while it was sent; submit again when nothing "
                                   "writes to it"));
    }
    request.set_chunk(chunk.data(), static_cast<size_t>(n));
    *open = writer.Write(request);
    left -= n;
    *sent += n;
  }
  return absl::OkStatus();
}

// The files that go up in one stream, and what the server has of them.
class Batch {
 public:
  Batch(Client& client, const std::string& job, absl::Span<const LocalFile> files)
      : client_(client), job_(job), files_(files) {}

  // One try: asks what is missing and sends it. `*progressed` if it came further than the tries
  // before. On OK all files are stored.
  absl::Status Send(bool* progressed) {
    if (const absl::Status status = Query(); !status.ok()) return status;
    absl::Status status = Stream();
    *progressed = reached_ > furthest_;
    furthest_ = std::max(furthest_, reached_);
    return status;
  }

  const v1::UploadImagesResponse& response() const { return response_; }

 private:
  absl::Status Query() {
    v1::QueryUploadRequest request;
    request.set_name(job_);
    for (const LocalFile& file : files_) FillHeader(file, request.add_files());
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kQueryPatience);
    Interrupt::Scope scope(client_.interrupt(), context);
    status_.Clear();
    const absl::Status status =
        FromGrpc(client_.reconstruction().QueryUpload(&context, request, &status_));
    if (!status.ok()) return status;
    if (status_.files_size() != request.files_size()) {
      return LocalError(absl::StatusCode::kInternal, "UPLOAD_BROKEN", "files",
                        "the server did not answer for every file; this is a defect of it");
    }
    reached_ = 0;
    for (const v1::FileStatus& file : status_.files()) reached_ += file.offset();
    return absl::OkStatus();
  }

  absl::Status Stream() {
    grpc::ClientContext context;
    Interrupt::Scope scope(client_.interrupt(), context);
    response_.Clear();
    const auto writer = client_.reconstruction().UploadImages(&context, &response_);
    v1::UploadImagesRequest request;
    request.set_name(job_);
    bool open = writer->Write(request);
    int sent = 0;
    for (size_t i = 0; i < files_.size() && open; ++i) {
      const v1::FileStatus& there = status_.files(static_cast<int>(i));
      if (there.stored()) continue;
      FillHeader(files_[i], request.mutable_file());
      request.mutable_file()->set_offset(there.offset());
      open = writer->Write(request);
      ++sent;
      const absl::Status local = SendBytes(files_[i], there.offset(), *writer, &open, &reached_);
      if (!local.ok()) {
        context.TryCancel();
        (void)writer->Finish();
        return local;
      }
    }
    request.mutable_end()->set_files(sent);
    if (open) writer->Write(request);
    writer->WritesDone();  // whether this works shows in the status
    const absl::Status status = FromGrpc(writer->Finish());
    if (!status.ok() || response_.files_received() == sent) return status;
    return LocalError(absl::StatusCode::kInternal, "UPLOAD_BROKEN", "files",
                      absl::StrCat("the server has ", response_.files_received(), " of ", sent,
                                   " files that were sent; this is a defect of it"));
  }

  Client& client_;
  const std::string& job_;
  const absl::Span<const LocalFile> files_;
  v1::QueryUploadResponse status_;
  v1::UploadImagesResponse response_;
  int64_t reached_ = 0;    // bytes that the server had, and that were sent since
  int64_t furthest_ = -1;  // the most of them at any try
};

// A job cannot start with these if they are wrong; a photo is left out.
bool GoesFirst(const LocalFile& file) {
  return file.role == v1::FILE_ROLE_CAMERAS || file.role == v1::FILE_ROLE_COLMAP ||
         file.role == v1::FILE_ROLE_DEPTH;
}

// As the service has it: two do not make a scene.
constexpr int kMinPhotos = 3;

std::string StemOf(const std::string& name) { return name.substr(0, name.rfind('.')); }

// As the service has it (engine/core/mask.cc).
bool IsMaskOf(const std::string& photo, const std::string& mask) {
  const std::string whole = StemOf(mask);
  std::string without_word = whole;
  if (absl::EndsWithIgnoreCase(whole, "_mask") || absl::EndsWithIgnoreCase(whole, ".mask")) {
    without_word.resize(whole.size() - 5);
  }
  for (const std::string& name : {photo, StemOf(photo)}) {
    if (whole == name || without_word == name) return true;
  }
  return false;
}

bool IsPhoto(const LocalFile& file) { return file.role == v1::FILE_ROLE_PHOTO; }

// Photos of one stem share a mask.
std::vector<std::string> MasksOnlyOf(const std::string& photo,
                                     const std::vector<LocalFile>& files) {
  std::vector<std::string> masks;
  for (const LocalFile& mask : files) {
    if (mask.role != v1::FILE_ROLE_MASK || !IsMaskOf(photo, mask.name)) continue;
    const bool shared = std::any_of(files.begin(), files.end(), [&](const LocalFile& f) {
      return IsPhoto(f) && f.name != photo && IsMaskOf(f.name, mask.name);
    });
    if (!shared) masks.push_back(mask.name);
  }
  return masks;
}

// Takes a file out of `files`, a photo with the masks of no other, whose names it adds. The first
// progress->files_done of `files` are sent.
void LeaveOut(const LocalFile& bad, const absl::Status& why, std::vector<LocalFile>* files,
              UploadProgress* progress, std::vector<std::string>* masks) {
  const std::string name = bad.name;
  const v1::FileRole role = bad.role;
  const std::vector<std::string> gone =
      IsPhoto(bad) ? MasksOnlyOf(name, *files) : std::vector<std::string>();
  const std::string with = gone.empty() ? "" : absl::StrCat(", with ", absl::StrJoin(gone, ", "));
  progress->left_out.push_back(
      report::PrintableLine(absl::StrCat(name, " is left out", with, ": ", why.message())));
  masks->insert(masks->end(), gone.begin(), gone.end());
  const auto sent = static_cast<size_t>(progress->files_done);
  for (size_t i = files->size(); i-- > 0;) {
    const LocalFile& f = (*files)[i];
    const bool with_it =
        f.role == v1::FILE_ROLE_MASK && std::find(gone.begin(), gone.end(), f.name) != gone.end();
    if (!with_it && !(f.role == role && f.name == name)) continue;
    progress->bytes -= f.size_bytes;
    if (i < sent) {
      --progress->files_done;
      progress->bytes_done -= f.size_bytes;
    }
    files->erase(files->begin() + static_cast<ptrdiff_t>(i));
  }
  progress->files = static_cast<int>(files->size());
}

// Whether a job may do without this one of `files`, which has trouble: a mask or a depth map of a
// photo that is sent would be missed.
bool MayBeLeftOut(const LocalFile& bad, const std::vector<LocalFile>& files) {
  switch (bad.role) {
    case v1::FILE_ROLE_PHOTO:
      return std::count_if(files.begin(), files.end(), [](const LocalFile& f) {
               return IsPhoto(f) && f.trouble.ok();
             }) >= kMinPhotos;
    case v1::FILE_ROLE_MASK:  // cameras may say whose it is, but not by such a name
      return DetailOf(bad.trouble).reason() == "BAD_FILE_NAME";
    case v1::FILE_ROLE_DEPTH:  // named as masks are
      return std::none_of(files.begin(), files.end(), [&](const LocalFile& f) {
        return IsPhoto(f) && IsMaskOf(f.name, bad.name);
      });
    default:
      return false;
  }
}

// Those with trouble, photos first, whose masks go along.
absl::Status LeaveOutTroubled(bool strict, std::vector<LocalFile>* files,
                              UploadProgress* progress) {
  std::vector<std::string> masks;
  for (const bool photos : {true, false}) {
    for (;;) {
      const auto bad = std::find_if(files->begin(), files->end(), [&](const LocalFile& f) {
        return !f.trouble.ok() && IsPhoto(f) == photos;
      });
      if (bad == files->end()) break;
      if (strict || !MayBeLeftOut(*bad, *files)) return bad->trouble;
      LeaveOut(*bad, absl::Status(bad->trouble), files, progress, &masks);
    }
  }
  return absl::OkStatus();
}

// Leaves out the photo that `status` says the service does not take, if enough others remain.
bool LeaveOutRefused(const absl::Status& status, std::vector<LocalFile>* files,
                     UploadProgress* progress, std::vector<std::string>* masks) {
  if (status.ok()) return false;
  const v1::ErrorDetail detail = DetailOf(status);
  if (!detail.reason().starts_with("IMAGE_") && detail.reason() != "FILE_EMPTY" &&
      detail.reason() != "BAD_FILE_NAME") {
    return false;
  }
  const auto bad = std::find_if(files->begin(), files->end(), [&](const LocalFile& f) {
    return IsPhoto(f) && detail.field() == absl::StrCat("images[", f.name, "]");
  });
  if (bad == files->end()) return false;
  if (std::count_if(files->begin(), files->end(), IsPhoto) <= kMinPhotos) return false;
  LeaveOut(*bad, status, files, progress, masks);
  return true;
}

// Those that the server has: a job with a mask of no photo does not start.
absl::Status RemoveMasks(Client& client, const std::string& job,
                         const std::vector<std::string>& masks) {
  for (const std::string& mask : masks) {
    v1::DeleteFileRequest request;
    request.set_name(job);
    request.set_role(v1::FILE_ROLE_MASK);
    request.set_file_name(mask);
    request.set_allow_missing(true);
    if (const absl::Status status = client.DeleteFile(request); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<std::string>> ReadFiles(
    std::vector<LocalFile>& files, const Interrupt& interrupt,
    absl::FunctionRef<void(const LocalFile&)> on_file, bool strict) {
  UploadProgress progress;
  // At once, before what may be many gigabytes are read.
  absl::Status status = LeaveOutTroubled(strict, &files, &progress);
  if (!status.ok()) return status;
  for (LocalFile& file : files) {
    on_file(file);
    file.trouble = FillDigest(file, interrupt);
    if (absl::IsCancelled(file.trouble)) return file.trouble;
  }
  status = LeaveOutTroubled(strict, &files, &progress);
  if (!status.ok()) return status;
  return progress.left_out;
}

absl::Status UploadFiles(Client& client, const std::string& job, std::vector<LocalFile>& files,
                         absl::FunctionRef<void(const UploadProgress&)> on_progress, bool strict) {
  UploadProgress progress;
  progress.files = static_cast<int>(files.size());
  for (const LocalFile& file : files) progress.bytes += file.size_bytes;
  on_progress(progress);
  std::stable_partition(files.begin(), files.end(), GoesFirst);
  while (static_cast<size_t>(progress.files_done) < files.size()) {
    const auto first = static_cast<size_t>(progress.files_done);
    size_t last = first;
    int64_t bytes = 0;
    while (last < files.size() && last - first < kStreamFiles &&
           GoesFirst(files[last]) == GoesFirst(files[first]) &&
           (last == first || bytes + files[last].size_bytes <= kStreamBytes)) {
      bytes += files[last++].size_bytes;
    }
    Batch batch(client, job, absl::MakeConstSpan(files).subspan(first, last - first));
    for (size_t i = first; i < last; ++i) {
      const absl::Status status = FillDigest(files[i], client.interrupt());
      if (!status.ok()) return status;
    }
    const absl::Status status =
        client.Retry([&](bool* progressed) { return batch.Send(progressed); });
    std::vector<std::string> masks;
    if (!strict && LeaveOutRefused(status, &files, &progress, &masks)) {
      const absl::Status removed = RemoveMasks(client, job, masks);
      if (!removed.ok()) return removed;
      on_progress(progress);
      continue;
    }
    if (!status.ok()) return status;
    progress.files_done += static_cast<int>(last - first);
    progress.bytes_done += bytes;
    for (const std::string& name : batch.response().skipped()) progress.skipped.push_back(name);
    progress.skipped_total += static_cast<size_t>(
        std::max(batch.response().skipped_size(), batch.response().skipped_total()));
    on_progress(progress);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ContentDigest(std::vector<LocalFile>& files, const Interrupt& interrupt,
                                          absl::FunctionRef<void(const LocalFile&)> on_file) {
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(),
                                                                   EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  for (LocalFile& file : files) {
    on_file(file);
    if (const absl::Status status = FillDigest(file, interrupt); !status.ok()) return status;
    // Names that the service takes hold no line breaks, so that no two captures give the same text.
    const std::string line = absl::StrCat(static_cast<int>(file.role), "/", file.name, "\n");
    EVP_DigestUpdate(context.get(), line.data(), line.size());
    EVP_DigestUpdate(context.get(), file.sha256.data(), file.sha256.size());
  }
  std::string digest(32, '\0');
  EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(digest.data()), nullptr);
  return digest;
}

}  // namespace litags::client
