// What a user chooses for a reconstruction.
#ifndef LITAGS_ENGINE_PIPELINE_OPTIONS_H_
#define LITAGS_ENGINE_PIPELINE_OPTIONS_H_

#include <cstdint>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "engine/core/fields.h"
#include "engine/train/recipe.h"

namespace litags {

// What becomes of the colour of the light that the whole capture was taken in. Values are stored
// with jobs, as those of the other enums here.
enum class WhiteBalance {
  kCamera = 0,  // stays what the camera made of it
  kScene = 1,   // is neutralised if it is implausibly strong, as sodium lamps' is; else it stays
};

template <>
struct EnumWords<WhiteBalance> {
  static constexpr std::pair<WhiteBalance, const char*> kWords[] = {
      {WhiteBalance::kScene, "scene"}, {WhiteBalance::kCamera, "camera"}};
};

// Where depth maps for the depth loss come from.
enum class DepthOrigin {
  kAuto = 0,     // the maps given with the photos; without any, what the recipe has
  kMaps = 1,     // the maps given with the photos
  kStereo = 2,   // multi-view stereo on all photos
  kNetwork = 3,  // ReconstructInput::depth_network
  kNone = 4,
};

template <>
struct EnumWords<DepthOrigin> {
  static constexpr std::pair<DepthOrigin, const char*> kWords[] = {
      {DepthOrigin::kAuto, "auto"},
      {DepthOrigin::kMaps, "maps"},
      {DepthOrigin::kStereo, "stereo"},
      {DepthOrigin::kNetwork, "network"},
      {DepthOrigin::kNone, "none"}};
};

struct ReconstructOptions {
  Method method = Method::kLitags;
  std::optional<Tone> tone;  // unset: the method's
  WhiteBalance white_balance = WhiteBalance::kScene;
  DepthOrigin depth_source = DepthOrigin::kAuto;
  int iterations = 10000;  // docs/experiments/long-runs.md
  // Iterations that learning rates, the coarse part and density control are laid out for; those
  // beyond go on at full size, with the last rates and the Gaussians there are. A finished scene is
  // trained further by more `iterations` with this at what they were. 0: `iterations`.
  int schedule_iterations = 0;
  uint64_t seed = 0;
  int threads = 0;
  int64_t max_gaussians = 200000;
  int sh_degree = 3;
  int max_image_side = 1600;
  int frames = 0;         // of a video: at most so many become photos; 0: as its motion asks for
  int holdout_every = 8;  // photos i (by name) with i % n == n / 2 are only evaluated
  bool refine_cameras = false;
  double min_registered = 0.5;
  int checkpoint_every = 1000;
  int preview_every = 500;
  // Of research, never of the service: instead of the method's recipe.
  std::optional<Recipe> recipe;

  // INVALID_ARGUMENT (BAD_OPTION) on "options.<name>".
  absl::Status Validate() const;
  int ScheduleIterations() const { return schedule_iterations ? schedule_iterations : iterations; }
  Recipe ResolveRecipe() const;  // with what the options change of it
};

// All but `recipe`: what the API, the command lines and the store know.
template <class T, class Visit>
void VisitFields(FieldsOf<ReconstructOptions>, T& o, Visit&& visit) {
  visit(
      "method", o.method,
      FieldRule{.help = "litags, litags-paper (as the paper has it, but for stereo in place of its "
                        "depth network) or 3dgs"});
  visit("tone", o.tone,
        FieldRule{.help = "target of the light: capture, paper or none; without, the method's"});
  visit("white_balance", o.white_balance,
        FieldRule{.help = "scene neutralises a strong cast, as of sodium lamps; camera keeps it"});
  visit("depth_source", o.depth_source,
        FieldRule{.help = "depth maps: maps, stereo of all photos, network, none, or auto: maps if "
                          "given, else the method's"});
  visit("iterations", o.iterations,
        FieldRule{.least = 1,
                  .most = 1e6,
                  .help = "training iterations, one photo each",
                  .shapes_scene = false});
  visit("schedule_iterations", o.schedule_iterations,
        FieldRule{.least = 1,
                  .most = 1e6,
                  .zero = "iterations",
                  .help = "lay out rates and densities for so many; those beyond train the scene "
                          "further",
                  .shapes_scene = false});
  visit("seed", o.seed, FieldRule{.help = "seed of every random choice"});
  visit("threads", o.threads,
        FieldRule{.least = 1,
                  .most = 1024,
                  .zero = "all cores",
                  .help = "threads that the run may use",
                  .shapes_scene = false});
  visit("max_gaussians", o.max_gaussians,
        FieldRule{
            .least = 1000, .most = 2e7, .help = "most Gaussians, which bounds time and memory"});
  visit("sh_degree", o.sh_degree,
        FieldRule{
            .least = 0, .most = 3, .help = "degree of the spherical harmonics of colour, 0..3"});
  visit("max_image_side", o.max_image_side,
        FieldRule{.least = 64, .zero = "never", .help = "shrink larger photos to this, px"});
  visit("frames", o.frames,
        FieldRule{.least = 3,
                  .most = 2000,
                  .zero = "as many as its motion asks for, 300 at most",
                  .help = "take at most so many frames of a video"});
  visit("holdout_every", o.holdout_every,
        FieldRule{.least = 2, .zero = "none", .help = "hold out every n-th photo for evaluation"});
  visit(
      "refine_cameras", o.refine_cameras,
      FieldRule{.help = "learn the cameras' poses with the scene: for given cameras that are off, "
                        "as of a phone's tracker"});
  visit("min_registered", o.min_registered,
        FieldRule{.least = 0,
                  .most = 1,
                  .above_least = true,
                  .help = "share of the photos that must get a camera",
                  .shapes_scene = false});
  visit("checkpoint_every", o.checkpoint_every,
        FieldRule{.least = 1, .help = "iterations between checkpoints", .shapes_scene = false});
  visit("preview_every", o.preview_every,
        FieldRule{.least = 1, .help = "iterations between previews", .shapes_scene = false});
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_OPTIONS_H_
