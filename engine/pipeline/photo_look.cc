#include "engine/pipeline/photo_look.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_format.h"
#include "engine/core/color.h"
#include "engine/core/quantile.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/capture_checks.h"
#include "engine/pipeline/fingerprint.h"
#include "engine/pipeline/photo_structure.h"
#include "engine/video/frame_choice.h"

namespace litags {
namespace {

// Of the middle photo's light. A lens cap lets nothing through; a photo of a bare wall, which may
// show as little, is as light as the others.
constexpr double kUnlit = 0.5;

// Channels that differ by less are the same but for rounding.
constexpr int kSameSample = kPhotoCode / 8;

// Whether `a` is kept, of two photos with the same pixels. Copies have longer names, as
// "0001 (1).jpg".
bool IsKept(const ScreenedPhoto& a, const ScreenedPhoto& b) {
  const auto rank = [](const ScreenedPhoto& photo) {
    return std::tuple(-photo.named_by_cameras, !photo.has_depth_map, photo.name.size());
  };
  return rank(a) < rank(b);
}

// The photos to keep, by their pixels.
std::map<std::string, const ScreenedPhoto*> Originals(absl::Span<const ScreenedPhoto> photos) {
  std::map<std::string, const ScreenedPhoto*> originals;
  for (const ScreenedPhoto& photo : photos) {
    if (photo.pixels.empty()) continue;
    const ScreenedPhoto*& original = originals.emplace(photo.pixels, &photo).first->second;
    if (IsKept(photo, *original)) original = &photo;
  }
  return originals;
}

// Of a shape that no camera writes but as a panorama: a cylinder, of which a pinhole picture cannot
// be told without its angle. Choice
constexpr int kStrip = 3;  // sides

bool IsStrip(const ScreenedPhoto& photo) {
  return !photo.has_views &&
         (photo.width >= kStrip * photo.height || photo.height >= kStrip * photo.width);
}

// At the size that sharpness and detail are measured at.
Planes SmallLuma(const Photo& photo) {
  const Photo small = ShrinkToFit(photo, kMeasuredSide);
  Planes luma(1, small.height, small.width);
  for (size_t i = 0; i < small.pixels(); ++i) {
    const int16_t* p = &small.data[3 * i];
    luma.data[i] = Luma(EncodedOf(p[0]), EncodedOf(p[1]), EncodedOf(p[2]));
  }
  return luma;
}

bool IsGrey(const Photo& photo) {
  for (size_t i = 0; i < photo.data.size(); i += 3) {
    const auto [least, most] = std::minmax({photo.data[i], photo.data[i + 1], photo.data[i + 2]});
    if (most - least > kSameSample) return false;
  }
  return true;
}

}  // namespace

std::string DescribeFlat(const std::array<uint8_t, 3>& color) {
  return absl::StrFormat("is of one colour, (%d, %d, %d)", color[0], color[1], color[2]);
}

ScreenedPhoto LookAt(std::string name, const Photo& photo) {
  ScreenedPhoto look;
  look.name = std::move(name);
  look.width = photo.width;
  look.height = photo.height;
  double codes = 0, light = 0;
  for (const int16_t sample : photo.data) {
    codes += sample;
    light += LinearTable::Get()(sample);
  }
  look.mean_code = codes / photo.data.size() / kPhotoCode;
  look.light = light / photo.data.size();
  look.flat = FlatColor(photo);
  look.grey = IsGrey(photo);
  const Planes luma = SmallLuma(photo);
  look.sharpness = SharpnessOf(luma);
  look.detail = DetailOf(luma);
  look.structure = look.flat.has_value() ? 1 : StructureOf(photo);
  if (!look.flat.has_value()) {
    Fingerprint f;
    f.Add(photo.data.data(), photo.data.size() * sizeof(int16_t));
    look.pixels = f.Text();
  }
  return look;
}

double MiddleOf(absl::Span<const ScreenedPhoto> photos, double ScreenedPhoto::*member) {
  std::vector<double> values;
  for (const ScreenedPhoto& photo : photos) values.push_back(photo.*member);
  return MedianInPlace(values);
}

bool HasCopies(absl::Span<const ScreenedPhoto> photos) {
  std::set<std::string> pixels;
  return std::any_of(photos.begin(), photos.end(), [&](const ScreenedPhoto& photo) {
    return !photo.pixels.empty() && !pixels.insert(photo.pixels).second;
  });
}

std::vector<std::string> WhyLeftOut(absl::Span<const ScreenedPhoto> photos) {
  const std::map<std::string, const ScreenedPhoto*> originals = Originals(photos);
  const auto original = [&](const ScreenedPhoto& photo) {
    const auto same = originals.find(photo.pixels);
    return same == originals.end() ? photo.name : same->second->name;
  };
  std::vector<double> light, fine;
  for (const ScreenedPhoto& photo : photos) {
    if (photo.flat.has_value() || original(photo) != photo.name) continue;
    light.push_back(photo.light);
    fine.push_back(photo.detail.fine);
  }
  const double middle_light = MedianInPlace(light), middle_fine = MedianInPlace(fine);
  // Where most photos are strips, they were cut so: that changes no camera.
  const bool cut = 2 * std::count_if(photos.begin(), photos.end(), IsStrip) >
                   static_cast<std::ptrdiff_t>(photos.size());
  std::vector<std::string> why;
  for (const ScreenedPhoto& photo : photos) {
    if (photo.flat.has_value()) {
      why.push_back(DescribeFlat(*photo.flat));
    } else if (original(photo) != photo.name) {
      why.push_back("is the same photo as " + original(photo));
    } else if (photo.structure < kNoStructure && photo.light < kUnlit * middle_light) {
      why.push_back(
          absl::StrFormat("shows nothing but noise (mean code %.1f of 255), as "
                          "behind a lens cap",
                          photo.mean_code));
    } else if (IsBlurred(photo.detail, middle_fine)) {
      why.push_back(
          absl::StrFormat("is blurred: it has %.0f %% of the fine detail that the others have",
                          100 * photo.detail.fine / middle_fine));
    } else if (IsStrip(photo) && !cut) {
      why.push_back(absl::StrFormat(
          "is a strip of %dx%d px, as a panorama whose angles are not known: send the photos that "
          "it was made of, or one whose metadata (GPano) tell its part of the sphere",
          photo.width, photo.height));
    } else {
      why.push_back("");
    }
  }
  return why;
}

}  // namespace litags
