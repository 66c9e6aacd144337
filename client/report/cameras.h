#ifndef LITAGS_CLIENT_REPORT_CAMERAS_H_
#define LITAGS_CLIENT_REPORT_CAMERAS_H_

#include <string>
#include <vector>

#include "client/report/html.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "litags/v1/render_service.pb.h"

namespace litags::report {

// A photo that the scene was made without.
struct LeftOut {
  std::string name, why;
};

// Each of report.dropped, with the reason that a note gives. Notes that give none of them go to
// `other_notes`.
std::vector<LeftOut> PhotosLeftOut(const v1::JobReport& report,
                                   std::vector<std::string>* other_notes);

// How many photos were placed and how, who was left out, and where the cameras stand.
Html CamerasSection(const v1::JobReport& report, const std::vector<LeftOut>& left_out,
                    const v1::ListCamerasResponse& cameras);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_CAMERAS_H_
