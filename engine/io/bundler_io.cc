#include "engine/io/bundler_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "engine/core/counted.h"
#include "engine/core/utf8.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFirstLine = "# Bundle file";
constexpr double kMostCameras = 1e6, kMostPoints = 1e9;  // of a file of 16 MiB there are fewer

// Numbers with blanks and line breaks between them.
class NumberReader {
 public:
  explicit NumberReader(std::string_view text) : rest_(text) {}

  // Whether as many were there, all finite.
  bool Read(std::span<double> out) {
    for (double& value : out) {
      const std::string_view word = Word();
      if (!absl::SimpleAtod(Absl(word), &value) || !std::isfinite(value)) return false;
    }
    return true;
  }
  bool Skip(double count) {
    for (; count > 0; --count) {
      if (Word().empty()) return false;
    }
    return true;
  }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view Word() {
    constexpr std::string_view kBlank = " \t\r\n";
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlank), rest_.size()));
    const std::string_view word = rest_.substr(0, rest_.find_first_of(kBlank));
    rest_.remove_prefix(word.size());
    return word;
  }

  std::string_view rest_;
};

struct BundleCamera {
  std::array<double, 3> lens;  // focal length, px; k1, k2
  std::array<double, 9> R;     // x right, y up, z towards the viewer
  std::array<double, 3> t;
};

// The photos' names, in the order of the cameras. A line of Bundler's own has two numbers more.
std::vector<std::string> ReadList(std::string_view text) {
  std::vector<std::string> names;
  for (absl::string_view line : absl::StrSplit(Absl(text), '\n')) {
    line = absl::StripAsciiWhitespace(line);
    if (line.empty()) continue;
    const std::vector<absl::string_view> words = absl::StrSplit(line, ' ');
    double focal_length = 0;
    if (words.size() >= 3 && words[words.size() - 2] == "0" &&
        absl::SimpleAtod(words.back(), &focal_length)) {
      line.remove_suffix(words.back().size() + 3);
    }
    names.emplace_back(line.data(), line.size());
  }
  return names;
}

absl::StatusOr<LoadedView> ToView(const BundleCamera& from, const std::string& name,
                                  std::string_view where, const PhotoSizes& sizes) {
  LoadedView loaded;
  loaded.view.name = name;
  Camera* camera = &loaded.view.camera;
  const PhotoSize size = sizes(name);
  LITAGS_RETURN_IF_ERROR(SetSize(size.width, size.height, where, camera));
  camera->fx = camera->fy = from.lens[0];
  camera->cx = 0.5 * size.width;
  camera->cy = 0.5 * size.height;
  loaded.distortion = {.k1 = from.lens[1], .k2 = from.lens[2]};
  // To our axes, then the centre, -R^T t.
  std::array<double, 9> R;
  std::array<double, 3> center = {};
  for (int r = 0; r < 3; ++r) {
    const double sign = r == 0 ? 1 : -1;
    for (int c = 0; c < 3; ++c) {
      R[3 * r + c] = sign * from.R[3 * r + c];
      center[c] -= from.R[3 * r + c] * from.t[r];
    }
  }
  LITAGS_RETURN_IF_ERROR(SetPlace(R, center, where, camera));
  return loaded;
}

}  // namespace

bool IsBundler(std::string_view text) { return WithoutByteOrderMark(text).starts_with(kFirstLine); }

absl::StatusOr<SparseModel> ParseBundler(std::string_view text, std::string_view field,
                                         const PhotoSizes& sizes) {
  const auto bad = [&](std::string_view what) {
    return InvalidField("BAD_BUNDLE", field,
                        absl::StrCat("it is no whole bundle.out: ", Absl(what)));
  };
  text = WithoutByteOrderMark(text);
  NumberReader numbers(text.substr(std::min(text.find('\n'), text.size())));
  std::array<double, 2> counts = {};  // of cameras and points
  if (!numbers.Read(counts) || !(counts[0] >= 0 && counts[0] <= kMostCameras) ||
      !(counts[1] >= 0 && counts[1] <= kMostPoints)) {
    return bad("its second line does not have the numbers of cameras and points");
  }
  std::vector<BundleCamera> cameras;
  while (cameras.size() < counts[0]) {
    BundleCamera camera;
    if (!numbers.Read(camera.lens) || !numbers.Read(camera.R) || !numbers.Read(camera.t)) {
      return bad(absl::StrCat("camera ", cameras.size(), " does not have 15 finite numbers"));
    }
    cameras.push_back(camera);
  }
  for (double i = 0; i < counts[1]; ++i) {
    std::array<double, 7> point = {};  // place, colour, sightings
    if (!numbers.Read(point) || !numbers.Skip(4 * point[6])) return bad("points are missing");
  }
  const std::vector<std::string> names = ReadList(numbers.rest());
  if (names.size() != cameras.size()) {
    return InvalidField(
        "BAD_BUNDLE", field,
        absl::StrCat("it has ", Counted(cameras.size(), "camera"), " and ",
                     Counted(names.size(), "name"),
                     " of photos behind them; append the list of photos that was written "
                     "with it: cat bundle.out list.txt > cameras.out"));
  }
  std::vector<LoadedView> views;
  for (size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].lens[0] == 0) continue;
    const std::string where = absl::StrCat(Absl(field), "[", names[i], "]");
    LITAGS_ASSIGN_OR_RETURN(LoadedView view, ToView(cameras[i], names[i], where, sizes));
    views.push_back(std::move(view));
  }
  if (views.empty()) return InvalidField("NO_CAMERAS", field, "none of its cameras was placed");
  return FinishModel(std::move(views), field, nullptr);
}

std::string BundlerListOf(const std::string& path) {
  absl::string_view stem = path;
  if (!absl::ConsumeSuffix(&stem, ".bundle.out")) absl::ConsumeSuffix(&stem, ".out");
  std::error_code ignored;
  for (const fs::path& list :
       {fs::path(absl::StrCat(stem, ".list.txt")), fs::path(path).parent_path() / "list.txt"}) {
    if (fs::is_regular_file(list, ignored)) return list;
  }
  std::vector<std::string> lists;
  for (const auto& entry : fs::directory_iterator(fs::absolute(path).parent_path(), ignored)) {
    if (entry.path().extension() == ".lst") lists.push_back(entry.path());
  }
  return lists.size() == 1 ? lists[0] : "";
}

}  // namespace litags
