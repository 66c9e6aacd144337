#include "engine/io/colmap_text.h"

#include <charconv>
#include <cstdint>
#include <cstring>
#include <system_error>
#include <utility>

#include "engine/core/utf8.h"
#include "engine/io/byte_reader.h"
#include "engine/io/colmap_models.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

// Lines of a file, trimmed, and where they stand.
class LineReader {
 public:
  LineReader(std::string_view text, std::string field)
      : rest_(WithoutByteOrderMark(text)), field_(std::move(field)) {}

  size_t size() const { return rest_.size(); }

  // The next line without going to it; empty at the end.
  std::string_view Peek() const { return Trimmed(rest_.substr(0, rest_.find('\n'))); }

  // The next line, whatever is in it; false at the end.
  bool Next(std::string_view* line) {
    if (rest_.empty()) return false;
    const size_t end = rest_.find('\n');
    *line = Trimmed(rest_.substr(0, end));
    rest_ = end == std::string_view::npos ? "" : rest_.substr(end + 1);
    ++number_;
    return true;
  }
  // The next line that is neither empty nor a comment.
  bool NextRecord(std::string_view* line) {
    while (Next(line)) {
      if (!line->empty() && line->front() != '#') return true;
    }
    return false;
  }

  absl::Status Corrupt(std::string_view what) const {
    return InvalidField(
        "MODEL_CORRUPT", field_,
        absl::StrCat("line ", number_, ": ", Absl(what), "; export the model again"));
  }

 private:
  std::string_view rest_;
  const std::string field_;
  int64_t number_ = 0;
};

// The words of a line, one after the other.
class Words {
 public:
  explicit Words(std::string_view line) : rest_(line) {}

  std::string_view rest() const { return rest_; }

  // False at the end of the line.
  bool Next(std::string_view* word) {
    if (rest_.empty()) return false;
    size_t end = 0;
    while (end < rest_.size() && !IsBlank(rest_[end])) ++end;
    *word = rest_.substr(0, end);
    rest_ = Trimmed(rest_.substr(end));
    return true;
  }

  // False if the next word is not such a number.
  template <typename T>
  bool Read(T* value) {
    std::string_view word;
    if (!Next(&word)) return false;
    const char* end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, *value);
    return error == std::errc() && stop == end;
  }

  // Appends numbers of this type as they stand in a binary model.
  template <typename T>
  bool Copy(int count, std::string* out) {
    for (int i = 0; i < count; ++i) {
      T value{};
      if (!Read(&value)) return false;
      AppendNumber(out, value);
    }
    return true;
  }

 private:
  std::string_view rest_;
};

// What the count stands in front of, and room for records that are as long as their text.
std::string NoRecords(const LineReader& lines) {
  std::string out;
  out.reserve(sizeof(uint64_t) + lines.size());
  AppendNumber(&out, uint64_t{0});
  return out;
}

std::string Counted(uint64_t count, std::string records) {
  std::memcpy(records.data(), &count, sizeof(count));
  return records;
}

absl::StatusOr<std::string> Cameras(LineReader lines) {
  std::string records = NoRecords(lines);
  uint64_t count = 0;
  for (std::string_view line; lines.NextRecord(&line); ++count) {
    Words words(line);
    uint32_t id = 0;
    std::string_view name;
    if (!words.Read(&id) || !words.Next(&name)) return lines.Corrupt("not a camera");
    const ColmapModelInfo* model = FindColmapModel(name);
    if (!model) {
      const absl::Status status = lines.Corrupt(
          "its camera model is not known; undistort the photos (colmap image_undistorter), or "
          "choose OPENCV, FULL_OPENCV or OPENCV_FISHEYE");
      return InvalidInput("UNSUPPORTED_CAMERA_MODEL", GetErrorDetail(status)->field,
                          std::string(status.message()));
    }
    AppendNumber(&records, id);
    AppendNumber(&records, int32_t{model->number});
    if (!words.Copy<uint64_t>(2, &records) || !words.Copy<double>(model->params, &records) ||
        !words.rest().empty()) {
      return lines.Corrupt("a camera has its number, model, size and parameters");
    }
  }
  return Counted(count, std::move(records));
}

// Number, rotation, translation, camera, name. Observations are threes of numbers.
bool IsImage(std::string_view line) {
  Words words(line);
  std::string ignored;
  if (!words.Copy<uint32_t>(1, &ignored) || !words.Copy<double>(7, &ignored) ||
      !words.Copy<uint32_t>(1, &ignored) || words.rest().empty()) {
    return false;
  }
  int more = 0;
  bool numbers = true;
  for (double number = 0; !words.rest().empty(); ++more) numbers = words.Read(&number) && numbers;
  return !numbers || more % 3 != 0;
}

absl::StatusOr<std::string> Images(LineReader lines) {
  std::string records = NoRecords(lines);
  uint64_t count = 0;
  for (std::string_view line; lines.NextRecord(&line); ++count) {
    Words words(line);
    if (!words.Copy<uint32_t>(1, &records) || !words.Copy<double>(7, &records) ||
        !words.Copy<uint32_t>(1, &records) || words.rest().empty() ||
        words.rest().find('\0') != std::string_view::npos) {
      return lines.Corrupt("an image has its number, rotation, translation, camera and name");
    }
    records.append(words.rest()).push_back('\0');
    // The line that follows, empty or not, has the observations; some exporters leave it out.
    std::string observations;
    uint64_t observed = 0;
    if (IsImage(lines.Peek()) || !lines.Next(&line)) line = "";
    for (Words seen(line); !seen.rest().empty(); ++observed) {
      if (!seen.Copy<double>(2, &observations) || !seen.Copy<int64_t>(1, &observations)) {
        return lines.Corrupt("an observation has x, y and the number of a point, or -1");
      }
    }
    AppendNumber(&records, observed);
    records.append(observations);
  }
  return Counted(count, std::move(records));
}

absl::StatusOr<std::string> Points(LineReader lines) {
  std::string records = NoRecords(lines);
  uint64_t count = 0;
  for (std::string_view line; lines.NextRecord(&line); ++count) {
    Words words(line);
    if (!words.Copy<uint64_t>(1, &records) || !words.Copy<double>(3, &records) ||
        !words.Copy<uint8_t>(3, &records) || !words.Copy<double>(1, &records)) {
      return lines.Corrupt("a point has its number, place, colour and error");
    }
    std::string track;
    uint64_t length = 0;
    for (; !words.rest().empty(); ++length) {
      if (!words.Copy<uint32_t>(2, &track)) {
        return lines.Corrupt("a track is made of numbers of an image and of its observation");
      }
    }
    AppendNumber(&records, length);
    records.append(track);
  }
  return Counted(count, std::move(records));
}

}  // namespace

absl::StatusOr<std::string> BinaryFromText(ColmapPart part, std::string_view text,
                                           std::string_view field) {
  const LineReader lines(text, std::string(field));
  if (part == ColmapPart::kCameras) return Cameras(lines);
  return part == ColmapPart::kImages ? Images(lines) : Points(lines);
}

}  // namespace litags
