// Procedural surfaces: albedo as a function of the place on the shape. All are rich in unrepeated
// detail down to a few millimetres, so that features can be matched between views.
#ifndef LITAGS_ENGINE_SAMPLE_TEXTURE_H_
#define LITAGS_ENGINE_SAMPLE_TEXTURE_H_

#include <cstdint>
#include <functional>
#include <utility>

#include "engine/core/image.h"
#include "engine/sample/vec.h"
#include "engine/sample/world.h"

namespace litags::sample {

using Texture = std::function<Vec3(const SurfacePoint&)>;

// 0xRRGGBB in sRGB codes to linear light.
Vec3 Rgb(uint32_t srgb);

// Random number in [0, 1) that belongs to a lattice cell.
double CellNoise(int x, int y, int z, uint64_t seed);

// Smooth noise in [0, 1] with features of about one unit; `octaves` halve size and amplitude.
double Noise(const Vec3& p, int octaves, uint64_t seed);

// The coordinates along the face of a box (or room) that a point lies on, metres: the two axes
// across the dominant normal, in the order x, y, z.
std::pair<double, double> FaceUv(const SurfacePoint& point);

// One colour with mottling and fine speckle; amount is the relative contrast.
Texture Speckled(Vec3 color, double amount, uint64_t seed);

// Grain along x.
Texture Wood(Vec3 light, Vec3 dark, uint64_t seed);

// Boards of the given width along the face's first axis, each of its own tint.
Texture Planks(Vec3 light, Vec3 dark, double width, uint64_t seed);

Texture Bricks(Vec3 brick, Vec3 mortar, uint64_t seed);

// Random cells of size `cell` metres in colours of the palette, on a ground: terrazzo, foliage.
Texture Terrazzo(Vec3 ground, std::vector<Vec3> palette, double cell, uint64_t seed);

// Marble: veins of `vein` in `ground`.
Texture Marble(Vec3 ground, Vec3 vein, double scale, uint64_t seed);

// Segments around the z axis, cycling through the colours, with poles of `cap`.
Texture BeachBall(std::vector<Vec3> colors, Vec3 cap, int segments, uint64_t seed);

// Rings across the z axis in the colours given, each `width` metres high.
Texture Rings(std::vector<Vec3> colors, double width, uint64_t seed);

// Woven bands and diamonds; half extents of the rug, metres.
Texture Rug(double half_x, double half_y, uint64_t seed);

// A book lying or standing: cover with title bands, pages on the faces across `pages_axis`.
Texture Book(Vec3 cover, Vec3 band, int pages_axis, uint64_t seed);

// A picture on the face across -y of a box of these half extents; `side` elsewhere.
Texture Picture(ImageU8 image, double half_x, double half_z, Vec3 side);

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_TEXTURE_H_
