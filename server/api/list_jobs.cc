#include "server/api/list_jobs.h"

#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/types/span.h"
#include "engine/core/error.h"
#include "server/api/convert.h"
#include "server/api/findings.h"
#include "server/api/job_filter.h"
#include "server/api/list_page.h"
#include "server/api/status.h"
#include "server/jobs/queue_position.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr int kDefaultJobs = 50, kMaxJobs = 1000;
constexpr int kDefaultFiles = 1000, kMaxFiles = 10000;
constexpr int kJobsPerRead = 200;
// Jobs that one call looks at. A filter that lets few through gives short pages then.
constexpr int kMaxLookedAt = 5000;

absl::StatusOr<ListOrder> ParseOrder(const std::string& text) {
  if (text.empty() || text == "create_time desc") return ListOrder::kNewestFirst;
  if (text == "create_time") return ListOrder::kOldestFirst;
  return InvalidInput("ORDER_INVALID", "order_by",
                      "order_by must be \"create_time desc\", \"create_time\" or empty");
}

// Where a page of jobs starts: after the job of this time and id, of a list of this kind.
struct JobPlace {
  int64_t time_ms = 0;
  std::string id;
};

std::string KindOf(const v1::ListJobsRequest& request) {
  return Sha256::Hex(absl::StrCat(request.order_by(), "\n", request.filter())).substr(0, 8);
}

std::string PageToken(const JobPlace& place, const std::string& kind) {
  return absl::StrCat(place.time_ms, "-", place.id, "-", kind);
}

absl::StatusOr<JobPlace> ParsePageToken(const std::string& token, const std::string& kind) {
  JobPlace place;
  if (token.empty()) return place;
  const std::vector<std::string> parts = absl::StrSplit(token, '-');
  if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &place.time_ms) || place.time_ms <= 0 ||
      !std::all_of(parts[1].begin(), parts[1].end(), absl::ascii_isalnum) || parts[2] != kind) {
    return BadPageToken("ListJobs");
  }
  place.id = parts[1];
  return place;
}

// What of queued jobs depends on the others.
struct JobSurroundings {
  Workforce workers;
  std::map<std::string, int> queue_positions;
};

// Read once for all jobs of an answer, and only if one of them is queued.
absl::StatusOr<JobSurroundings> SurroundingsOf(Jobs& jobs, absl::Span<const JobRecord> shown) {
  JobSurroundings around;
  const bool queued = std::any_of(shown.begin(), shown.end(), [](const JobRecord& job) {
    return job.state == JobState::kQueued;
  });
  if (!queued) return around;
  LITAGS_ASSIGN_OR_RETURN(around.workers, jobs.Workers());
  LITAGS_ASSIGN_OR_RETURN(const JobQueue queue, jobs.Queue());
  around.queue_positions = QueuePositions(queue);
  return around;
}

void AddSurroundings(const JobRecord& job, const JobSurroundings& around, v1::Job* response) {
  if (job.state != JobState::kQueued) return;
  response->set_waits_for(WaitsFor(job, around.workers));
  const auto position = around.queue_positions.find(job.id);
  // Not there: a worker took it since it was read.
  if (position != around.queue_positions.end()) response->set_queue_position(position->second);
}

// A page of files starts after this one.
std::string PageToken(const FileRecord& file) {
  return absl::StrCat(static_cast<int>(file.role), "-", absl::BytesToHexString(file.name));
}

}  // namespace

absl::Status Answer(Jobs& jobs, const absl::StatusOr<JobRecord>& job, v1::Job* response) {
  LITAGS_RETURN_IF_ERROR(job.status());
  LITAGS_ASSIGN_OR_RETURN(*response, JobToProto(*job));
  // The call has done what it is for, whether or not the store still answers.
  const auto around = SurroundingsOf(jobs, {&*job, 1});
  if (around.ok()) AddSurroundings(*job, *around, response);
  return absl::OkStatus();
}

absl::Status ListJobs(Jobs& jobs, const v1::ListJobsRequest& request,
                      v1::ListJobsResponse* response) {
  LITAGS_ASSIGN_OR_RETURN(PageRoom room,
                          PageRoom::Make(request.page_size(), kDefaultJobs, kMaxJobs));
  LITAGS_ASSIGN_OR_RETURN(const ListOrder order, ParseOrder(request.order_by()));
  LITAGS_ASSIGN_OR_RETURN(const JobFilter filter, ParseJobFilter(request.filter()));
  const std::string kind = KindOf(request);
  LITAGS_ASSIGN_OR_RETURN(JobPlace place, ParsePageToken(request.page_token(), kind));
  std::vector<JobRecord> page;
  for (int looked_at = 0;;) {
    const int wanted = std::min(kJobsPerRead, room.size() + 1);  // one more tells of a next page
    LITAGS_ASSIGN_OR_RETURN(std::vector<JobRecord> some,
                            jobs.List(place.time_ms, place.id, wanted, order));
    bool full = false;
    for (JobRecord& job : some) {
      v1::Job shown;
      const bool is_shown = filter(job);
      if (is_shown) {
        LITAGS_ASSIGN_OR_RETURN(shown, JobToProto(job));
        full = !room.Takes(shown.ByteSizeLong());
        if (full) break;
      }
      place = {job.create_time_ms, job.id};
      if (!is_shown) continue;
      *response->add_jobs() = std::move(shown);
      page.push_back(std::move(job));
    }
    looked_at += static_cast<int>(some.size());
    const bool last = !full && some.size() < static_cast<size_t>(wanted);
    if (last) break;
    if (full || looked_at >= kMaxLookedAt) {
      response->set_next_page_token(PageToken(place, kind));
      break;
    }
  }
  LITAGS_ASSIGN_OR_RETURN(const JobSurroundings around, SurroundingsOf(jobs, page));
  for (size_t i = 0; i < page.size(); ++i) {
    AddSurroundings(page[i], around, response->mutable_jobs(static_cast<int>(i)));
  }
  return absl::OkStatus();
}

absl::Status ListFiles(Jobs& jobs, const v1::ListFilesRequest& request,
                       v1::ListFilesResponse* response) {
  LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request.name()));
  LITAGS_ASSIGN_OR_RETURN(PageRoom room,
                          PageRoom::Make(request.page_size(), kDefaultFiles, kMaxFiles));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, jobs.Files(id));
  auto file = files.begin();
  if (!request.page_token().empty()) {
    const std::vector<std::string> parts = absl::StrSplit(request.page_token(), '-');
    int role = 0;
    if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &role) || parts[1].size() % 2 != 0 ||
        !std::all_of(parts[1].begin(), parts[1].end(), absl::ascii_isxdigit)) {
      return BadPageToken("ListFiles");
    }
    const std::pair<int, std::string> last{role, absl::HexStringToBytes(parts[1])};
    file = std::find_if(files.begin(), files.end(), [&](const FileRecord& f) {
      return std::pair<int, std::string>(static_cast<int>(f.role), f.name) > last;
    });
  }
  std::map<std::string, v1::PhotoFindings> findings = FindingsOf(files);
  for (; file != files.end(); ++file) {
    v1::JobFile proto;
    proto.set_file_name(file->name);
    proto.set_role(static_cast<v1::FileRole>(file->role));
    proto.set_size_bytes(file->size_bytes);
    proto.set_sha256(absl::HexStringToBytes(file->sha256));
    proto.set_width(file->width);
    proto.set_height(file->height);
    const auto found = findings.find(file->name);
    if (file->role == FileRole::kPhoto && found != findings.end()) {
      *proto.mutable_found() = std::move(found->second);
    }
    if (const auto video = FoundInVideo(*file)) *proto.mutable_found_in_video() = *video;
    if (!room.Takes(proto.ByteSizeLong())) {
      response->set_next_page_token(PageToken(*std::prev(file)));
      break;
    }
    *response->add_files() = std::move(proto);
  }
  return absl::OkStatus();
}

}  // namespace litags
