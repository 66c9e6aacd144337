#include "client/report/cameras.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "client/report/text.h"

namespace litags::report {
namespace {

constexpr char kLeftOut[] = " is left out: ";

// The plan's drawing: units, its margin, and how far a camera's line of sight is drawn.
constexpr double kSide = 320, kMargin = 24, kSight = 22;

struct Stand {
  std::string name;
  Eigen::Vector2d at, towards;  // on the ground, seen from above; `towards` has at most length 1
};

Eigen::Vector3d ToEigen(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

std::vector<Stand> StandsOf(const v1::ListCamerasResponse& cameras) {
  const Eigen::Vector3d up = ToEigen(cameras.up());
  Eigen::Matrix<double, 2, 3> ground;
  ground.row(0) = up.unitOrthogonal();
  ground.row(1) = up.cross(Eigen::Vector3d(ground.row(0)));
  std::vector<Stand> stands;
  for (const v1::NamedCamera& named : cameras.cameras()) {
    const auto& values = named.camera().viewmat().values();
    if (values.size() != 16) continue;
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> viewmat(values.data());
    const Eigen::Matrix3d rotation = viewmat.topLeftCorner<3, 3>();
    const Eigen::Vector3d center = -rotation.transpose() * viewmat.topRightCorner<3, 1>();
    const Eigen::Vector3d forward = rotation.row(2);
    stands.push_back(
        {named.name(), ground * (center - ToEigen(cameras.center())), ground * forward});
  }
  return stands;
}

// From the ground to the drawing: all stands and the centre of the scene, which is 0, within it.
Eigen::Vector2d OnPlan(const Eigen::Vector2d& at, const Eigen::AlignedBox2d& box) {
  const double scale = (kSide - 2 * kMargin) / std::max(1e-9, box.sizes().maxCoeff());
  const Eigen::Vector2d shifted = scale * (at - box.center());
  return {kSide / 2 + shifted.x(), kSide / 2 - shifted.y()};
}

Html Plan(const v1::ListCamerasResponse& cameras) {
  const std::vector<Stand> stands = StandsOf(cameras);
  if (stands.empty()) return {};
  Eigen::AlignedBox2d box(Eigen::Vector2d::Zero());
  for (const Stand& stand : stands) box.extend(stand.at);
  Html marks;
  for (const Stand& stand : stands) {
    const Eigen::Vector2d at = OnPlan(stand.at, box);
    const Eigen::Vector2d end =
        at + kSight * Eigen::Vector2d(stand.towards.x(), -stand.towards.y());
    marks += El("g", {},
                {El("title", {}, {stand.name}),
                 El("line", {{"x1", Px(at.x())},
                             {"y1", Px(at.y())},
                             {"x2", Px(end.x())},
                             {"y2", Px(end.y())},
                             {"class", "sight"}}),
                 El("circle", {{"cx", Px(at.x())}, {"cy", Px(at.y())}, {"r", "3"}})});
  }
  const Eigen::Vector2d middle = OnPlan(Eigen::Vector2d::Zero(), box);
  const std::string cross = absl::StrFormat("M%.1f %.1fh12m-6 -6v12", middle.x() - 6, middle.y());
  return El("figure", {{"class", "plan"}},
            {El("svg",
                {{"viewBox", absl::StrFormat("0 0 %g %g", kSide, kSide)},
                 {"role", "img"},
                 {"aria-label", "Where the cameras stand, seen from above"}},
                {El("path", {{"d", cross}, {"class", "grid"}}), marks}),
             El("figcaption", {},
                {"Seen from above: cameras, and where they look. The cross is "
                 "the centre of the scene."})});
}

// "25 of 360x270, 12 other sizes": of all photos with a camera, those kept out of training too.
std::string SizesText(const v1::ListCamerasResponse& cameras) {
  std::map<std::string, int> sizes;
  for (const v1::NamedCamera& named : cameras.cameras()) {
    ++sizes[absl::StrCat(named.camera().width(), "x", named.camera().height())];
  }
  std::vector<std::string> texts;
  for (const auto& [size, count] : sizes) texts.push_back(absl::StrCat(count, " of ", size));
  constexpr size_t kMost = 4;
  if (texts.size() > kMost) {
    const size_t more = texts.size() - kMost;
    texts.resize(kMost);
    texts.push_back(absl::StrCat(more, " other sizes"));
  }
  return absl::StrJoin(texts, ", ");
}

Html LeftOutTable(const std::vector<LeftOut>& left_out) {
  if (left_out.empty()) return El("p", {}, {"No photo was left out."});
  Html rows;
  for (const LeftOut& photo : left_out) {
    rows += El("tr", {}, {El("th", {{"scope", "row"}}, {photo.name}), El("td", {}, {photo.why})});
  }
  return El("table", {},
            {El("thead", {},
                {El("tr", {},
                    {El("th", {{"scope", "col"}}, {"Left out"}),
                     El("th", {{"scope", "col"}}, {"Why"})})}),
             El("tbody", {}, {rows})});
}

}  // namespace

std::vector<LeftOut> PhotosLeftOut(const v1::JobReport& report,
                                   std::vector<std::string>* other_notes) {
  std::vector<LeftOut> left_out;
  std::vector<bool> used(static_cast<size_t>(report.notes_size()));
  for (const std::string& name : report.dropped()) {
    LeftOut photo{name, "no camera was found for it"};
    for (int i = 0; i < report.notes_size(); ++i) {
      absl::string_view why = report.notes(i);
      if (!absl::ConsumePrefix(&why, absl::StrCat(name, kLeftOut))) continue;
      absl::ConsumePrefix(&why, "it ");
      photo.why = std::string(why);
      used[static_cast<size_t>(i)] = true;
    }
    left_out.push_back(std::move(photo));
  }
  for (int i = 0; i < report.notes_size(); ++i) {
    if (!used[static_cast<size_t>(i)]) other_notes->push_back(report.notes(i));
  }
  return left_out;
}

Html CamerasSection(const v1::JobReport& report, const std::vector<LeftOut>& left_out,
                    const v1::ListCamerasResponse& cameras) {
  const bool given = report.sfm_preparation() == "given";
  const Html facts =
      El("dl", {},
         {Fact("Photos placed", absl::StrCat(report.registered(), " of ", report.photos())),
          Fact("Cameras", given ? "uploaded with the photos" : "found from the photos"),
          Fact("Photos prepared with", given ? "" : report.sfm_preparation()),
          Fact(given ? "Points uploaded with them" : "Points found with them",
               CountText(report.sparse_points())),
          Fact("Sizes of the pictures, px", SizesText(cameras)),
          Fact("Depth maps", report.depth_used() ? "took part" : "none")});
  return El("section", {},
            {El("h2", {}, {"Cameras"}),
             El("div", {{"class", "beside"}},
                {El("div", {}, {facts, LeftOutTable(left_out)}), Plan(cameras)})});
}

}  // namespace litags::report
