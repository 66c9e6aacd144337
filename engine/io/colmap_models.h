// Inside this module: COLMAP's camera models.
#ifndef LITAGS_ENGINE_IO_COLMAP_MODELS_H_
#define LITAGS_ENGINE_IO_COLMAP_MODELS_H_

#include <cstdint>
#include <string_view>

namespace litags {

// Their numbers in cameras.bin.
enum ColmapModel : int32_t {
  kSimplePinhole = 0,        // f cx cy
  kPinhole = 1,              // fx fy cx cy
  kSimpleRadial = 2,         // f cx cy k
  kRadial = 3,               // f cx cy k1 k2
  kOpenCv = 4,               // fx fy cx cy k1 k2 p1 p2
  kOpenCvFisheye = 5,        // fx fy cx cy k1 k2 k3 k4
  kFullOpenCv = 6,           // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6
  kFov = 7,                  // no photo of it is read
  kSimpleRadialFisheye = 8,  // f cx cy k
  kRadialFisheye = 9,        // f cx cy k1 k2
};

struct ColmapModelInfo {
  ColmapModel number;
  std::string_view name;  // in cameras.txt
  int params;
};
inline constexpr ColmapModelInfo kColmapModels[] = {
    {kSimplePinhole, "SIMPLE_PINHOLE", 3},
    {kPinhole, "PINHOLE", 4},
    {kSimpleRadial, "SIMPLE_RADIAL", 4},
    {kRadial, "RADIAL", 5},
    {kOpenCv, "OPENCV", 8},
    {kOpenCvFisheye, "OPENCV_FISHEYE", 8},
    {kFullOpenCv, "FULL_OPENCV", 12},
    {kFov, "FOV", 5},
    {kSimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4},
    {kRadialFisheye, "RADIAL_FISHEYE", 5}};
inline constexpr int kMaxColmapParams = 12;

// Null: a prism, or a model of a newer COLMAP.
inline const ColmapModelInfo* FindColmapModel(int32_t number) {
  for (const ColmapModelInfo& model : kColmapModels) {
    if (model.number == number) return &model;
  }
  return nullptr;
}
inline const ColmapModelInfo* FindColmapModel(std::string_view name) {
  for (const ColmapModelInfo& model : kColmapModels) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_COLMAP_MODELS_H_
