// The whole engine on small photos: what it makes, and how it runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <future>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "engine/core/error_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/ply.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/capture_targets.h"
#include "engine/pipeline/posed_photos.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::vector<std::string> FilesIn(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  return files;
}

TEST(Reconstruct, PreviewsOfLargePhotosAreSmall) {
  const Photographs photographs(1000, 100);
  ReconstructOptions options = SmallOptions();
  options.recipe->use_pdm = false;
  options.iterations = options.preview_every;
  Recorder recorder;
  ASSERT_TRUE(MakeEngine(kNoColmap)
                  ->Reconstruct(photographs.Input("run"), options, CancelToken(), &recorder)
                  .ok());
  int previews = 0;
  for (const Progress& p : recorder.reports) {
    if (p.preview_png.empty()) continue;
    ++previews;
    const auto image = DecodeImage(
        {reinterpret_cast<const char*>(p.preview_png.data()), p.preview_png.size()}, "preview");
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->width, kMaxPreviewSide);
    EXPECT_EQ(image->height, 80);
  }
  EXPECT_EQ(previews, 1);
}

TEST(Reconstruct, TurnsPhotosIntoASceneAndAReport) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  Recorder recorder;
  const auto engine = MakeEngine(kNoColmap);
  const auto report = engine->Reconstruct(input, SmallOptions(), CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();

  EXPECT_EQ(report->photos, kPhotos);
  EXPECT_EQ(report->registered, kPhotos);
  EXPECT_THAT(report->dropped, IsEmpty());
  EXPECT_EQ(report->sfm_preparation, "given");
  EXPECT_EQ(report->sparse_points, kPoints);
  EXPECT_EQ(report->gaussians, kPoints);  // density control starts later
  EXPECT_EQ(report->iterations, kIterations);
  EXPECT_EQ(report->first_iteration, 0);
  EXPECT_GT(report->training_seconds, 0);
  EXPECT_GE(report->seconds, report->training_seconds);
  for (const char* phase : {"forward", "losses", "denoise", "backward"}) {
    EXPECT_GT(report->phase_seconds.at(phase), 0) << phase;
  }
  EXPECT_TRUE(std::isfinite(report->psnr_holdout));
  EXPECT_GT(report->ssim_holdout, 0);
  EXPECT_LE(report->ssim_holdout, 1);
  EXPECT_FALSE(report->depth_used);
  EXPECT_EQ(report->scene_path, input.work_dir + "/scene.litags");
  EXPECT_TRUE(fs::exists(input.work_dir + "/checkpoint.litags"));  // to train it further

  const auto json = nlohmann::json::parse(Bytes(input.work_dir + "/report.json"));
  EXPECT_EQ(json["photos"], kPhotos);
  EXPECT_EQ(json["psnr_holdout"], report->psnr_holdout);
  EXPECT_EQ(json["ssim_holdout"], report->ssim_holdout);

  const auto scene = engine->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ((*scene)->num_gaussians(), report->gaussians);
  EXPECT_EQ((*scene)->iteration(), kIterations);
  ASSERT_EQ((*scene)->views().size(), size_t{kPhotos});
  for (int i = 0; i < kPhotos; ++i) {
    EXPECT_EQ((*scene)->views()[i].name, photos.model.views[i].name);
  }
  const std::string ply = input.work_dir + "/scene.ply";
  ASSERT_TRUE((*scene)->ExportPly(ply, /*light=*/0).ok());
  const auto read = DecodePly(Bytes(ply), "ply");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(static_cast<int64_t>(read->splats.size()), report->gaussians);
}

TEST(Reconstruct, ASceneThatDissolvedIsNoted) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.recipe->densify_start = options.recipe->densify_every = 10;
  for (const double prune_opacity : {0.0, 1.0}) {
    options.recipe->prune_opacity = prune_opacity;
    const auto report = Reconstruct(photos.Input(prune_opacity > 0 ? "all" : "none"), options);
    ASSERT_TRUE(report.ok()) << report.status();
    const auto noted = Contains(HasSubstr("training removed all Gaussians but 1"));
    if (prune_opacity > 0) {
      EXPECT_EQ(report->gaussians, 1);
      EXPECT_THAT(report->notes, noted);
    } else {
      EXPECT_THAT(report->notes, Not(noted));
    }
  }
}

TEST(Reconstruct, ReportsProgressInOrder) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  Recorder recorder;
  const auto report =
      MakeEngine(kNoColmap)->Reconstruct(input, SmallOptions(), CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();

  ASSERT_FALSE(recorder.reports.empty());
  EXPECT_EQ(recorder.reports.front().stage, Stage::kLoading);
  const Progress& saving = recorder.reports.back();
  EXPECT_EQ(saving.stage, Stage::kSaving);
  EXPECT_EQ(saving.iteration, kIterations);
  EXPECT_EQ(saving.gaussians, report->gaussians);
  EXPECT_EQ(saving.psnr_holdout, report->psnr_holdout);
  EXPECT_GT(saving.loss, 0);
  EXPECT_GT(saving.loss_reconstruction, 0);
  int last = 0, previews = 0;
  Stage stage = Stage::kLoading;
  for (const Progress& p : recorder.reports) {
    EXPECT_GE(p.stage, stage);
    stage = p.stage;
    EXPECT_EQ(p.iterations, kIterations);
    if (p.stage != Stage::kTraining) continue;
    EXPECT_GT(p.iteration, last);
    last = p.iteration;
    EXPECT_GT(p.loss, 0);
    EXPECT_GT(p.gaussians, 0);
    EXPECT_GT(p.iterations_per_second, 0);
    EXPECT_GE(p.eta_seconds, 0);
    if (p.preview_png.empty()) continue;
    ++previews;
    const std::string_view png(reinterpret_cast<const char*>(p.preview_png.data()),
                               p.preview_png.size());
    const auto image = DecodeImage(png, "preview");
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->width, kWidth);
    EXPECT_EQ(image->height, kHeight);
  }
  EXPECT_EQ(last, kIterations);
  EXPECT_EQ(previews, kIterations / 10);
  EXPECT_THAT(recorder.snapshots, ElementsAre(report->scene_path, report->scene_path,
                                              report->scene_path, report->scene_path));
}

// Loads each snapshot when it is announced.
class SnapshotReader : public Recorder {
 public:
  void OnSnapshot(const std::string& path) override {
    const auto scene = MakeEngine(kNoColmap)->LoadScene(path);
    ASSERT_TRUE(scene.ok()) << scene.status();
    loaded.push_back((*scene)->iteration());
    ASSERT_FALSE(reports.empty());
    told.push_back(reports.back().iteration);
  }
  std::vector<int> loaded, told;
};

TEST(Reconstruct, ASnapshotIsOfTheIterationThatWasToldLast) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  SnapshotReader reader;
  const auto report =
      MakeEngine(kNoColmap)->Reconstruct(input, SmallOptions(), CancelToken(), &reader);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(reader.loaded, ElementsAre(10, 20, 30, 40));
  EXPECT_EQ(reader.told, reader.loaded);
}

TEST(Reconstruct, SaysWhenThePhotosGrow) {
  const Photographs photos(/*width=*/160, /*height=*/128);  // 64 px is the smallest side
  ReconstructOptions options = SmallOptions();
  options.recipe->coarse_levels = 1;
  options.recipe->coarse_until = 0.5;
  Recorder recorder;
  ASSERT_TRUE(MakeEngine(kNoColmap)
                  ->Reconstruct(photos.Input("work"), options, CancelToken(), &recorder)
                  .ok());
  std::vector<Progress> said;
  for (const Progress& report : recorder.reports) {
    if (report.stage == Stage::kTraining && !report.message.empty()) said.push_back(report);
  }
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].message, "photos are now at full size; the loss starts anew");
  EXPECT_EQ(said[0].iteration, options.iterations / 2);
  EXPECT_EQ(said[0].loss, 0);
}

// Of 17 held-out photos the last one is of white stripes: no other scores as badly.
TEST(Reconstruct, APreviewScoresSixteenHeldOutPhotosAndTheEndAll) {
  constexpr int kMany = 34;
  Photographs photos;
  const std::vector<View> taken = photos.model.views;
  photos.model.views.clear();
  photos.model.distortions.resize(kMany);
  for (int i = 0; i < kMany; ++i) {
    View& view = photos.model.views.emplace_back(taken[i % kPhotos]);
    view.name = absl::StrFormat("many%02d.png", i);
    auto photo = ReadImage(photos.Photo(taken[i % kPhotos].name), "photo");
    ASSERT_TRUE(photo.ok()) << photo.status();
    ++photo->pixel(i, 0)[0];  // the same photo again would be left out
    ASSERT_TRUE(WritePng(photos.Photo(view.name), *photo).ok());
  }
  for (const View& view : taken) fs::remove(photos.Photo(view.name));
  ImageU8 stripes(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) std::fill_n(stripes.pixel(x, y), 3, x % 8 < 3 ? 255 : 30);
  }
  ASSERT_TRUE(WritePng(photos.Photo(photos.model.views.back().name), stripes).ok());
  photos.WriteModel();

  ReconstructOptions options = SmallOptions();
  options.holdout_every = 2;
  options.preview_every = options.iterations - 1;
  Recorder recorder;
  const auto report =
      MakeEngine(kNoColmap)->Reconstruct(photos.Input("work"), options, CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->registered, kMany) << absl::StrJoin(report->notes, "; ");
  double preview = NAN;
  for (const Progress& p : recorder.reports) {
    if (p.iteration == options.preview_every) preview = p.psnr_holdout;
  }
  EXPECT_GT(preview, report->psnr_holdout + 0.4) << "dB";
}

constexpr char kMakingTargets[] = "pseudo-targets and structure maps";

TEST(Reconstruct, NoTargetIsMadeOnceTheRunIsCancelled) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ReconstructOptions options = SmallOptions();
  options.recipe->use_prior = false;  // which hears a cancel, too
  CancelToken cancel;
  ReconstructReport report;
  const auto progress = [&](Stage, const std::string& message) {
    if (message == kMakingTargets) cancel.Cancel();
  };
  const Context context(input, options, cancel, progress, &report);
  auto posed = LoadPosedPhotos(context, kNoColmap);
  ASSERT_TRUE(posed.ok()) << posed.status();
  const auto targets = MakeCaptureTargets(context, *posed, std::move(posed->photos));
  EXPECT_EQ(targets.status().code(), absl::StatusCode::kCancelled) << targets.status();
}

TEST(Reconstruct, ACancelWhileTargetsAreMadeLeavesNothingHalfWritten) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work"), whole = photos.Input("whole");
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& p) {
    if (p.message == kMakingTargets) cancel.Cancel();
  };
  const absl::Status status =
      MakeEngine(kNoColmap)->Reconstruct(input, SmallOptions(), cancel, &recorder).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled) << status;
  EXPECT_EQ(recorder.reports.back().message, kMakingTargets);
  EXPECT_THAT(recorder.snapshots, IsEmpty());
  // The cameras are whole, and are used again.
  std::map<std::string, fs::file_time_type> cameras;
  for (const std::string& file : FilesIn(input.work_dir)) {
    EXPECT_THAT(file, HasSubstr("/cameras/"));
    EXPECT_THAT(file, Not(HasSubstr("-tmp")));
    cameras[file] = fs::last_write_time(file);
  }
  EXPECT_THAT(cameras, Not(IsEmpty()));
  ASSERT_TRUE(Reconstruct(input, SmallOptions()).ok());
  for (const auto& [file, time] : cameras) EXPECT_EQ(fs::last_write_time(file), time) << file;
  ASSERT_TRUE(Reconstruct(whole, SmallOptions()).ok());
  EXPECT_TRUE(SceneBytes(input) == SceneBytes(whole));
}

// Of fewer than 16 with the default.
TEST(Reconstruct, HoldsNoPhotoOutOfFewerThanTwiceAsManyAsItWouldTake) {
  EXPECT_EQ(ReconstructOptions().holdout_every, 8);
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.iterations = 2;
  const auto note = HasSubstr("none of the 8 photos is held out to measure quality");
  options.holdout_every = kPhotos / 2;
  const auto enough = Reconstruct(photos.Input("enough"), options);
  ASSERT_TRUE(enough.ok()) << enough.status();
  EXPECT_TRUE(std::isfinite(enough->psnr_holdout));
  EXPECT_THAT(enough->notes, Not(Contains(note)));
  options.holdout_every = kPhotos / 2 + 1;
  const auto too_few = Reconstruct(photos.Input("few"), options);
  ASSERT_TRUE(too_few.ok()) << too_few.status();
  EXPECT_TRUE(std::isnan(too_few->psnr_holdout));
  EXPECT_THAT(too_few->notes, Contains(note));
}

TEST(Reconstruct, ImprovesTheHeldOutPhotos) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.iterations = 1;
  const auto before = Reconstruct(photos.Input("one"), options);
  options.iterations = 150;
  const auto after = Reconstruct(photos.Input("many"), options);
  ASSERT_TRUE(before.ok() && after.ok()) << before.status() << after.status();
  EXPECT_GT(after->psnr_holdout, before->psnr_holdout + 1);
}

TEST(Reconstruct, TrainsPlain3dgs) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.recipe = Plain3dgs();
  options.iterations = 10;
  const ReconstructInput input = photos.Input("work");
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  const auto scene = MakeEngine()->LoadScene(report->scene_path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  RenderRequest request;
  request.camera = (*scene)->views()[0].camera;
  EXPECT_TRUE((*scene)->Render(request).ok());
  request.channel = Channel::kIllumination;
  EXPECT_EQ(Reason((*scene)->Render(request).status()), "CHANNEL_UNAVAILABLE");
}

TEST(Reconstruct, TheNoiseFilterActsOnPicturesOnly) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  const auto picture_and_ply = [&](const std::string& name, const Recipe& recipe,
                                   bool noise_filter) {
    options.recipe = recipe;
    options.recipe->noise_filter = noise_filter;
    const ReconstructInput input = photos.Input(name);
    const auto report = Reconstruct(input, options);
    EXPECT_TRUE(report.ok()) << report.status();
    const auto scene = MakeEngine()->LoadScene(report->scene_path);
    EXPECT_TRUE(scene.ok()) << scene.status();
    RenderRequest request;
    request.camera = (*scene)->views()[0].camera;
    const auto picture = (*scene)->Render(request);
    EXPECT_TRUE(picture.ok() && (*scene)->ExportPly(input.work_dir + "/a.ply", 0).ok());
    return std::pair(picture->data, Bytes(input.work_dir + "/a.ply"));
  };
  const auto on = picture_and_ply("on", *SmallOptions().recipe, true);
  const auto off = picture_and_ply("off", *SmallOptions().recipe, false);
  EXPECT_NE(on.first, off.first);
  EXPECT_TRUE(on.second == off.second);
  EXPECT_EQ(picture_and_ply("3dgs", Plain3dgs(), true).first,
            picture_and_ply("3dgs off", Plain3dgs(), false).first);
}

TEST(Reconstruct, OneThreadIsOneThread) {
  const auto threads = [] {
    const fs::directory_iterator tasks("/proc/self/task");
    return std::distance(begin(tasks), end(tasks));
  };
  const Photographs photos;
  Recorder recorder;
  ReconstructOptions options = SmallOptions();
  options.threads = 1;
  int opencv = 0;
  recorder.on_progress = [&](const Progress&) { opencv = cv::getNumThreads(); };
  cv::setNumThreads(2);
  const auto before = threads();  // a sanitizer has one of its own
  const auto report =
      MakeEngine(kNoColmap)->Reconstruct(photos.Input("work"), options, CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(threads(), before);       // pools outlive their loops
  EXPECT_EQ(opencv, 1);               // its own starts with larger photos than these
  EXPECT_EQ(cv::getNumThreads(), 2);  // as it was
}

// The one that began last ended last, and put back what the other had set.
TEST(Reconstruct, OverlappingRunsPutOpenCvsThreadsBack) {
  const Photographs photos;
  std::promise<void> first_began, second_began, first_ended;
  ReconstructOptions options = SmallOptions();
  options.iterations = 2;
  const auto run = [&](const std::string& work, std::promise<void>* began,
                       std::promise<void>* wait_for) {
    Recorder recorder;
    bool told = false;
    recorder.on_progress = [&](const Progress&) {
      if (std::exchange(told, true)) return;
      began->set_value();
      wait_for->get_future().wait();
    };
    const auto report =
        MakeEngine(kNoColmap)->Reconstruct(photos.Input(work), options, CancelToken(), &recorder);
    EXPECT_TRUE(report.ok()) << report.status();
  };
  cv::setNumThreads(2);
  std::thread first([&] {
    run("first", &first_began, &second_began);
    first_ended.set_value();
  });
  first_began.get_future().wait();
  std::thread second([&] { run("second", &second_began, &first_ended); });
  first.join();
  second.join();
  EXPECT_EQ(cv::getNumThreads(), 2);
}

// The second one removed files of the first, and both wrote one scene.
TEST(Reconstruct, AWorkFolderIsOneRunsAtATime) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ReconstructOptions options = SmallOptions();
  options.iterations = 10;
  Recorder recorder;
  absl::Status second;
  recorder.on_progress = [&](const Progress& p) {
    if (p.stage == Stage::kTraining) second = Reconstruct(input, options).status();
  };
  const auto first = MakeEngine(kNoColmap)->Reconstruct(input, options, CancelToken(), &recorder);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(Reason(second), "WORK_DIR_IN_USE");
  EXPECT_EQ(second.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(Reconstruct(input, options).ok());  // when it is done
}

}  // namespace
}  // namespace litags
