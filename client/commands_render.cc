// litags render, path, cameras: pictures of a scene.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "client/cli.h"
#include "client/film.h"
#include "client/folder.h"
#include "client/picture_file.h"
#include "client/report/text.h"
#include "client/status.h"
#include "client/view_args.h"
#include "proto/arguments/arguments.h"

namespace litags::client {
namespace {

struct RenderArgs {
  std::string job, output;
  PoseArgs pose;
  SettingsArgs settings;
};

struct PathArgs {
  std::string job, output, format = "png", video;
  int frames_per_second = 30;
  bool orbit = false, closed = false;
  std::vector<std::string> keyframes;
  double radius_scale = 0;
  std::optional<double> sweep_deg;
  std::optional<double> elevation_deg;
  std::optional<int> frames;
  // At the path's ends.
  std::optional<double> light_from, light_to, exposure_from, exposure_to;
  SettingsArgs settings;
};

void AddSettings(CLI::App& command, SettingsArgs& args) {
  command.add_option("--size", args.size,
                     "Size in pixels: 640x480, or 640x or x480 and the other follows");
  CLI::Option* fov = command.add_option("--fov", args.fov_deg, "Vertical field of view in degrees");
  command.add_option("--intrinsics", args.intrinsics, "Lens in pixels: fx,fy,cx,cy")->excludes(fov);
  command.add_option("--channel", args.channel,
                     "color (default), original, light, depth, structure, illumination, noise "
                     "or alpha");
  command.add_option("--light", args.light,
                     "Light: 0 normal, 1 as photographed, and between and beyond, -4..4");
  command.add_option("--exposure", args.exposure,
                     "Of the finished picture, in stops: +1 is twice the light, -10..10");
  command.add_option("--quality", args.jpeg_quality, "Of a JPEG; default: 92")
      ->check(Between(1, 100));
}

// Colours' values are 0 to 1 always, and say nothing.
bool IsColour(v1::Channel channel) {
  return channel == v1::CHANNEL_UNSPECIFIED || channel == v1::CHANNEL_COLOR ||
         channel == v1::CHANNEL_ORIGINAL || channel == v1::CHANNEL_LIGHT;
}

absl::Status CheckQuality(const v1::RenderSettings& settings, const char* remedy) {
  if (settings.jpeg_quality() == 0 || settings.format() == v1::PICTURE_FORMAT_JPEG) {
    return absl::OkStatus();
  }
  return BadInput("OPTION_UNUSED", "--quality",
                  absl::StrCat("--quality is of JPEG pictures alone; leave it out, or ", remedy));
}

int Render(Session& session, const RenderArgs& args) {
  v1::RenderViewRequest request;
  request.set_name(args.job);
  const auto format = PictureFormatOf(args.output);
  if (!format.ok()) return ReportError(session, format.status());
  const auto pose = ParsePose(args.pose);
  if (!pose.ok()) return ReportError(session, pose.status());
  const auto settings = ParseSettings(args.settings);
  if (!settings.ok()) return ReportError(session, settings.status());
  *request.mutable_pose() = *pose;
  *request.mutable_settings() = *settings;
  request.mutable_settings()->set_format(*format);
  const absl::Status used = CheckQuality(request.settings(), "end the file's name with .jpg");
  if (!used.ok()) return ReportError(session, used);

  OutputFile file;  // opened before the server renders for it
  absl::Status status = file.Open(args.output);
  if (!status.ok()) return ReportError(session, status, args.job);
  const auto view = session.client().RenderView(request);
  if (!view.ok()) return ReportError(session, view.status(), args.job);
  const auto bytes = PictureFileBytes(args.output, *view);
  status = bytes.ok() ? file.Write(*bytes) : bytes.status();
  if (status.ok()) status = file.Commit();
  if (!status.ok()) return ReportError(session, status, args.job);
  std::string text = absl::StrCat(args.output, ": ", view->width(), "x", view->height(),
                                  ", iteration ", view->iteration());
  if (view->value_max() != view->value_min() && !IsColour(settings->channel())) {
    absl::StrAppendFormat(&text, ", values %.6g to %.6g", view->value_min(), view->value_max());
  }
  Note(text);
  return kExitOk;
}

absl::StatusOr<v1::RenderPathRequest> MakePathRequest(const PathArgs& args) {
  v1::RenderPathRequest request;
  request.set_name(args.job);
  if (args.frames) request.set_frames(*args.frames);
  const auto format = PictureFormatOf("frame." + args.format);
  if (!format.ok()) {
    return BadInput(
        "PICTURE_FORMAT_UNKNOWN", "--format",
        absl::StrCat("--format: there is no \"", args.format, "\"; choose png, jpg, npy or raw"));
  }
  const auto settings = ParseSettings(args.settings);
  if (!settings.ok()) return settings.status();
  *request.mutable_settings() = *settings;
  request.mutable_settings()->set_format(*format);
  const absl::Status used = CheckQuality(request.settings(), "give --format jpg");
  if (!used.ok()) return used;
  if (args.orbit == !args.keyframes.empty()) {
    return BadInput("PATH_MISSING", "--orbit",
                    "say which way: either --orbit, or --keyframes with two or more cameras");
  }
  for (const std::string& camera : args.keyframes) {
    request.mutable_keyframes()->add_poses()->set_camera(camera);
  }
  if (args.closed && request.has_keyframes()) request.mutable_keyframes()->set_closed(true);
  if (args.orbit) {
    v1::Orbit* orbit = request.mutable_orbit();
    orbit->set_radius_scale(args.radius_scale);
    if (args.sweep_deg) orbit->set_sweep_deg(*args.sweep_deg);
    if (args.elevation_deg) orbit->set_elevation_deg(*args.elevation_deg);
  }
  if (args.light_from) {
    request.mutable_light()->set_first(*args.light_from);
    request.mutable_light()->set_last(*args.light_to);
  }
  if (args.exposure_from) {
    request.mutable_exposure_stops()->set_first(*args.exposure_from);
    request.mutable_exposure_stops()->set_last(*args.exposure_to);
  }
  return request;
}

absl::Status MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error && std::filesystem::is_directory(path, error)) return absl::OkStatus();
  return BadInput("OUTPUT_NOT_WRITABLE", "-o",
                  absl::StrCat(path, ": the folder cannot be made (", error.message(),
                               "); choose another one"));
}

// Pictures of a longer path before this one would be taken for its end, by ffmpeg for instance.
absl::Status CheckNoLaterFrames(const PathArgs& args, int frames) {
  std::error_code ignored;
  for (const std::filesystem::directory_entry& entry : EntriesOf(args.output, &ignored)) {
    const std::string name = entry.path().filename().string();
    int number = 0;
    absl::string_view rest = name;
    if (!absl::ConsumePrefix(&rest, "frame_") || !absl::ConsumeSuffix(&rest, "." + args.format) ||
        !absl::SimpleAtoi(rest, &number) || number < frames) {
      continue;
    }
    return BadInput(
        "OUTPUT_HAS_FRAMES", "-o",
        absl::StrCat(args.output, ": ", name, " is of an earlier path, which had more ",
                     "than the ", report::Counted(frames, "frame"),
                     " of this one; remove the earlier ones, or choose another folder"));
  }
  return absl::OkStatus();
}

// What there is to make of a path's pictures: a folder of files, a video, or both.
absl::Status CheckOutputs(const PathArgs& args) {
  if (args.output.empty() && args.video.empty()) {
    return BadInput("OUTPUT_MISSING", "-o",
                    "say where the pictures go: -o FOLDER, --video FILE, or both");
  }
  const auto format = PictureFormatOf("frame." + args.format);
  const bool encodes =
      format.ok() && (*format == v1::PICTURE_FORMAT_PNG || *format == v1::PICTURE_FORMAT_JPEG);
  if (!args.video.empty() && !encodes) {
    return BadInput("PICTURE_FORMAT_UNKNOWN", "--format",
                    absl::StrCat("--format: a video is made of png or jpg pictures, not of ",
                                 args.format, "; leave it out, or write files in another call"));
  }
  if (!args.video.empty() && !absl::EndsWithIgnoreCase(args.video, ".webm") &&
      !absl::EndsWithIgnoreCase(args.video, ".mp4")) {
    return BadInput("VIDEO_FORMAT_UNKNOWN", "--video",
                    absl::StrCat(args.video,
                                 ": the name does not say a video format; end it with "
                                 ".webm or .mp4"));
  }
  return absl::OkStatus();
}

// Passes the pictures on as they arrive; returns how many there were.
absl::StatusOr<int> WritePath(Session& session, const v1::RenderPathRequest& request,
                              const PathArgs& args, Film* film) {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  int frames = 0;
  bool made = false;
  const absl::Status status =
      session.client().RenderPath(request, [&](const v1::RenderPathResponse& response) {
        const std::string name = absl::StrFormat("frame_%04d.%s", response.frame(), args.format);
        frames = response.frame() + 1;
        if (terminal) std::fprintf(stderr, "\rframe %d/%d\x1b[K", frames, response.frames());
        absl::Status written;
        // Not before the first picture: a path that is refused leaves no folder.
        if (!args.output.empty() && !made) {
          written = CheckNoLaterFrames(args, response.frames());
          if (written.ok()) written = MakeFolder(args.output);
        }
        made = true;
        if (written.ok() && !args.output.empty()) {
          written =
              WritePicture((std::filesystem::path(args.output) / name).string(), response.view());
        }
        if (written.ok() && !args.video.empty()) written = film->Add(response.view().data());
        return written;
      });
  if (terminal && frames > 0) std::fputc('\n', stderr);
  if (!status.ok()) return status;
  return frames;
}

int Path(Session& session, const PathArgs& args) {
  const auto request = MakePathRequest(args);
  if (!request.ok()) return ReportError(session, request.status());
  absl::Status status = CheckOutputs(args);
  Film film;
  if (status.ok() && !args.video.empty()) status = film.Start(args.video, args.frames_per_second);
  const auto fail = [&](const absl::Status& why) {
    return film.said_why() ? kExitBadInput : ReportError(session, why, args.job);
  };
  if (!status.ok()) return fail(status);
  const auto frames = WritePath(session, *request, args, &film);
  if (!frames.ok()) return fail(frames.status());
  if (!args.output.empty()) {
    Note(absl::StrCat(args.output, ": ", report::Counted(*frames, "frame")));
  }
  if (args.video.empty()) return kExitOk;
  status = film.Finish();
  if (!status.ok()) return fail(status);
  Note(absl::StrCat(args.video, ": ", report::Counted(*frames, "frame"), ", ",
                    args.frames_per_second, " a second"));
  return kExitOk;
}

// Where the camera stands: -R^T t.
v1::Vector3 Center(const v1::Camera& camera) {
  v1::Vector3 center;
  const auto& m = camera.viewmat().values();
  if (m.size() != 16) return center;
  double c[3];
  for (int i = 0; i < 3; ++i) c[i] = -(m[i] * m[3] + m[4 + i] * m[7] + m[8 + i] * m[11]);
  center.set_x(c[0]);
  center.set_y(c[1]);
  center.set_z(c[2]);
  return center;
}

// As --look-at and --crop take it; in map coordinates millimetres are still told.
std::string PositionText(const v1::Vector3& at) {
  return absl::StrFormat("%.10g,%.10g,%.10g", at.x(), at.y(), at.z());
}

int Cameras(Session& session, const std::string& job, bool json) {
  const auto list = session.client().ListCameras(job);
  if (!list.ok()) return ReportError(session, list.status(), job);
  if (json) {
    PrintJson(*list, /*pretty=*/false);
    return kExitOk;
  }
  size_t widest = 28;
  for (const auto& named : list->cameras()) {
    widest = std::max(widest, report::ColumnsOf(report::Printable(named.name())));
  }
  std::printf("%s %-11s %10s  %s\n", report::Padded("CAMERA", widest).c_str(), "SIZE", "FOCAL",
              "POSITION");
  for (const auto& named : list->cameras()) {
    std::printf("%s %-11s %10.2f  %s\n",
                report::Padded(report::Printable(named.name()), widest).c_str(),
                absl::StrCat(named.camera().width(), "x", named.camera().height()).c_str(),
                named.camera().intrinsics().fx(), PositionText(Center(named.camera())).c_str());
  }
  std::printf("center %s  up %.4g,%.4g,%.4g  radius %.4g  iteration %d\n",
              PositionText(list->center()).c_str(), list->up().x(), list->up().y(), list->up().z(),
              list->radius(), list->iteration());
  return kExitOk;
}

// --NAME-from and --NAME-to: the slider of --NAME, moved along the path.
void AddRamp(CLI::App& path, const std::string& name, std::optional<double>& from,
             std::optional<double>& to) {
  CLI::Option* first = path.add_option(
      "--" + name + "-from", from,
      "In the first frame, as --" + name + "; evenly to --" + name + "-to in the last");
  CLI::Option* last = path.add_option("--" + name + "-to", to, "In the last frame");
  first->needs(last)->excludes(path.get_option("--" + name));
  last->needs(first);
}

void AddPath(CLI::App& app, Session& session) {
  auto args = std::make_shared<PathArgs>();
  CLI::App* path = app.add_subcommand("path", "Pictures along a path, written as they arrive");
  AddJobArgument(*path, args->job);
  CLI::Option* orbit = path->add_flag("--orbit", args->orbit, "Around the scene");
  path->add_option("--radius-scale", args->radius_scale, "Of the orbit, times the scene's radius")
      ->needs(orbit);
  path->add_option("--elevation", args->elevation_deg, "Of the orbit, degrees")->needs(orbit);
  path->add_option("--sweep", args->sweep_deg,
                   "Of the orbit, degrees; default: as far round as there are photos")
      ->needs(orbit);
  path->add_option("--keyframes", args->keyframes,
                   "Through these cameras, by their photos' names; JOB stands before it")
      ->excludes(orbit);
  path->add_flag("--closed", args->closed, "From the last keyframe back to the first")
      ->excludes(orbit);
  path->add_option("--frames", args->frames, "Number of pictures (60)")->check(Between(1, 10000));
  path->add_option("--format", args->format, "png (default), jpg, npy or raw");
  AddSettings(*path, args->settings);
  AddRamp(*path, "light", args->light_from, args->light_to);
  AddRamp(*path, "exposure", args->exposure_from, args->exposure_to);
  path->add_option("-o,--output", args->output, "Folder for frame_0000.png and so on");
  CLI::Option* video = path->add_option(
      "--video", args->video, "Video file: .webm (VP9) or .mp4 (H.264); instead of -o, or as well");
  path->add_option("--fps", args->frames_per_second, "Of the video, pictures a second")
      ->capture_default_str()
      ->check(Between(1, 120))
      ->needs(video);
  path->callback([&session, args] { session.exit_code = Path(session, *args); });
}

}  // namespace

void AddRenderCommands(CLI::App& app, Session& session) {
  auto args = std::make_shared<RenderArgs>();
  CLI::App* render =
      app.add_subcommand("render", "One picture, also of a job that is still training");
  AddJobArgument(*render, args->job);
  render->add_option("--camera", args->pose.camera, "From where this photo was taken");
  render
      ->add_option(
          "--pose", args->pose.pose,
          "World-to-camera matrix: 16 numbers row by row, or a file with them; x right, y "
          "down, z forward (OpenCV), as litags cameras JOB --json prints; JOB stands before "
          "it")
      ->expected(1, 16);
  render->add_option("--look-at", args->pose.look_at, "Eye and target: x,y,z x,y,z")->expected(2);
  render->add_option("--up", args->pose.up, "With --look-at: what appears upwards, x,y,z");
  AddSettings(*render, args->settings);
  render->add_option("-o,--output", args->output, "File: .png, .jpg, .npy or .raw")->required();
  render->callback([&session, args] { session.exit_code = Render(session, *args); });

  AddPath(app, session);

  struct CamerasArgs {
    std::string job;
    bool json = false;
  };
  auto cameras_args = std::make_shared<CamerasArgs>();
  CLI::App* cameras = app.add_subcommand("cameras", "The photos' cameras and the scene's region");
  AddJobArgument(*cameras, cameras_args->job);
  cameras->add_flag("--json", cameras_args->json, "As JSON");
  cameras->callback([&session, cameras_args] {
    session.exit_code = Cameras(session, cameras_args->job, cameras_args->json);
  });
}

}  // namespace litags::client
