// litags-test-video FOLDER OUT: the photos of a folder as a phone's video, for tests. The phone is
// held upright, so that its sensor sees them on their side.
#include <string>
#include <vector>

#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/video/testing_video.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const std::string folder = argv[1];
  const auto names = litags::ListPhotos(folder, folder);
  if (!names.ok()) return 1;
  std::vector<litags::ImageU8> frames;
  for (const std::string& name : *names) {
    const auto photo = litags::ReadImage(folder + "/" + name, name);
    if (!photo.ok()) return 1;
    frames.insert(frames.end(), 3, litags::OnItsSide(*photo));
  }
  litags::TestVideo phone;
  phone.quarters = 1;
  return litags::WriteFileAtomically(argv[2], litags::EncodeVideo(frames, phone)).ok() ? 0 : 1;
}
