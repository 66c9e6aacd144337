#include "engine/pipeline/video_frames.h"

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/io/file_util.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/video/frame_process.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMaxNoteBytes = 64 << 10;
// Of a video's frames: so many that are damaged are told. A cut leaves a few that need others.
constexpr double kNotableDamage = 0.02;

// Tells videos apart by length, head and tail: reading gigabytes twice takes longer than looking
// at the frames of most videos.
std::string KeyOf(const std::string& path, int frames) {
  constexpr std::streamoff kEnds = 1 << 20;
  Fingerprint key;
  std::ifstream in(path, std::ios::binary);
  in.seekg(0, std::ios::end);
  const std::streamoff size = in.tellg();
  key.Add(static_cast<int64_t>(size));
  key.Add(frames);
  std::string part(static_cast<size_t>(kEnds), '\0');
  for (const std::streamoff from : {std::streamoff{0}, std::max<std::streamoff>(0, size - kEnds)}) {
    in.clear();
    in.seekg(from);
    in.read(part.data(), kEnds);
    key.Add(part.data(), static_cast<size_t>(in.gcount()));
  }
  return key.Text();
}

std::string Describe(const std::string& name, const PickedFrames& picked) {
  std::string text = absl::StrFormat(
      "%d of the %d frames of %s (%.1f s) are the photos: sharp ones at equal "
      "steps of the camera's way",
      picked.chosen, picked.frames, name, picked.seconds);
  if (picked.whole_seconds > 0) {
    absl::StrAppendFormat(&text, "; the file should last %.1f s: its end is missing",
                          picked.whole_seconds);
  }
  const double all = picked.frames + static_cast<double>(picked.damaged);
  if (static_cast<double>(picked.damaged) > kNotableDamage * all) {
    absl::StrAppendFormat(&text,
                          "; %d frames more are damaged and were passed over: copy the video from "
                          "the camera again",
                          picked.damaged);
  }
  return text;
}

absl::Status CheckInputIsVideoAlone(const ReconstructInput& input) {
  std::vector<std::string> beside;
  if (!input.cameras_path.empty()) beside.emplace_back("cameras");
  if (!input.depth_dir.empty()) beside.emplace_back("depth maps");
  if (!input.masks_dir.empty()) beside.emplace_back("masks");
  return CheckVideoAlone(beside);
}

}  // namespace

absl::Status CheckVideoAlone(absl::Span<const std::string> beside) {
  if (beside.empty()) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "VIDEO_NOT_ALONE", "videos",
      absl::StrCat("videos: with the video there are ", absl::StrJoin(beside, ", "),
                   ", of photos by their names; which frames become the photos is "
                   "chosen later: cut frames out of the video first (ffmpeg -i VIDEO "
                   "-r 2 frames/%04d.png) and give these as photos, or leave them out"));
}

absl::StatusOr<ReconstructInput> WithFramesAsPhotos(
    const ReconstructInput& input, int frames, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes) {
  if (input.video_path.empty()) return input;
  LITAGS_RETURN_IF_ERROR(CheckInputIsVideoAlone(input));
  ReconstructInput result = input;
  result.images_dir = input.work_dir + "/frames";
  result.video_path.clear();
  const std::string name = BaseName(input.video_path), field = absl::StrCat("videos[", name, "]");
  const std::string key = KeyOf(input.video_path, frames), done = input.work_dir + "/frames.txt";
  // The key, and the note of the run that picked them.
  if (const auto kept = ReadFile(done, "frames", kMaxNoteBytes);
      kept.ok() && kept->starts_with(key + "\n")) {
    notes->push_back(kept->substr(key.size() + 1));
    return result;
  }
  progress(absl::StrCat("choosing frames of ", name));
  LITAGS_RETURN_IF_ERROR(CheckOwnFolder(result.images_dir));
  std::error_code ignored;  // writing it says what is wrong
  fs::remove(done, ignored);
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(result.images_dir));
  LITAGS_ASSIGN_OR_RETURN(
      const PickedFrames picked,
      PickFramesInto(
          result.images_dir, input.video_path, field, frames, input.frame_program,
          [&](const std::string& text) { progress(absl::StrCat(name, ": ", text)); }, cancel));
  notes->push_back(Describe(name, picked));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(done, absl::StrCat(key, "\n", notes->back())));
  return result;
}

}  // namespace litags
