// Cameras of photos of rigs that could not be placed by themselves.
#ifndef LITAGS_ENGINE_SFM_RIGS_H_
#define LITAGS_ENGINE_SFM_RIGS_H_

#include <vector>

#include "engine/io/rig.h"
#include "engine/io/sparse_model.h"
#include "engine/sfm/photo_set.h"

namespace litags {

// Gives every photo of a rig of which the model has a view, but not the photo's, its camera: that
// of the view of the rig with most points, turned. Views stay sorted by name.
void PlaceRigViews(const RigViews& rigs, const std::vector<PhotoFile>& photos, SparseModel* model);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_RIGS_H_
