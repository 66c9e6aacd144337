// Photos that were taken from one place at once, as the views of a panorama.
#ifndef LITAGS_ENGINE_IO_RIG_H_
#define LITAGS_ENGINE_IO_RIG_H_

#include <array>
#include <map>
#include <string>

namespace litags {

// A photo of a rig. All of a rig have one camera centre and one exposure; their lenses are known.
struct RigView {
  std::string rig;
  std::array<double, 9> R = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // rig from camera, row-major
  double focal_length = 0;                                // px of the photo; pinhole
  // What the file says that the photo was cut from, as ImageInfo has it; 0: not said.
  double exposure_time = 0, iso = 0, f_number = 0;
  int chroma_step = 0;
};

// By the photo's name.
using RigViews = std::map<std::string, RigView>;

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_RIG_H_
