// What happens in the process of one cell.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/tools/evaluation/evaluation.h"
#include "engine/tools/evaluation/process_usage.h"
#include "engine/tools/evaluation/progress_lines.h"
#include "engine/tools/table/cell.h"
#include "engine/tools/table/path_flicker.h"
#include "engine/tools/table/table.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kErrorGain = 4;  // of error pictures: a difference of a quarter is white

// Enhances the training photos into `out`/<PictureStems>.png. Their masks, those of alpha channels
// and bars too, go into `out`/masks. Returns the seconds that it took, but for finding these.
absl::StatusOr<double> EnhancePhotos(const TableCell& cell, const std::string& out) {
  LITAGS_ASSIGN_OR_RETURN(const Enhancer enhancer, cell.MakeEnhancer(cell.method().before));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> photos,
                          cell.scene().TrainingPhotos(cell.photos_light()));
  ReconstructInput input;
  input.images_dir = cell.scene().PhotosDir(cell.photos_light());
  input.masks_dir = cell.MasksDir();
  input.work_dir = out;
  LITAGS_ASSIGN_OR_RETURN(
      const PhotoScreen screen,
      ScreenPhotos(CutInput(input), cell.method().options.threads, CancelToken()));
  const double start = MonotonicSeconds();
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(out + "/masks", ignored);
  std::vector<std::string> names = screen.Names();
  std::erase_if(names, [&](const std::string& name) {
    return !std::binary_search(photos.begin(), photos.end(), name);
  });
  const std::vector<std::string> stems = PictureStems(names);
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string& photo = names[i];
    LITAGS_ASSIGN_OR_RETURN(
        const ImageU8 image,
        ReadImage(absl::StrCat(input.images_dir, "/", photo), absl::StrCat("images[", photo, "]")));
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 enhanced, enhancer.run(image));
    const std::string file = stems[i] + ".png";
    LITAGS_RETURN_IF_ERROR(WritePng(absl::StrCat(out, "/", file), enhanced));
    const auto mask = screen.masks.find(photo);
    if (mask == screen.masks.end()) continue;
    LITAGS_ASSIGN_OR_RETURN(const std::string png,
                            ReadFile(mask->second, mask->second, ImageLimits().max_bytes));
    LITAGS_RETURN_IF_ERROR(WriteFileAtomically(absl::StrCat(out, "/masks/", file), png));
  }
  return MonotonicSeconds() - start;
}

// The cell's scene, trained now or by an earlier run; returns its cost.
absl::StatusOr<TableRow> Train(const TableCell& cell, Engine* engine) {
  LITAGS_ASSIGN_OR_RETURN(const std::string key, cell.TrainingKey());
  const std::string dir = cell.TrainingDir(), kept = dir + "/training.json";
  std::error_code ignored;  // writing reports what matters
  if (const auto row = KeptRow(kept, key);
      row.has_value() && fs::exists(dir + "/scene.litags", ignored)) {
    return *row;
  }
  // From the beginning, without what an earlier run kept: the seconds are those of the whole run.
  for (const char* old : {"training.json", "scene.litags", "checkpoint.litags", "depth.litags",
                          "start.litags", "enhanced"}) {
    fs::remove_all(dir + "/" + old, ignored);
  }
  fs::create_directories(dir, ignored);

  TableRow cost = cell.EmptyRow();
  cost.method = cell.method().trained_as;
  ReconstructInput input;
  input.images_dir = cell.scene().PhotosDir(cell.photos_light());
  input.cameras_path = cell.CamerasDir() + "/cameras";
  input.masks_dir = cell.MasksDir();
  input.work_dir = dir;
  if (!cell.method().before.empty()) {
    input.images_dir = dir + "/enhanced";
    LITAGS_ASSIGN_OR_RETURN(cost.enhance_seconds, EnhancePhotos(cell, input.images_dir));
    const std::string masks = input.images_dir + "/masks";
    input.masks_dir = fs::is_empty(masks, ignored) ? "" : masks;
  }
  ReconstructOptions method = cell.method().options;
  method.holdout_every = 0;  // the test views are left out already
  method.preview_every = method.checkpoint_every = method.iterations;
  ProgressLines observer;
  const double cpu_start = CpuSeconds();
  LITAGS_ASSIGN_OR_RETURN(const ReconstructReport report,
                          engine->Reconstruct(input, method, CancelToken(), &observer));
  cost.cpu_seconds = CpuSeconds() - cpu_start;
  cost.seconds = report.training_seconds;
  cost.iterations = report.iterations;
  cost.gaussians = report.gaussians;
  cost.peak_rss_bytes = PeakRssBytes();
  for (const std::string& note : report.notes) std::printf("note: %s\n", note.c_str());
  LITAGS_RETURN_IF_ERROR(KeepRow(kept, key, cost));
  return cost;
}

// The size of |picture - truth| per channel, times kErrorGain.
ImageU8 ErrorPicture(const ImageU8& picture, const ImageU8& truth) {
  ImageU8 error = picture;
  for (size_t i = 0; i < error.data.size(); ++i) {
    const int difference = std::abs(int{picture.data[i]} - int{truth.data[i]});
    error.data[i] = static_cast<uint8_t>(std::min(255, kErrorGain * difference));
  }
  return error;
}

// What is judged: the scene's renders of the test views, enhanced if the method says so.
absl::StatusOr<std::vector<ImageU8>> Pictures(const TableCell& cell, const Scene& scene,
                                              const std::vector<TestView>& views,
                                              double* enhance_seconds) {
  std::vector<ImageU8> pictures;
  for (const TestView& view : views) {
    LITAGS_ASSIGN_OR_RETURN(ImageU8 picture,
                            RenderPicture(scene, view.view, cell.method().options.threads));
    pictures.push_back(std::move(picture));
  }
  if (cell.method().after.empty()) return pictures;
  LITAGS_ASSIGN_OR_RETURN(const Enhancer enhancer, cell.MakeEnhancer(cell.method().after));
  const double start = MonotonicSeconds();
  for (ImageU8& picture : pictures) {
    LITAGS_ASSIGN_OR_RETURN(picture, enhancer.run(picture));
  }
  *enhance_seconds += MonotonicSeconds() - start;
  return pictures;
}

absl::Status WritePictures(const TableCell& cell, const std::vector<TestView>& views,
                           const std::vector<ImageU8>& pictures) {
  std::error_code ignored;  // writing reports what matters
  fs::create_directories(cell.RunDir() + "/test", ignored);
  fs::create_directories(cell.RunDir() + "/error", ignored);
  const std::vector<std::string> stems = PictureStems(NamesOf(views));
  for (size_t i = 0; i < views.size(); ++i) {
    const std::string file = stems[i] + ".png";
    LITAGS_RETURN_IF_ERROR(WritePng(cell.RunDir() + "/test/" + file, pictures[i]));
    const absl::StatusOr<ImageU8> truth = LoadPicture(cell.scene().TruthDir(), views[i]);
    if (absl::IsNotFound(truth.status())) continue;
    LITAGS_RETURN_IF_ERROR(truth.status());
    LITAGS_RETURN_IF_ERROR(
        WritePng(cell.RunDir() + "/error/" + file, ErrorPicture(pictures[i], *truth)));
  }
  return absl::OkStatus();
}

absl::Status AddFlicker(const TableCell& cell, const Scene& scene, int frames, TableRow* row) {
  std::optional<Enhancer> after;
  if (!cell.method().after.empty()) {
    LITAGS_ASSIGN_OR_RETURN(after, cell.MakeEnhancer(cell.method().after));
  }
  LITAGS_ASSIGN_OR_RETURN(const PathFlicker path,
                          MeasurePathFlicker(scene, frames, after.has_value() ? &*after : nullptr,
                                             cell.method().options.threads));
  row->flicker = path.steps.Mean();
  row->flicker_share = path.steps.Share();
  row->path_contrast = path.contrast;
  return absl::OkStatus();
}

// Adds to the row how near the pictures come to the truth photos; nothing without any.
absl::Status AddScores(const TableCell& cell, const std::string& lpips_path,
                       const std::vector<TestView>& views, const std::vector<ImageU8>& pictures,
                       TableRow* row) {
  std::optional<Lpips> lpips;
  if (!lpips_path.empty()) {
    LITAGS_ASSIGN_OR_RETURN(lpips, Lpips::Load(lpips_path));
  }
  Scorer scorer(cell.scene().TruthDir(), lpips.has_value() ? &*lpips : nullptr);
  for (size_t i = 0; i < views.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(scorer.Add(views[i], pictures[i]));
  }
  const absl::StatusOr<Scores> scores = scorer.Finish();
  if (absl::IsNotFound(scores.status())) return absl::OkStatus();
  LITAGS_RETURN_IF_ERROR(scores.status());
  row->psnr = scores->psnr;
  if (!std::isnan(scores->ssim)) row->ssim = scores->ssim;
  row->lpips = scores->lpips;
  row->psnr_affine = scores->psnr_affine;
  row->views = static_cast<int>(scores->views.size());
  return WriteFileAtomically(cell.RunDir() + "/scores.json", scores->ToJson() + "\n");
}

absl::StatusOr<TableRow> TrainAndScore(const TableOptions& options, const TableCell& cell) {
  const std::unique_ptr<Engine> engine = MakeEngine(options.colmap);
  LITAGS_ASSIGN_OR_RETURN(TableRow row, Train(cell, engine.get()));
  row.method = cell.method().name;
  // An earlier program trained it, and this one scores it.
  if (row.build != BuildId()) absl::StrAppend(&row.build, "+", BuildId());
  LITAGS_ASSIGN_OR_RETURN(const std::shared_ptr<const Scene> scene,
                          engine->LoadScene(cell.TrainingDir() + "/scene.litags"));
  LITAGS_ASSIGN_OR_RETURN(std::vector<TestView> views, cell.scene().TestViews());
  views = AtMost(cell.method().options.max_image_side, std::move(views));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<ImageU8> pictures,
                          Pictures(cell, *scene, views, &row.enhance_seconds));
  // Before scoring, whose network is not part of any method.
  row.peak_rss_bytes = std::max(row.peak_rss_bytes, PeakRssBytes());
  LITAGS_RETURN_IF_ERROR(WritePictures(cell, views, pictures));
  LITAGS_RETURN_IF_ERROR(AddScores(cell, options.lpips, views, pictures, &row));
  if (options.flicker_frames > 0) {
    LITAGS_RETURN_IF_ERROR(AddFlicker(cell, *scene, options.flicker_frames, &row));
  }
  return row;
}

}  // namespace

absl::Status RunCell(const TableOptions& options, const std::string& name) {
  for (const TableScene& scene : options.scenes) {
    for (const std::string& light : options.lights) {
      for (const TableMethod& method : options.methods) {
        const TableCell cell(options, scene, light, method);
        if (cell.Name() != name) continue;
        LITAGS_ASSIGN_OR_RETURN(const std::string key, cell.RowKey());
        std::error_code ignored;  // writing reports what matters
        fs::create_directories(cell.RunDir(), ignored);
        const absl::StatusOr<TableRow> row = TrainAndScore(options, cell);
        if (row.ok()) return KeepRow(cell.RunDir() + "/row.json", key, *row);
        TableRow failed = cell.EmptyRow();
        failed.error = std::string(row.status().message());
        return KeepRow(cell.RunDir() + "/row.json", key, failed);
      }
    }
  }
  return InvalidInput("UNKNOWN_CELL", "--cell", absl::StrCat("--cell: there is no ", name));
}

}  // namespace litags
