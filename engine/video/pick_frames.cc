#include "engine/video/pick_frames.h"

#include <chrono>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/io/image_io.h"
#include "engine/io/panorama.h"
#include "engine/video/frame_choice.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

constexpr std::chrono::seconds kBetweenReports{2};

// Says how far the work is, now and then.
class Reporter {
 public:
  explicit Reporter(const FrameProgress& progress) : progress_(progress) {}
  void Say(const std::string& text) {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < kBetweenReports) return;
    last_ = now;
    if (progress_) progress_(text);
  }

 private:
  const FrameProgress& progress_;
  std::chrono::steady_clock::time_point last_;
};

absl::StatusOr<std::vector<FrameFacts>> LookAtAll(VideoFile& video, const CancelToken& cancel,
                                                  Reporter& reporter, PickedFrames* report) {
  std::vector<FrameFacts> facts;
  FrameMeter meter;
  const std::string all =
      video.info().frames > 0 ? absl::StrCat(" of about ", video.info().frames) : "";
  for (;;) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    LITAGS_ASSIGN_OR_RETURN(const bool more, video.Next());
    if (!more) break;
    const Planes luma = video.Luma(kMeasuredSide);
    facts.push_back(meter.Measure(luma));
    report->seconds = video.Seconds();
    reporter.Say(absl::StrCat("frame ", facts.size(), all, " looked at"));
  }
  report->frames = static_cast<int>(facts.size());
  return facts;
}

}  // namespace

absl::StatusOr<PickedFrames> PickFrames(std::string_view bytes, const std::string& field, int most,
                                        const FrameProgress& progress, const FrameSink& sink,
                                        const CancelToken& cancel) {
  Reporter reporter(progress);
  PickedFrames report;
  std::vector<int> chosen;
  {
    LITAGS_ASSIGN_OR_RETURN(const auto video, VideoFile::Open(bytes, field));
    LITAGS_ASSIGN_OR_RETURN(const auto facts, LookAtAll(*video, cancel, reporter, &report));
    report.damaged = video->DamagedFrames();
    report.whole_seconds = video->WholeSeconds();
    chosen = ChooseFrames(facts, most);
  }
  if (chosen.size() < kMinPhotos) {
    return InvalidInput(
        "TOO_FEW_FRAMES", field,
        absl::StrCat(field, ": ", chosen.size(), " of its ", report.frames, " frames can be used; ",
                     "a scene needs ", kMinPhotos, " at least, from different places"));
  }
  LITAGS_ASSIGN_OR_RETURN(const auto video, VideoFile::Open(bytes, field));
  int frame = -1;
  for (const int wanted : chosen) {
    while (frame < wanted) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      LITAGS_ASSIGN_OR_RETURN(const bool more, video->Next());
      if (!more) {
        return InvalidInput("VIDEO_CORRUPT", field,
                            absl::StrCat(field,
                                         ": has fewer frames when it is read again; save it "
                                         "anew with another program"));
      }
      ++frame;
    }
    LITAGS_ASSIGN_OR_RETURN(std::string png, EncodePng16(video->Picture(), video->info().bits));
    if (video->info().panorama) png = WithStatedPanorama(std::move(png));
    LITAGS_RETURN_IF_ERROR(sink(png));
    ++report.chosen;
    reporter.Say(absl::StrCat("frame ", report.chosen, " of ", chosen.size(), " taken"));
  }
  return report;
}

}  // namespace litags
