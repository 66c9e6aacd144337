// Which views help a view, and how deep its scene is, from the points of structure-from-motion.
#ifndef LITAGS_ENGINE_STEREO_VIEW_PLAN_H_
#define LITAGS_ENGINE_STEREO_VIEW_PLAN_H_

#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/io/sparse_model.h"

namespace litags {

// A sparse point as one view sees it.
struct Anchor {
  double x = 0, y = 0;  // where it projects, px of the view's camera
  double depth = 0;     // along the axis, > 0
};

struct ViewPlan {
  std::vector<int> sources;  // best first; empty: stereo cannot help this view
  double near_depth = 0, far_depth = 0;
  std::vector<Anchor> anchors;  // points that the view took part in finding
};

// One plan per camera. `points[i].track[k].view` is an index into `cameras`. A source shares
// points with the view, and counts for the more the closer the angle under which the two see them
// is to the best one: less gives no depth, more gives pictures that differ.
std::vector<ViewPlan> PlanViews(absl::Span<const Camera> cameras,
                                absl::Span<const SparsePoint> points);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_VIEW_PLAN_H_
