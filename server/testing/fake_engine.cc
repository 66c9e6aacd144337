#include "server/testing/fake_engine.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// The smallest PNG there is: 1x1, grey.
constexpr int kFrames = 12;  // of a video

constexpr uint8_t kTinyPng[] = {0x89, 'P', 'N',  'G',  0x0d, 0x0a, 0x1a, 0x0a, 0,    0, 0, 13,
                                'I',  'H', 'D',  'R',  0,    0,    0,    1,    0,    0, 0, 1,
                                8,    0,   0,    0,    0,    0x3a, 0x7e, 0x9b, 0x55, 0, 0, 0,
                                10,   'I', 'D',  'A',  'T',  0x78, 0x9c, 0x63, 0x68, 0, 0, 0,
                                0x82, 0,   0x81, 0xdd, 0x43, 0x6a, 0xf4, 0,    0,    0, 0, 'I',
                                'E',  'N', 'D',  0xae, 0x42, 0x60, 0x82};

// What "training" changes: a number that only the same iterations in the same order give.
struct Trained {
  int iteration = 0;
  uint64_t state = 0;

  void Step(uint64_t seed) {
    ++iteration;
    state = (state ^ seed ^ static_cast<uint64_t>(iteration)) * 0x9E3779B97F4A7C15u;
    state ^= state >> 29;
  }
};

bool IsHeavy(const std::vector<std::string>& names) {
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return fs::path(name).stem() == "heavy"; });
}

class FakeScene : public Scene {
 public:
  FakeScene(const Trained& trained, const std::vector<std::string>& names)
      : trained_(trained), heavy_(IsHeavy(names)) {
    for (size_t i = 0; i < names.size(); ++i) {
      View& view = views_.emplace_back();
      view.name = names[i];
      view.camera.width = 64;
      view.camera.height = 48;
      view.camera.fx = view.camera.fy = 60;
      view.camera.cx = 32;
      view.camera.cy = 24;
      const double angle = 2 * M_PI * static_cast<double>(i) / static_cast<double>(names.size());
      // Cannot fail: eye and up are not degenerate.
      view.camera.LookAt({4 * std::cos(angle), -1, 4 * std::sin(angle)}, {0, 0, 0}, {0, -1, 0})
          .IgnoreError();
    }
  }

  const std::vector<View>& views() const override { return views_; }
  int64_t num_gaussians() const override { return 100; }
  int iteration() const override { return trained_.iteration; }
  std::array<double, 3> center() const override { return {0, 0, 0}; }
  std::array<double, 3> up() const override { return {0, -1, 0}; }
  double radius() const override { return 4; }

  absl::StatusOr<Planes> Render(const RenderRequest& request) const override {
    LITAGS_RETURN_IF_ERROR(request.camera.Validate("camera"));
    LITAGS_RETURN_IF_ERROR(TakeTime(request.cancel));
    const bool colour =
        request.channel == Channel::kColor || request.channel == Channel::kOriginal ||
        request.channel == Channel::kLight || request.channel == Channel::kIllumination ||
        request.channel == Channel::kNoise;
    Planes planes(colour ? 3 : 1, request.camera.height, request.camera.width);
    const auto center = request.camera.Center();
    const double offset = 0.1 * static_cast<int>(request.channel) + 0.01 * request.light +
                          0.02 * request.exposure_stops +
                          0.001 * (center[0] + center[1] + center[2]);
    for (int c = 0; c < planes.channels; ++c) {
      for (int y = 0; y < planes.height; ++y) {
        for (int x = 0; x < planes.width; ++x) {
          planes.at(c, y, x) =
              static_cast<float>(offset + 0.5 * x / planes.width + 0.1 * c * y / planes.height);
        }
      }
    }
    if (request.channel == Channel::kDepth) {
      for (float& v : planes.data) v = 2 + 3 * v;
    }
    return planes;
  }

  // Says what was asked for: the light, and whatever else is not as usual.
  absl::StatusOr<int64_t> Export(const std::string& path,
                                 const ExportRequest& request) const override {
    std::string kind = absl::StrCat("light ", request.light);
    if (request.format != SceneFormat::kPly || request.max_splats != 0 || request.crop ||
        request.scale != 1 || request.up != UpAxis::kOfFormat || request.exposure_stops != 0) {
      absl::StrAppend(&kind, " format ", static_cast<int>(request.format), " max ",
                      request.max_splats, " scale ", request.scale, " up ",
                      static_cast<int>(request.up), " stops ", request.exposure_stops, " crop ",
                      request.crop ? request.crop->max[2] : 0, " aa ", request.antialiased,
                      " threads ", request.threads);
    }
    LITAGS_RETURN_IF_ERROR(Write(path, kind));
    LITAGS_RETURN_IF_ERROR(TakeTime(request.cancel));
    return request.max_splats > 0 ? request.max_splats : num_gaussians();
  }
  absl::Status ExportFullPly(const std::string& path) const override {
    return Write(path, absl::StrCat("full ", trained_.state));
  }
  absl::Status Save(const std::string& path) const override {
    return Write(path, absl::StrCat("own ", trained_.state));
  }

 private:
  // Twenty seconds, if it is heavy.
  absl::Status TakeTime(const CancelToken& cancel) const {
    for (int i = 0; heavy_ && i < 4000; ++i) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return absl::OkStatus();
  }

  // Larger than one chunk of an export.
  absl::Status Write(const std::string& path, const std::string& kind) const {
    std::ofstream file(path, std::ios::binary);
    file << "ply\ncomment " << kind << "\n" << std::string(600'000, 'x') << "end";
    return file.good() ? absl::OkStatus() : absl::InternalError("cannot write " + path);
  }

  const Trained trained_;
  const bool heavy_;
  std::vector<View> views_;
};

// Writes a scene file, whole or not at all: what was trained, then the photos' names. Without names
// it is a checkpoint. RESOURCE_EXHAUSTED (DISK_FULL).
absl::Status Save(const std::string& path, const Trained& trained,
                  const std::set<std::string>& names) {
  std::string text = absl::StrCat(trained.iteration, " ", trained.state, "\n");
  for (const std::string& name : names) absl::StrAppend(&text, name, "\n");
  return WriteFileAtomically(path, text);
}

bool Has(const std::set<std::string>& names, const std::string& stem) {
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& name) { return fs::path(name).stem() == stem; });
}

class FakeEngine : public Engine {
 public:
  absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& input,
                                                const ReconstructOptions& options,
                                                const CancelToken& cancel,
                                                ReconstructObserver* observer) override {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(input.images_dir)) {
      names.insert(entry.path().filename());
    }
    if (!input.video_path.empty()) {
      const int frames = options.frames > 0 ? options.frames : kFrames;
      for (int i = 1; i <= frames; ++i) names.insert(absl::StrFormat("frame_%04d.png", i));
    }
    if (Has(names, "fail")) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "SFM_TOO_FEW_VIEWS", "images",
                       "cameras were found for 1 of 4 photos; take photos that overlap more");
    }
    ReconstructReport report;
    report.photos = static_cast<int>(names.size());
    const auto unplaced = [](const std::string& name) {
      return fs::path(name).stem() == "no-camera";
    };
    std::copy_if(names.begin(), names.end(), std::back_inserter(report.dropped), unplaced);
    std::erase_if(names, unplaced);
    report.registered = static_cast<int>(names.size());
    report.sfm_preparation = input.cameras_path.empty() ? "raw" : "given";
    report.depth_used = !input.depth_dir.empty();
    if (!input.masks_dir.empty()) {
      const auto masks = std::distance(fs::directory_iterator(input.masks_dir), {});
      report.notes.push_back(absl::StrCat(masks, " photos have a mask"));
    }
    report.gaussians = 100;
    report.iterations = options.iterations;
    report.scene_path = input.work_dir + "/scene.litags";

    const std::string checkpoint = input.work_dir + "/checkpoint";
    Trained trained;
    std::ifstream(checkpoint) >> trained.iteration >> trained.state;
    const int start = trained.iteration;
    if (start > 0) report.notes.push_back(absl::StrCat("resumed at iteration ", start));
    const auto pause = std::chrono::milliseconds(Has(names, "slow") ? 20 : 1);

    Progress progress;
    progress.stage = Stage::kLoading;
    progress.iterations = options.iterations;
    observer->OnProgress(progress);
    observer->OnLine("a program says: /tmp/secret/photo.png is read");
    progress.stage = Stage::kTraining;
    progress.iterations_per_second = 1000.0 / static_cast<double>(pause.count());
    for (int i = start + 1; i <= options.iterations; ++i) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      std::this_thread::sleep_for(pause);
      trained.Step(options.seed);
      progress.iteration = i;
      progress.loss = 1.0 / i;
      progress.gaussians = 100;
      if (i % options.checkpoint_every == 0 || i == options.iterations) {
        LITAGS_RETURN_IF_ERROR(Save(checkpoint, trained, {}));
      }
      if (i % options.preview_every == 0) {
        progress.preview_png.assign(std::begin(kTinyPng), std::end(kTinyPng));
        observer->OnProgress(progress);
        progress.preview_png.clear();
        LITAGS_RETURN_IF_ERROR(Save(report.scene_path, trained, names));
        observer->OnSnapshot(report.scene_path);
      } else {
        observer->OnProgress(progress);
      }
      if (i == std::max(start + 1, options.iterations / 2)) {
        LITAGS_RETURN_IF_ERROR(Misbehave(names, input, cancel));
      }
    }
    LITAGS_RETURN_IF_ERROR(Save(report.scene_path, trained, names));
    return report;
  }

  absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) override {
    std::ifstream file(path);
    Trained trained;
    if (!(file >> trained.iteration >> trained.state)) {
      return MakeError(absl::StatusCode::kNotFound, "SCENE_MISSING", "", "no scene at " + path);
    }
    std::vector<std::string> names;
    for (std::string name; file >> name;) names.push_back(name);
    return std::shared_ptr<const Scene>(std::make_shared<FakeScene>(trained, names));
  }

 private:
  static absl::Status Misbehave(const std::set<std::string>& names, const ReconstructInput& input,
                                const CancelToken& cancel) {
    if (Has(names, "crash")) kill(getpid(), SIGKILL);
    const std::string marker = input.work_dir + "/crashed";
    if (Has(names, "crash-once") && !fs::exists(marker)) {
      std::ofstream(marker) << "x";
      std::this_thread::sleep_for(std::chrono::seconds(3));  // the marker is kept, as a checkpoint
      kill(getpid(), SIGKILL);
    }
    std::vector<std::string> hoard;  // until there is no more
    while (Has(names, "memory")) hoard.emplace_back(64 << 20, 'x');
    std::vector<char> memory;  // more than a job's limit, held until it is noticed
    if (Has(names, "hungry")) {
      memory.assign(size_t{300} << 20, 'x');
      const volatile char* held = memory.data();  // or no compiler would keep it
      while (*held == 'x' && !cancel.IsCancelled())
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    while (Has(names, "stuck") || (Has(names, "hang") && !cancel.IsCancelled())) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return absl::OkStatus();
  }
};

}  // namespace

std::unique_ptr<Engine> MakeFakeEngine(std::string) { return std::make_unique<FakeEngine>(); }

}  // namespace litags
