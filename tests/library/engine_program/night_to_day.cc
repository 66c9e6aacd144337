// Draws the first view of a scene in normal light: render_view out/scene.litags view.png
#include <iostream>

#include "engine/io/image_io.h"
#include "engine/pipeline/engine.h"

absl::Status DrawFirstView(const char* scene_path, const char* picture_path) {
  const auto scene = litags::MakeEngine()->LoadScene(scene_path);
  if (!scene.ok()) return scene.status();
  litags::RenderRequest request;
  request.camera = (*scene)->views().front().camera;  // or any other: size, fx fy cx cy, R, t
  const auto picture = (*scene)->Render(request);
  if (!picture.ok()) return picture.status();
  return litags::WritePng(picture_path, litags::ToImageU8(*picture));
}

int main(int argc, char** argv) {
  const absl::Status status = argc == 3
                                  ? DrawFirstView(argv[1], argv[2])
                                  : absl::InvalidArgumentError("give SCENE.litags PICTURE.png");
  if (!status.ok()) std::cerr << status.message() << "\n";
  return status.ok() ? 0 : 1;
}
