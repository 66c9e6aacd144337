// A folder that programs laid out: the photos, their cameras and masks are in folders within.
#ifndef LITAGS_ENGINE_TOOLS_INSPECT_DATASET_FOLDER_H_
#define LITAGS_ENGINE_TOOLS_INSPECT_DATASET_FOLDER_H_

#include <string>

#include "absl/status/status.h"

namespace litags {

// If `*photos` holds no photos itself, but a folder images (or images_2, ...) within does: puts the
// folders of the dataset in place of what the user did not name, as an archive of it would bring
// them, and says so on stderr. INVALID_ARGUMENT (CAMERAS_TWICE): it has several files of cameras,
// and `with_cameras`.
absl::Status UseDatasetFolder(bool with_cameras, std::string* photos, std::string* cameras,
                              std::string* masks, std::string* depth);

// If no `*masks` are named, takes the folder masks within the folder of photos, if there is one,
// and says so on stderr.
void UseMasksBeside(const std::string& photos, std::string* masks);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INSPECT_DATASET_FOLDER_H_
