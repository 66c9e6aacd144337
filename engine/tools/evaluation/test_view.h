// A camera that a scene is judged from, and the photos that were taken there.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_TEST_VIEW_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_TEST_VIEW_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/core/photo.h"
#include "engine/io/sparse_model.h"

namespace litags {

struct TestView {
  View view;              // without lens distortion, as scenes are rendered
  Distortion distortion;  // of the photos as they were taken
};

// For a NameIndex.
std::vector<std::string> NamesOf(const std::vector<View>& views);
std::vector<std::string> NamesOf(const std::vector<TestView>& views);

// Path of the photo of this name, or else of this stem, in `dir`; NOT_FOUND (NO_SUCH_PHOTO).
absl::StatusOr<std::string> FindPhoto(const std::string& dir, const std::string& name);

// That photo as the view's pinhole camera sees it: resized to it and undistorted. With a camera of
// no size, as it is. SIZE_MISMATCH if it has another shape.
absl::StatusOr<Photo> LoadPhoto(const std::string& dir, const TestView& view);

// The same with 8 bits.
absl::StatusOr<ImageU8> LoadPicture(const std::string& dir, const TestView& view);

// Makes the view's camera one of its photo in `dir`, if there is one, as training does: turned
// upright and scaled. Errors of FitToPhoto, with `has_own_size`, and of reading.
absl::Status FitToPhotoIn(const std::string& dir, bool has_own_size, TestView* view);

// The same views with cameras of the size of their photos in `dir`. CAMERA_SIZE_MISMATCH, errors of
// FindPhoto and of reading.
absl::StatusOr<std::vector<TestView>> AtSizeOfPhotos(std::vector<TestView> views,
                                                     const std::string& dir);

// The same views with cameras of at most `max_side` px on the longer side (0: any), as training
// shrinks larger photos: renders and scores are of the size that was trained.
std::vector<TestView> AtMost(int max_side, std::vector<TestView> views);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_TEST_VIEW_H_
