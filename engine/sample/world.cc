#include "engine/sample/world.h"

#include <limits>
#include <utility>

#include "engine/core/check.h"

namespace litags::sample {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The ray parameters at which a ray enters and leaves a shape, with the outward normals there, in
// the shape's frame.
struct Span {
  double enter, leave;
  Vec3 enter_normal, leave_normal;
};

Vec3 AxisNormal(int axis, double sign) {
  return {axis == 0 ? sign : 0, axis == 1 ? sign : 0, axis == 2 ? sign : 0};
}

bool BoxSpan(const Vec3& half, const Vec3& o, const Vec3& d, Span* span) {
  int in = 0, out = 0;
  double enter = -kInfinity, leave = kInfinity;
  for (int a = 0; a < 3; ++a) {
    if (d[a] == 0) {
      if (std::abs(o[a]) > half[a]) return false;
      continue;
    }
    const double inv = 1 / d[a], side = std::copysign(half[a], d[a]);
    const double t0 = (-side - o[a]) * inv, t1 = (side - o[a]) * inv;
    if (t0 > enter) enter = t0, in = a;
    if (t1 < leave) leave = t1, out = a;
  }
  if (enter > leave) return false;
  *span = {enter, leave, AxisNormal(in, d[in] > 0 ? -1 : 1), AxisNormal(out, d[out] > 0 ? 1 : -1)};
  return true;
}

// Roots of |o + t d|^2 = r^2 over the first `dims` coordinates.
bool RoundSpan(double r, const Vec3& o, const Vec3& d, int dims, Span* span) {
  double a = 0, b = 0, c = -r * r;
  for (int i = 0; i < dims; ++i) a += d[i] * d[i], b += o[i] * d[i], c += o[i] * o[i];
  if (a == 0) {  // along the axis of a cylinder: inside for ever or never
    *span = {-kInfinity, kInfinity, {}, {}};
    return c <= 0;
  }
  const double disc = b * b - a * c;
  if (disc < 0) return false;
  const double root = std::sqrt(disc);
  const double enter = (-b - root) / a, leave = (-b + root) / a;
  Vec3 n0 = (o + d * enter) * (1 / r), n1 = (o + d * leave) * (1 / r);
  if (dims == 2) n0.z = n1.z = 0;
  *span = {enter, leave, n0, n1};
  return true;
}

bool CylinderSpan(const Vec3& half, const Vec3& o, const Vec3& d, Span* span) {
  Span caps;
  if (!RoundSpan(half.x, o, d, 2, span)) return false;
  if (!BoxSpan({kInfinity, kInfinity, half.z}, o, d, &caps)) return false;
  if (caps.enter > span->enter) span->enter = caps.enter, span->enter_normal = caps.enter_normal;
  if (caps.leave < span->leave) span->leave = caps.leave, span->leave_normal = caps.leave_normal;
  return span->enter <= span->leave;
}

bool ShapeSpan(const Shape& shape, const Vec3& o, const Vec3& d, Span* span) {
  switch (shape.kind) {
    case Shape::Kind::kSphere:
      return RoundSpan(shape.half.x, o, d, 3, span);
    case Shape::Kind::kCylinder:
      return CylinderSpan(shape.half, o, d, span);
    case Shape::Kind::kBox:
    case Shape::Kind::kRoom:
      return BoxSpan(shape.half, o, d, span);
  }
  return false;
}

// First t past kEpsilon at which the ray meets the surface; fills the hit if it is before t_max.
bool IntersectShape(const Shape& shape, const Ray& ray, double t_max, Hit* hit) {
  const Vec3 o = shape.frame.FromWorld(ray.origin - shape.center);
  const Vec3 d = shape.frame.FromWorld(ray.direction);
  Span span;
  if (!ShapeSpan(shape, o, d, &span)) return false;
  const bool from_outside = span.enter > World::kEpsilon && shape.kind != Shape::Kind::kRoom;
  const double t = from_outside ? span.enter : span.leave;
  if (t <= World::kEpsilon || t >= t_max) return false;
  hit->t = t;
  hit->local.position = o + d * t;
  hit->local.normal = from_outside ? span.enter_normal : -span.leave_normal;
  hit->normal = shape.frame.ToWorld(hit->local.normal);
  return true;
}

}  // namespace

// A tree over the shapes' bounding boxes, in world coordinates.
class Bvh {
 public:
  Bvh(const std::vector<Shape>& shapes, std::vector<int> members) : order_(std::move(members)) {
    for (const Shape& shape : shapes) bounds_.push_back(BoundsOf(shape));
    if (!order_.empty()) Build(0, order_.size());
  }

  // Calls visit(shape, &t_max) for each shape whose box the ray meets before t_max, near subtree
  // first; stops when it returns true.
  template <typename Visit>
  bool Walk(const Ray& ray, double t_max, Visit visit) const {
    if (nodes_.empty()) return false;
    const Vec3 inverse{1 / ray.direction.x, 1 / ray.direction.y, 1 / ray.direction.z};
    int stack[64], top = 0;
    stack[top++] = 0;
    while (top > 0) {
      const Node& node = nodes_[stack[--top]];
      if (!Meets(node.bounds, ray.origin, inverse, t_max)) continue;
      if (node.shape >= 0) {
        if (visit(node.shape, &t_max)) return true;
        continue;
      }
      const bool flip = ray.direction[node.axis] < 0;
      stack[top++] = flip ? node.left : node.right;
      stack[top++] = flip ? node.right : node.left;
    }
    return false;
  }

 private:
  struct Bounds {
    Vec3 lo, hi;
  };
  struct Node {
    Bounds bounds;
    int left = 0, right = 0;
    int shape = -1;  // of a leaf
    int axis = 0;    // along which an inner node is split
  };

  static Bounds BoundsOf(const Shape& shape) {
    Vec3 half = shape.half;
    if (shape.kind == Shape::Kind::kSphere) half = {half.x, half.x, half.x};
    if (shape.kind == Shape::Kind::kCylinder) half.y = half.x;
    Vec3 reach;
    for (const auto& [axis, h] :
         {std::pair{shape.frame.ex, half.x}, std::pair{shape.frame.ey, half.y},
          std::pair{shape.frame.ez, half.z}}) {
      reach += Max(axis, -axis) * h;
    }
    return {shape.center - reach, shape.center + reach};
  }

  static bool Meets(const Bounds& b, const Vec3& o, const Vec3& inverse, double t_max) {
    const Vec3 t0 = (b.lo - o) * inverse, t1 = (b.hi - o) * inverse;
    const Vec3 near = Min(t0, t1), far = Max(t0, t1);
    const double enter = std::max(std::max(near.x, near.y), std::max(near.z, 0.0));
    const double leave = std::min(std::min(far.x, far.y), std::min(far.z, t_max));
    // Slightly widened, so that rounding never loses a hit on a face of the box.
    return enter * (1 - 1e-12) <= leave * (1 + 1e-12);
  }

  static Bounds Union(const Bounds& a, const Bounds& b) {
    return {Min(a.lo, b.lo), Max(a.hi, b.hi)};
  }
  static double Area(const Bounds& b) {
    const Vec3 s = b.hi - b.lo;
    return s.x * s.y + s.y * s.z + s.z * s.x;
  }

  void SortBy(int axis, size_t first, size_t last) {
    const auto key = [&](int s) { return bounds_[s].lo[axis] + bounds_[s].hi[axis]; };
    std::sort(order_.begin() + first, order_.begin() + last, [&](int a, int b) {
      return std::pair{key(a), a} < std::pair{key(b), b};
    });
  }

  // The cheapest split of order_[first, last), sorted along one axis, by the surface area
  // heuristic: the sum over both sides of count times area.
  std::pair<double, size_t> BestSplit(size_t first, size_t last) const {
    std::vector<double> right(last - first);
    Bounds box = bounds_[order_[last - 1]];
    for (size_t i = last - 1; i > first; --i) {
      box = Union(box, bounds_[order_[i]]);
      right[i - first] = Area(box) * (last - i);
    }
    std::pair<double, size_t> best{kInfinity, first + 1};
    box = bounds_[order_[first]];
    for (size_t i = first + 1; i < last; ++i) {
      best = std::min(best, {Area(box) * (i - first) + right[i - first], i});
      box = Union(box, bounds_[order_[i]]);
    }
    return best;
  }

  int Build(size_t first, size_t last) {
    Bounds box = bounds_[order_[first]];
    for (size_t i = first; i < last; ++i) box = Union(box, bounds_[order_[i]]);
    const int index = static_cast<int>(nodes_.size());
    nodes_.push_back({box, 0, 0, last - first == 1 ? order_[first] : -1, 0});
    if (last - first == 1) return index;

    int axis = 0;
    std::pair<double, size_t> best{kInfinity, 0};
    for (int a = 0; a < 3; ++a) {
      SortBy(a, first, last);
      const auto split = BestSplit(first, last);
      if (split.first < best.first) best = split, axis = a;
    }
    SortBy(axis, first, last);
    const int left = Build(first, best.second), right = Build(best.second, last);
    nodes_[index].left = left;
    nodes_[index].right = right;
    nodes_[index].axis = axis;
    return index;
  }

  std::vector<int> order_;
  std::vector<Bounds> bounds_;
  std::vector<Node> nodes_;
};

World::World(std::vector<Shape> shapes, std::vector<Material> materials, std::vector<Light> lights,
             Vec3 ambient_up, Vec3 ambient_down)
    : shapes_(std::move(shapes)),
      materials_(std::move(materials)),
      lights_(std::move(lights)),
      ambient_up_(ambient_up),
      ambient_down_(ambient_down) {
  std::vector<int> members;
  for (int i = 0; i < static_cast<int>(shapes_.size()); ++i) {
    LITAGS_CHECK(shapes_[i].material >= 0 &&
                 shapes_[i].material < static_cast<int>(materials_.size()));
    if (shapes_[i].kind != Shape::Kind::kRoom) {
      members.push_back(i);
    } else {
      LITAGS_CHECK(room_ < 0);
      room_ = i;
    }
  }
  bvh_ = std::make_unique<Bvh>(shapes_, std::move(members));
}

World::~World() = default;
World::World(World&&) noexcept = default;

bool World::Intersect(const Ray& ray, Hit* hit) const {
  hit->shape = -1;
  bvh_->Walk(ray, kInfinity, [&](int shape, double* t_max) {
    if (IntersectShape(shapes_[shape], ray, *t_max, hit)) {
      *t_max = hit->t;
      hit->shape = shape;
    }
    return false;
  });
  const double nearest = hit->shape >= 0 ? hit->t : kInfinity;
  if (room_ >= 0 && IntersectShape(shapes_[room_], ray, nearest, hit)) hit->shape = room_;
  return hit->shape >= 0;
}

bool World::Occluded(const Ray& ray, double t_max) const {
  Hit hit;
  return bvh_->Walk(ray, t_max, [&](int shape, double* limit) {
    const Vec3& emission = materials_[shapes_[shape].material].emission;
    if (emission.x > 0 || emission.y > 0 || emission.z > 0) return false;
    return IntersectShape(shapes_[shape], ray, *limit, &hit);
  });
}

}  // namespace litags::sample
