// The engine as the server and the tools see it: photos in, a scene out, pictures of the scene.
// This header is the whole contract between server and engine; it knows nothing of gRPC or SQL.
#ifndef LITAGS_ENGINE_PIPELINE_ENGINE_H_
#define LITAGS_ENGINE_PIPELINE_ENGINE_H_

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/image.h"

namespace litags {

// What is optimised.
enum class Method {
  kLitaGs,  // the paper's R, L and structure; with use_pdm also its noise and denoiser
  k3dgs,    // plain 3D Gaussian splatting on the photos as they are (or after `tone`, see below)
};

// How the normal-light pseudo-target is made from a badly lit photo (the paper's L_exp).
enum class Tone {
  kPaper,       // gain on sRGB codes to mean theta, photo by photo
  kLinearGain,  // gain in linear light to mean theta, photo by photo
  kNone,        // photos as they are
  kCapture,     // one gain in linear light for the capture, to an even histogram; exposures evened
                // out among photos beside each other, clipped areas filled in, mild contrast
};

// What becomes of the colour of the light that the whole capture was taken in.
enum class WhiteBalance {
  kCamera,  // stays what the camera made of it
  kScene,   // is neutralised if it is implausibly strong, as sodium lamps' is; else it stays
};

// Where depth maps for the depth loss come from.
enum class DepthOrigin {
  kAuto,     // the maps given with the photos; without any, stereo on kFewViews of them
  kMaps,     // the maps given with the photos
  kStereo,   // multi-view stereo on all photos
  kNetwork,  // ReconstructInput::depth_network
  kNone,
};

// Which Gaussians are cloned and split: by the gradient of their place in the picture, averaged
// over the photos that see them.
enum class DensityStatistic {
  kMean,   // 3DGS
  kAbs,    // absolute values summed over pixels (AbsGS)
  kPixel,  // weighted by the pixels they cover (Pixel-GS)
};

// How such a Gaussian becomes two, and what goes with it: how long short runs grow, how fast scales
// learn, how wide Gaussians may become and how near to a camera.
enum class DensityGrowth {
  kLongAxis,    // halves of it, side by side on its longest axis
  kCloneSplit,  // 3DGS: a copy if it is small, two at random places in it if it is large; its rates
};

struct ReconstructOptions {
  Method method = Method::kLitaGs;
  Tone tone = Tone::kCapture;
  double theta = 0;        // target mean of sRGB codes, (0, 1); 0: 0.49 (paper)
  double contrast = 0.15;  // of kCapture, [0, 1]; 0: none
  // Of kCapture, [0, 100]: how far colours of neighbours are averaged, in deviations of the noise.
  double chroma_smoothing = 2;
  WhiteBalance white_balance = WhiteBalance::kScene;  // of kCapture
  // Share of 1 - SSIM beside L1 in L_exp, [0, 1], less on very noisy photos; paper: 0.
  double exposure_ssim = 0.2;
  int iterations = 15000;  // one photo each; paper
  // Iterations that learning rates, the coarse part and density control are laid out for; those
  // beyond go on at full size, with the last rates and the Gaussians there are. A finished scene is
  // trained further by more `iterations` with this at what they were. 0: `iterations`.
  int schedule_iterations = 0;
  // Coarse to fine: photos of 2^-n .. 1/2 of their size share the first part of the run.
  int coarse_levels = 2;      // n, 0..4; 0: full size throughout, as the paper
  double coarse_until = 0.5;  // (0, 1] of the iterations
  // E: learning rates are divided by 1 + e / E after e epochs at full size; 0: constant, as 3DGS.
  double settle_epochs = 25;
  // Share of the Gaussians that an iteration leaves out at random, [0, 0.9]; reached after many
  // epochs at full size on noisy photos, twice as much on very noisy ones (SuitedTo()). Of LITA-GS;
  // 0: none, as the paper.
  double dropout = 0.35;
  uint64_t seed = 0;
  int threads = 0;  // 0: all cores
  int64_t max_gaussians = 200000;
  DensityStatistic density_statistic = DensityStatistic::kMean;
  DensityGrowth density_growth = DensityGrowth::kLongAxis;  // of LITA-GS
  // Gaussians smaller than a pixel become more transparent instead of larger, so that pictures
  // keep their look at other sizes than the photos' (PixelFilter::kMip). Of LITA-GS; false: as
  // 3DGS.
  bool antialiased = true;
  int sh_degree = 3;        // 0..3
  bool dense_start = true;  // points of stereo depth to start from, besides SfM's
  // The paper's progressive denoising module. Off: beside the noise filter it is worth nothing that
  // was measured (docs/experiments/denoising.md), and costs a third of training and half of a
  // picture's time.
  bool use_pdm = false;
  int pdm_hidden = 8;  // channels inside its network, 1..64
  int pdm_every = 2;   // one iteration in so many denoises; paper: 1
  // Pictures are smoothed where they show no more than noise and rounding of the photos explain
  // (engine/denoise/noise_filter.h).
  bool noise_filter = true;
  bool use_prior = true;        // structure prior loss
  bool prior_geometry = false;  // it moves Gaussians (paper), else it trains the map alone
  // Where exposures differ, pixels that noise, rounding or clipping spoilt weigh less than those of
  // photos that know better (engine/target/information.h).
  bool information_weights = true;
  bool use_depth = true;      // depth loss, where depth_source has maps
  int max_image_side = 1600;  // photos with a longer side are shrunk to it, px; 0: never
  int holdout_every = 8;      // photos i (by name) with i % n == n / 2 are only evaluated; 0: none
  double min_registered = 0.5;  // fraction of photos that SfM must place, (0, 1]
  int checkpoint_every = 500;   // iterations
  int preview_every = 250;      // iterations between snapshots with a preview picture

  DepthOrigin depth_source = DepthOrigin::kAuto;
  double depth_weight = 0.01;  // of the depth loss, [0, 10]; paper: 0.1
  bool depth_geometry = true;  // it sees the Gaussians' distance; paper: an attribute of theirs

  absl::Status Validate() const;
  int ScheduleIterations() const { return schedule_iterations ? schedule_iterations : iterations; }
};

enum class Stage { kLoading, kFindingCameras, kPreparing, kTraining, kSaving };
std::string_view StageName(Stage stage);  // "loading", "finding-cameras", ...

// One report of progress. Numbers not known yet are 0; psnr_holdout is NaN until measured.
struct Progress {
  Stage stage = Stage::kLoading;
  std::string message;  // for a human; may be empty
  int iteration = 0;
  int iterations = 0;  // total
  double loss = 0;     // running mean of the total loss
  double loss_exposure = 0, loss_reconstruction = 0, loss_structure = 0, loss_denoise = 0;
  double psnr_holdout = 0;  // dB against the pseudo-target on held-out views, where they count
  int64_t gaussians = 0;
  double iterations_per_second = 0;
  double eta_seconds = 0;
  std::vector<uint8_t> preview_png;  // often empty
};

// Called from the training thread; must return quickly. A new snapshot is announced after its
// file was atomically replaced.
class ReconstructObserver {
 public:
  virtual ~ReconstructObserver() = default;
  virtual void OnProgress(const Progress& progress) = 0;
  virtual void OnSnapshot(const std::string& scene_path) = 0;
};

// A monocular depth network as an ONNX file: the operator's, or the user's of a command line.
struct DepthNetwork {
  std::string path;                                 // empty: there is none
  int width = 384, height = 384;                    // px of its input
  std::array<double, 3> mean = {.485, .456, .406};  // of RGB in [0, 1] (ImageNet)
  std::array<double, 3> std = {.229, .224, .225};
  bool inverse = true;  // gives inverse depth (MiDaS, Depth Anything), else depth (Marigold)

  // From "FILE[,size=518x518][,mean=0.5:0.5:0.5][,std=0.5:0.5:0.5][,output=inverse|depth]".
  // INVALID_ARGUMENT naming `field`. Empty text: no network.
  static absl::StatusOr<DepthNetwork> Parse(std::string_view text, std::string_view field);
};

struct ReconstructInput {
  std::string images_dir;    // photos, flat; names are the views' names
  std::string cameras_path;  // transforms*.json or a COLMAP model folder; empty: run SfM
  std::string depth_dir;     // <photo stem>.{png,pfm,npy}; empty: none given
  // <photo name>.png or <photo stem>.png, 8 bits, of the photo's upright size: 0 where a pixel is
  // not of the scene and must not be learnt. Photos may lack one. Empty: none given.
  std::string masks_dir;
  std::string work_dir;  // exists; SfM workspace, checkpoint, snapshots and results go here

  DepthNetwork depth_network;
  double colmap_step_seconds = 3600;  // wall clock of one COLMAP step; 0: no limit
};

struct ReconstructReport {
  int photos = 0;
  int registered = 0;
  std::vector<std::string> dropped;  // photos without a camera, by name
  std::string sfm_preparation;       // rung of the exposure ladder that won; "given" if known
  int64_t sparse_points = 0;
  int64_t gaussians = 0;
  int iterations = 0;
  double seconds = 0;           // from the first photo to the report
  double training_seconds = 0;  // of them in iterations
  // Where those went: "forward", "losses", "denoise", "backward", "density".
  std::map<std::string, double> phase_seconds;
  double psnr_holdout = 0;  // as in Progress
  bool depth_used = false;
  std::vector<std::string> notes;  // what the user should know: "photo.jpg is left out: ..."
  std::string scene_path;          // work_dir/scene.litags
  std::string ToJson() const;
};

enum class Channel {
  kColor,         // normal-lit R
  kOriginal,      // as photographed: R * L
  kLight,         // R * L^t, see RenderRequest::light
  kDepth,         // distance of surfaces along the axis, scene units, 0: nothing, 1 plane
  kStructure,     // 1 plane
  kIllumination,  // L, 3 planes
  kNoise,         // N_GS, 3 planes
  kAlpha,         // 1 plane
};

// Bounds of RenderRequest::light and ::exposure_stops, both ways.
constexpr double kMaxLight = 4, kMaxExposureStops = 10;

struct RenderRequest {
  Camera camera;  // validated by the callee
  Channel channel = Channel::kColor;
  double light = 0;  // t in R * L^t of kLight: 0 normal-lit, 1 as photographed, -4..4
  // The colour channels' linear light is multiplied by 2^stops before it is clamped, as a longer
  // or shorter exposure would; -10..10, 0 for all other channels.
  double exposure_stops = 0;
  int threads = 0;
  CancelToken cancel;  // looked at between the tiles of the picture
};

// A loaded scene. Immutable and safe to use from several threads.
class Scene {
 public:
  virtual ~Scene() = default;
  virtual const std::vector<View>& views() const = 0;  // training and held-out cameras, by name
  virtual int64_t num_gaussians() const = 0;
  virtual int iteration() const = 0;
  // Centre and radius of what the cameras look at, for orbits; scene units; `up` is unit length.
  virtual std::array<double, 3> center() const = 0;
  virtual std::array<double, 3> up() const = 0;
  virtual double radius() const = 0;
  // Float planes: 3 for colours (sRGB, clamped to [0, 1]), 1 otherwise as listed at Channel.
  // CANCELLED soon after the request's token is raised.
  virtual absl::StatusOr<Planes> Render(const RenderRequest& request) const = 0;
  // Standard 3DGS .ply bytes written to a file, in the light R * L^t with t = `light`, -4..4. L is
  // applied to every Gaussian instead of every pixel, and the denoiser is left out: viewers know
  // neither. Shapes and opacities are such that what viewers draw in pictures of about the views'
  // size is much like Render's (viewer_splats.h). Where the cameras stand far from the origin,
  // positions count from the point that the header names: "comment origin X Y Z".
  virtual absl::Status ExportPly(const std::string& path, double light) const = 0;
  // The Gaussians as they are, every LITA attribute as extra properties.
  virtual absl::Status ExportFullPly(const std::string& path) const = 0;
};

class Engine {
 public:
  virtual ~Engine() = default;

  // Photos to scene. Resumes from work_dir's checkpoint if there is one made from the same photos
  // and options, save more iterations of the same schedule. CANCELLED soon after the token is
  // raised; INVALID_ARGUMENT or FAILED_PRECONDITION (with an ErrorDetail) if the photos cannot give
  // a scene.
  virtual absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& input,
                                                        const ReconstructOptions& options,
                                                        const CancelToken& cancel,
                                                        ReconstructObserver* observer) = 0;

  virtual absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) = 0;
};

// The photos of one capture brightened by options.tone, as training compares with them but for
// small differences of exposure, which need cameras: the baseline that every method has to beat.
// INVALID_ARGUMENT for an empty or all-black photo.
absl::StatusOr<std::vector<ImageU8>> MakePseudoTargets(const std::vector<ImageU8>& photos,
                                                       const ReconstructOptions& options);

// The real one. `colmap` is the program's name or path.
std::unique_ptr<Engine> MakeEngine(std::string colmap = "colmap");

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_ENGINE_H_
