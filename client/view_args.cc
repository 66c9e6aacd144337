#include "client/view_args.h"

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/report/text.h"
#include "client/status.h"

namespace litags::client {
namespace {

constexpr size_t kMaxPoseFileBytes = 64 << 10;

// Numbers separated by spaces, commas, semicolons or brackets. INVALID_ARGUMENT (NUMBER_INVALID)
// naming the one that is none.
absl::StatusOr<std::vector<double>> ParseNumbers(const std::string& text,
                                                 const std::string& field) {
  std::vector<double> numbers;
  for (const auto& word :
       absl::StrSplit(text, absl::ByAnyChar(" ,;[]()\t\r\n"), absl::SkipEmpty())) {
    const std::string number(word);
    char* end = nullptr;
    numbers.push_back(std::strtod(number.c_str(), &end));
    if (*end != '\0') {
      return BadInput("NUMBER_INVALID", field,
                      absl::StrCat(field, ": \"", number,
                                   "\" is neither a number nor a file; check the spelling"));
    }
  }
  return numbers;
}

// The 16 numbers themselves or, if the one word names a file, what the file holds.
absl::StatusOr<std::string> PoseText(const std::vector<std::string>& words) {
  std::error_code error;
  if (words.size() != 1 || !std::filesystem::is_regular_file(words[0], error)) {
    return absl::StrJoin(words, " ");
  }
  errno = 0;
  std::ifstream in(words[0], std::ios::binary);
  if (!in.is_open()) {
    return BadInput(
        "FILE_UNREADABLE", "--pose",
        absl::StrCat(words[0], ": cannot be read (", std::generic_category().message(errno),
                     "); give a file with the 16 numbers that you may read"));
  }
  std::string text(kMaxPoseFileBytes + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(in.gcount()));
  if (text.size() > kMaxPoseFileBytes) {
    return BadInput("POSE_INVALID", "--pose",
                    absl::StrCat(words[0], ": too long for 16 numbers; is it the right file?"));
  }
  return text;
}

absl::Status ParseSize(const std::string& text, v1::RenderSettings* settings) {
  const std::vector<std::string> parts = absl::StrSplit(absl::AsciiStrToLower(text), 'x');
  int size[2] = {0, 0};
  bool good = parts.size() == 2 && (!parts[0].empty() || !parts[1].empty());
  for (size_t i = 0; good && i < 2; ++i) {
    if (parts[i].empty()) continue;
    const char* const end = parts[i].data() + parts[i].size();
    const auto result = std::from_chars(parts[i].data(), end, size[i]);
    good = result.ec == std::errc() && result.ptr == end && size[i] > 0;
  }
  if (!good) {
    return BadInput("SIZE_INVALID", "--size",
                    absl::StrCat("--size: \"", text,
                                 "\" is no size; write it as 640x480, 640x or "
                                 "x480"));
  }
  settings->set_width(size[0]);
  settings->set_height(size[1]);
  return absl::OkStatus();
}

absl::Status ParseIntrinsics(const std::string& text, v1::RenderSettings* settings) {
  const auto numbers = ParseNumbers(text, "--intrinsics");
  if (!numbers.ok()) return numbers.status();
  if (numbers->size() != 4) {
    return BadInput("INTRINSICS_INVALID", "--intrinsics",
                    absl::StrCat("--intrinsics: ", report::Counted(numbers->size(), "number"),
                                 "; give four, as fx,fy,cx,cy in pixels"));
  }
  v1::Intrinsics* intrinsics = settings->mutable_intrinsics();
  intrinsics->set_fx((*numbers)[0]);
  intrinsics->set_fy((*numbers)[1]);
  intrinsics->set_cx((*numbers)[2]);
  intrinsics->set_cy((*numbers)[3]);
  return absl::OkStatus();
}

absl::Status ParseChannel(const std::string& text, v1::RenderSettings* settings) {
  if (absl::EqualsIgnoreCase(text, "exposure")) {
    return BadInput("CHANNEL_UNKNOWN", "--channel",
                    "--channel: there is no \"exposure\"; --light T renders R * L^T, --exposure "
                    "STOPS makes the picture brighter or darker");
  }
  v1::Channel channel = v1::CHANNEL_UNSPECIFIED;
  if (!v1::Channel_Parse("CHANNEL_" + absl::AsciiStrToUpper(text), &channel) ||
      channel == v1::CHANNEL_UNSPECIFIED) {
    return BadInput("CHANNEL_UNKNOWN", "--channel",
                    absl::StrCat("--channel: there is no \"", text,
                                 "\"; choose color, original, light, depth, structure, "
                                 "illumination, noise or alpha"));
  }
  settings->set_channel(channel);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Vector3> ParseVector(const std::string& text, const std::string& field) {
  const auto numbers = ParseNumbers(text, field);
  if (!numbers.ok()) return numbers.status();
  if (numbers->size() != 3) {
    return BadInput(
        "VECTOR_INVALID", field,
        absl::StrCat(field, ": \"", text, "\" holds ", report::Counted(numbers->size(), "number"),
                     "; give three, as x,y,z"));
  }
  v1::Vector3 vector;
  vector.set_x((*numbers)[0]);
  vector.set_y((*numbers)[1]);
  vector.set_z((*numbers)[2]);
  return vector;
}

absl::StatusOr<v1::RenderSettings> ParseSettings(const SettingsArgs& args) {
  v1::RenderSettings settings;
  absl::Status status;
  if (!args.size.empty()) status = ParseSize(args.size, &settings);
  if (status.ok() && !args.intrinsics.empty()) {
    status = ParseIntrinsics(args.intrinsics, &settings);
  }
  if (status.ok() && !args.channel.empty()) status = ParseChannel(args.channel, &settings);
  if (!status.ok()) return status;
  if (args.fov_deg) settings.set_vertical_fov_deg(*args.fov_deg);
  if (args.light) {
    settings.set_light(*args.light);
    if (args.channel.empty()) settings.set_channel(v1::CHANNEL_LIGHT);
  }
  if (args.exposure) settings.set_exposure_stops(*args.exposure);
  settings.set_jpeg_quality(args.jpeg_quality);
  return settings;
}

absl::StatusOr<v1::Pose> ParsePose(const PoseArgs& args) {
  const int ways = !args.camera.empty() + !args.pose.empty() + !args.look_at.empty();
  if (ways != 1) {
    return BadInput("POSE_MISSING", "--camera",
                    "say once from where: --camera NAME, --pose FILE or 16 numbers, or "
                    "--look-at EYE TARGET");
  }
  v1::Pose pose;
  if (!args.camera.empty()) {
    pose.set_camera(args.camera);
  } else if (!args.look_at.empty()) {
    const auto eye = ParseVector(args.look_at[0], "--look-at");
    if (!eye.ok()) return eye.status();
    const auto target = ParseVector(args.look_at.size() > 1 ? args.look_at[1] : "", "--look-at");
    if (!target.ok()) return target.status();
    *pose.mutable_look_at()->mutable_eye() = *eye;
    *pose.mutable_look_at()->mutable_target() = *target;
  } else {
    const auto text = PoseText(args.pose);
    if (!text.ok()) return text.status();
    const auto numbers = ParseNumbers(*text, "--pose");
    if (!numbers.ok()) return numbers.status();
    if (numbers->size() != 16) {
      return BadInput("POSE_INVALID", "--pose",
                      absl::StrCat("--pose: ", report::Counted(numbers->size(), "number"),
                                   "; give the 16 of a 4x4 world-to-camera matrix, row by "
                                   "row"));
    }
    pose.mutable_viewmat()->mutable_values()->Add(numbers->begin(), numbers->end());
  }
  if (!args.up.empty()) {
    if (!pose.has_look_at()) {
      return BadInput("UP_WITHOUT_LOOK_AT", "--up", "--up: only goes with --look-at; leave it out");
    }
    const auto up = ParseVector(args.up, "--up");
    if (!up.ok()) return up.status();
    *pose.mutable_look_at()->mutable_up() = *up;
  }
  return pose;
}

}  // namespace litags::client
