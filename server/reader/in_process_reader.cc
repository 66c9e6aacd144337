#include <utility>

#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "server/reader/content.h"
#include "server/reader/file_reader.h"

namespace litags {
namespace {

class InProcessReader : public FileReader {
 public:
  absl::Status Check(const std::string& path, const std::string& field, FileRecord* file,
                     const CancelToken&) override {
    LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, file->size_bytes));
    LITAGS_ASSIGN_OR_RETURN(Content content, CheckContent(bytes, file->role, file->name, field));
    file->width = content.width;
    file->height = content.height;
    file->about = std::move(content.about);
    return absl::OkStatus();
  }

  absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const std::string& path,
                                                             const ArchiveLimits& limits,
                                                             const std::string& field,
                                                             ArchiveSink* sink,
                                                             const CancelToken& cancel) override {
    return ArchiveReader::Open(path, limits, field, sink, cancel);
  }
};

}  // namespace

std::unique_ptr<FileReader> MakeInProcessReader() { return std::make_unique<InProcessReader>(); }

}  // namespace litags
