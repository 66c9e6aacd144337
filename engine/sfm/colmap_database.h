// The parts of COLMAP's SQLite database that its commands do not tell.
#ifndef LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_
#define LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/sfm/descriptor_match.h"

namespace litags {

struct DatabaseImage {
  int id = 0;        // COLMAP's, from 1
  std::string name;  // path under the image folder
  int features = 0;
};

// Two images, by id, whose matches agree on one relative pose.
struct VerifiedPair {
  int id1 = 0, id2 = 0;
  // A homography explains them, too: the camera turned in place, or what both see is flat.
  bool flat = false;
};

// Matches of two images, by id, id1 < id2.
struct ImageMatches {
  int id1 = 0, id2 = 0;
  std::vector<FeatureMatch> matches;
};

// In id order. INTERNAL COLMAP_DATABASE if the file is not a COLMAP 3.8 database.
absl::StatusOr<std::vector<DatabaseImage>> ReadDatabaseImages(const std::string& path);

// Pairs with at least kMinInliers verified matches.
absl::StatusOr<std::vector<VerifiedPair>> ReadVerifiedPairs(const std::string& path);

// Descriptors [features, 128] of each image; none for an image without features. INTERNAL
// COLMAP_DATABASE if they are damaged or not as many as the image has keypoints.
absl::StatusOr<std::vector<std::vector<uint8_t>>> ReadDescriptors(
    const std::string& path, const std::vector<DatabaseImage>& images);

// All stored matches that are not empty, by ascending ids.
absl::StatusOr<std::vector<ImageMatches>> ReadMatches(const std::string& path);

// Of pairs with at least kMinInliers verified matches, these; otherwise as ReadMatches.
absl::StatusOr<std::vector<ImageMatches>> ReadVerifiedMatches(const std::string& path);

// Stores the matches of these pairs in place of all that were there.
absl::Status WriteMatches(const std::string& path, const std::vector<ImageMatches>& pairs);

// Takes out the verified pairs.
absl::Status ForgetVerifiedPairs(const std::string& path);

// A copy without what only matching needs, and without verified pairs, in place of `to`.
absl::Status CopyForVerification(const std::string& from, const std::string& to);

// Puts the verified pairs of those databases into this one.
absl::Status TakeVerifiedPairs(const std::vector<std::string>& from, const std::string& path);

// Numbers the images 1, 2, ... in the order of `names`, then those that are not among them by name:
// COLMAP's own numbers tell the order in which its threads were done.
absl::Status NumberImages(const std::string& path, const std::vector<std::string>& names);

// Focal lengths of images by name, px of the image.
using FocalLengths = std::vector<std::pair<std::string, double>>;

// Gives the camera of each image this focal length, without distortion, as one that is known.
// Cameras are SIMPLE_RADIAL.
absl::Status SetFocalLengths(const std::string& path, const FocalLengths& focal_lengths);

// Makes the camera of each image a RADIAL_FISHEYE, equidistant, of this focal length, as a guess.
absl::Status SetFisheyes(const std::string& path, const FocalLengths& focal_lengths);

// Takes the features of each image that has fewer than `least` out, so that COLMAP looks for them
// again. The images' names.
absl::StatusOr<std::vector<std::string>> TakeFewFeaturesOut(const std::string& path, int least);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_
