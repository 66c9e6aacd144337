// Trains a scene from photos and draws the view of the first of them in normal light:
//   night_to_day PHOTOS WORK_FOLDER VIEW.png [ITERATIONS [CAMERAS]]
#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "litags/engine.h"
#include "litags/picture_io.h"

absl::Status NightToDay(int argc, char** argv) {
  if (argc < 4) return absl::InvalidArgumentError("give PHOTOS WORK_FOLDER VIEW.png");
  litags::ReconstructInput input{.images_dir = argv[1], .work_dir = argv[2]};
  if (argc > 5) input.cameras_path = argv[5];  // else COLMAP finds them
  litags::ReconstructOptions options;
  if (argc > 4) options.iterations = std::atoi(argv[4]);
  std::filesystem::create_directories(input.work_dir);

  const auto engine = litags::MakeEngine();
  const auto report = engine->Reconstruct(input, options, litags::CancelToken(), nullptr);
  if (!report.ok()) return report.status();
  const auto scene = engine->LoadScene(report->scene_path);
  if (!scene.ok()) return scene.status();
  litags::RenderRequest request;
  request.camera = (*scene)->views().front().camera;  // or any other: size, fx fy cx cy, R, t
  const auto picture = (*scene)->Render(request);
  if (!picture.ok()) return picture.status();
  return litags::WritePng(argv[3], litags::ToImageU8(*picture));
}

int main(int argc, char** argv) {
  const absl::Status status = NightToDay(argc, argv);
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
