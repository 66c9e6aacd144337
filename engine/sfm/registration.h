// Judging a model: is it good enough to train on, and if not, what should the user do.
#ifndef LITAGS_ENGINE_SFM_REGISTRATION_H_
#define LITAGS_ENGINE_SFM_REGISTRATION_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/sfm/photo_set.h"
#include "engine/sfm/sfm.h"

namespace litags {

// Photos that must be placed: min_registered of them, and three (or all, of fewer).
int NeededPhotos(int num_photos, const SfmOptions& options);

// The dropped photos by cause, with up to five names each:
// "2 match no other photo (a.jpg, b.jpg); 1 has too few features (c.jpg)". Empty if none.
std::string SummarizeDrops(const std::vector<SfmPhoto>& photos);

// "2 cameras: 20 photos of 480x361_26mm, 10 photos of 480x361_52mm". Empty for one.
std::string SummarizeCameras(const std::vector<PhotoFile>& photos);

// "photos of 265x475 to 270x480 px, which differ by little, share a lens", for each such lens.
// Empty if there is none.
std::string SummarizeSharedSizes(const std::vector<PhotoFile>& photos);

// FAILED_PRECONDITION SFM_TOO_FEW_REGISTERED. `by` what, and `drops`: which photos have no place.
absl::Status TooFewRegistered(int registered, int num_photos, int needed, const std::string& by,
                              const std::string& drops);

// OK, or FAILED_PRECONDITION SFM_NO_PARALLAX, SFM_NO_MODEL, SFM_SPLIT or SFM_TOO_FEW_REGISTERED.
absl::Status JudgeRegistration(const SfmRung& rung, const std::vector<SfmPhoto>& photos,
                               const SfmOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_REGISTRATION_H_
