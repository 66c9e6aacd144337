#include "engine/io/bundler_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <set>
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
  std::array<double, 2> reach = {};  // farthest that points are seen from the middle, px
};

// Reads one point: only where the cameras see it. False if it is not all there.
bool ReadPoint(NumberReader* numbers, std::vector<BundleCamera>* cameras) {
  std::array<double, 7> point = {};  // place, colour, sightings
  if (!numbers->Read(point)) return false;
  for (double i = 0; i < point[6]; ++i) {
    std::array<double, 4> sighting = {};  // camera, feature, x and y from the middle
    if (!numbers->Read(sighting)) return false;
    if (!(sighting[0] >= 0 && sighting[0] < cameras->size())) continue;
    std::array<double, 2>& reach = (*cameras)[static_cast<size_t>(sighting[0])].reach;
    for (int k = 0; k < 2; ++k) reach[k] = std::max(reach[k], std::abs(sighting[2 + k]));
  }
  return true;
}

// Whether a photo of this size can show points that far from its middle.
bool Shows(const PhotoSize& size, const std::array<double, 2>& reach) {
  constexpr double kMargin = 0.02;  // of the side: middles of lenses lie beside the photos'
  return reach[0] <= (0.5 + kMargin) * size.width + 1 &&
         reach[1] <= (0.5 + kMargin) * size.height + 1;
}

// The size of the photo that the camera is of, which the file does not say: `upright`, or that
// turned by 90 degrees if only that one shows the points. `is_sure`: only one of them does.
absl::StatusOr<PhotoSize> SizeOf(const BundleCamera& camera, const PhotoSize& upright,
                                 std::string_view where, bool* is_sure) {
  const PhotoSize turned{upright.height, upright.width};
  const bool shows = Shows(upright, camera.reach), shows_turned = Shows(turned, camera.reach);
  *is_sure = shows != shows_turned;
  if (shows) return upright;
  if (shows_turned) return turned;
  return InvalidField(
      "CAMERA_SIZE_MISMATCH", where,
      absl::StrCat("it sees points up to ", camera.reach[0], " and ", camera.reach[1],
                   " px from the middle of a photo of ", upright.width, "x", upright.height,
                   "; give the photos that it was made with, at their size"));
}

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
                                  std::string_view where, const PhotoSize& size) {
  LoadedView loaded;
  loaded.view.name = name;
  Camera* camera = &loaded.view.camera;
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
                                         const PhotoSizes& sizes, std::set<std::string>* sure) {
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
    if (!ReadPoint(&numbers, &cameras)) return bad("points are missing");
  }
  std::vector<std::string> names = ReadList(numbers.rest());
  // The list may stand at the file's end and beside it.
  const size_t half = names.size() / 2;
  if (half == cameras.size() && names.size() == 2 * half &&
      std::equal(names.begin(), names.begin() + static_cast<ptrdiff_t>(half),
                 names.begin() + static_cast<ptrdiff_t>(half))) {
    names.resize(half);
  }
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
    bool is_sure = false;
    LITAGS_ASSIGN_OR_RETURN(const PhotoSize size,
                            SizeOf(cameras[i], sizes(names[i]), where, &is_sure));
    if (is_sure && sure != nullptr) sure->insert(names[i]);
    LITAGS_ASSIGN_OR_RETURN(LoadedView view, ToView(cameras[i], names[i], where, size));
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
  const fs::path dir = fs::absolute(path, ignored).parent_path();
  const auto lists = ListFiles(
      dir, "", [](const std::string& name) { return fs::path(name).extension() == ".lst"; });
  return lists.ok() && lists->size() == 1 ? dir / lists->front() : fs::path();
}

}  // namespace litags
