// A capture of the sample room as a photographer would bring it home, with exact cameras: the same
// views in normal light, too dark and over-exposed, in the layout of the LOM benchmark.
#ifndef LITAGS_ENGINE_SAMPLE_CAPTURE_H_
#define LITAGS_ENGINE_SAMPLE_CAPTURE_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/sample/sensor.h"

namespace litags::sample {

inline constexpr double kHighMean = 0.47;  // mean sRGB level of high/
inline constexpr double kOverPsnr = 10;    // PSNR(over_exp, high), dB

struct CaptureOptions {
  int width = 360;          // px, [32, 8192]
  int height = 270;         // px, [32, 8192]
  int views = 36;           // [test_every / 2 + 1, 9999]: one at least is a test view
  int test_every = 8;       // every n-th view is a test view, >= 2
  uint64_t seed = 0;        // texture detail, hand shake, exposure jitter, noise
  uint32_t noise_seed = 0;  // another one: the same photos with other noise
  int threads = 0;          // <= 0: all cores; the files do not depend on it
  int antialias = 3;        // samples a pixel and axis, [1, 16]
  bool truth = false;       // also write depth/ and clean/
  bool raw = false;         // also write raw/ and deep/; sides must be even
  bool lamp = false;        // low/ and over_exp/ are lit by a lamp at the camera alone

  double low_mean = 0.045;  // mean sRGB level of low/, [0.005, kHighMean]
  double jitter = 0.1;      // exposure of each view is scaled by U(1 - jitter, 1 + jitter)
  SensorOptions sensor;

  std::function<void(int done)> on_view;  // if set: views that are rendered, in this thread

  absl::Status Validate() const;
};

// What was written, measured on the 8-bit pictures before JPEG.
struct CaptureReport {
  double low_gain = 0, over_gain = 0;                 // linear, against high
  double high_mean = 0, low_mean = 0, over_mean = 0;  // mean sRGB level
  double low_psnr = 0, over_psnr = 0;                 // against high, dB, mean over views
  std::vector<std::string> train, test;               // view names
};

// The cameras in the order of their names: an inward-looking arc around the table at changing
// height, as a person walking by would hold the camera.
std::vector<View> CaptureViews(const CaptureOptions& options);

// Renders the capture and writes, under `out_dir` (made if missing), in place of what an earlier
// run wrote there:
//   high/ low/ over_exp/NAME.JPG
//   transforms_train.json transforms_val.json transforms_test.json
//       camera-to-world matrices with OpenGL axes; val equals test
//   capture.json            exposure of every view, noise model, seed
//   depth/NAME.pfm          with `truth`: exact depth along the optical axis, metres
//   clean/NAME.png          with `truth`: low/ without noise, 16-bit sRGB codes
//   raw/ deep/              with `raw`: captures of their own, whose low/ has what the sensor gave
//       for low/ of this one as DNG, and as 16-bit PNG; high/ is a link to this one's
// Holds all views in memory: about 12 bytes a pixel and view.
// INVALID_ARGUMENT for a bad option; errors of MakeOwnFolder (work_folder.h), as FOLDER_NOT_OURS
// where `out_dir` holds files and no run of this made it; otherwise the error of the file that
// cannot be written.
absl::StatusOr<CaptureReport> WriteCapture(const CaptureOptions& options,
                                           const std::string& out_dir);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_CAPTURE_H_
