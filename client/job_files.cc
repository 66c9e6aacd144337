#include "client/job_files.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/report/text.h"

namespace litags::client {
namespace {

std::string RoleText(v1::FileRole role) {
  const auto* value = v1::FileRole_descriptor()->FindValueByNumber(role);
  return value == nullptr ? "unknown" : report::EnumWord(*value);  // unknown: of a later version
}

std::string SizeText(const v1::JobFile& file) {
  return file.width() > 0 ? absl::StrCat(file.width(), "x", file.height()) : "";
}

// "+0.3"; never "-0.0".
std::string StopsText(double stops) {
  const double tenths = std::round(10 * stops);
  return tenths == 0 ? "0.0" : absl::StrFormat("%+.1f", tenths / 10);
}

// "28 mm, 50 mm", or how many there are where that would be long.
std::string Distinct(const std::set<std::string>& texts, const std::string& what) {
  constexpr size_t kShown = 3;
  return texts.size() <= kShown ? absl::StrJoin(texts, ", ")
                                : absl::StrCat(texts.size(), " ", what);
}

// "A video of 640x480 px, 12s, 360 frames: its sharpest frames become photos".
std::string VideoText(const v1::JobFile& video) {
  std::vector<std::string> facts = {SizeText(video) + " px"};
  const v1::VideoFindings& found = video.found_in_video();
  if (found.has_duration()) {
    facts.push_back(report::DurationText(report::SecondsOf(found.duration())));
  }
  if (found.frames() > 0) facts.push_back(report::CountText(found.frames()) + " frames");
  return absl::StrCat("a video of ", absl::StrJoin(facts, ", "),
                      ": its sharpest frames become photos");
}

// What the summary says of all photos together.
struct PhotoFacts {
  int used = 0, left_out = 0;
  bool with_cameras = false;  // cameras are given
  std::set<std::string> sizes, lenses;
  double least_stops = std::numeric_limits<double>::infinity();
  double most_stops = -std::numeric_limits<double>::infinity();

  void Add(const v1::JobFile& photo) {
    const v1::PhotoFindings& found = photo.found();
    ++(found.left_out().empty() ? used : left_out);
    sizes.insert(SizeText(photo) + " px");
    if (found.focal_length_mm() > 0) {
      lenses.insert(absl::StrFormat("%.3g mm", found.focal_length_mm()));
    }
    if (!found.has_stops()) return;
    least_stops = std::min(least_stops, found.stops());
    most_stops = std::max(most_stops, found.stops());
  }

  // Without photos "".
  std::string Text() const {
    if (used + left_out == 0) return "";
    std::string text = absl::StrCat(report::Counted(used, "photo"), " would be used",
                                    !with_cameras ? ""
                                    : used == 1   ? " if it has a camera"
                                                  : " if they have a camera");
    if (left_out > 0)
      absl::StrAppend(&text, ", ", left_out, left_out == 1 ? " is" : " are", " left out");
    absl::StrAppend(&text, "; ", Distinct(sizes, "sizes"));
    if (!lenses.empty()) absl::StrAppend(&text, "; ", Distinct(lenses, "focal lengths"));
    if (least_stops > most_stops) return text;
    const std::string least = StopsText(least_stops), most = StopsText(most_stops);
    absl::StrAppend(&text, "; light: ", least == most ? least : absl::StrCat(least, " to ", most),
                    " stops from the middle photo");
    return text;
  }
};

}  // namespace

absl::StatusOr<std::vector<v1::JobFile>> ListAllFiles(Client& client, const std::string& job) {
  std::vector<v1::JobFile> files;
  v1::ListFilesRequest request;
  request.set_name(job);
  do {
    const auto page = client.ListFiles(request);
    if (!page.ok()) return page.status();
    files.insert(files.end(), page->files().begin(), page->files().end());
    request.set_page_token(page->next_page_token());
  } while (!request.page_token().empty());
  return files;
}

std::vector<std::string> DescribeFiles(const std::vector<v1::JobFile>& files) {
  PhotoFacts photos;
  std::vector<std::string> parts, left_out;
  int64_t masks = 0, depths = 0;
  for (const v1::JobFile& file : files) {
    if (file.role() == v1::FILE_ROLE_VIDEO) parts.push_back(VideoText(file));
    photos.with_cameras |=
        file.role() == v1::FILE_ROLE_CAMERAS || file.role() == v1::FILE_ROLE_COLMAP;
    masks += file.role() == v1::FILE_ROLE_MASK;
    depths += file.role() == v1::FILE_ROLE_DEPTH;
    if (file.role() != v1::FILE_ROLE_PHOTO) continue;
    photos.Add(file);
    if (file.found().left_out().empty()) continue;
    left_out.push_back(
        absl::StrCat("left out: ", file.file_name(), ": it ", file.found().left_out()));
  }
  if (std::string text = photos.Text(); !text.empty()) parts.insert(parts.begin(), text);
  if (masks > 0) parts.push_back(report::Counted(masks, "mask"));
  if (depths > 0) parts.push_back(report::Counted(depths, "depth map"));
  left_out.insert(left_out.begin(), absl::StrJoin(parts, "; "));
  return left_out;
}

std::string FileTable(const std::vector<v1::JobFile>& files) {
  constexpr char kLine[] = "%-8s %10s %11s %6s %6s %6s  %s%s\n";
  std::string text =
      absl::StrFormat(kLine, "ROLE", "BYTES", "PX", "CODE", "STOPS", "SHARP", "NAME", "");
  for (const v1::JobFile& file : files) {
    const v1::PhotoFindings& found = file.found();
    absl::StrAppendFormat(
        &text, kLine, RoleText(file.role()), report::BytesText(file.size_bytes()), SizeText(file),
        file.has_found() ? absl::StrFormat("%.1f", found.mean_code()) : "",
        found.has_stops() ? StopsText(found.stops()) : "",
        found.sharpness() > 0 ? absl::StrFormat("%.2f", found.sharpness()) : "",
        report::Printable(file.file_name()),
        found.left_out().empty() ? "" : absl::StrCat("  (left out: it ", found.left_out(), ")"));
  }
  const bool measured = std::any_of(files.begin(), files.end(),
                                    [](const v1::JobFile& file) { return file.has_found(); });
  if (measured) {
    absl::StrAppend(&text,
                    "CODE: mean pixel value of 255; STOPS: light beside the middle photo, +1 is "
                    "twice; SHARP: sharpness beside the middle photo\n");
  }
  return text;
}

}  // namespace litags::client
