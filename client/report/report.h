// A job's report: one HTML file that needs nothing else, for those who file and compare results.
#ifndef LITAGS_CLIENT_REPORT_REPORT_H_
#define LITAGS_CLIENT_REPORT_REPORT_H_

#include <string>
#include <vector>

#include "client/report/course.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "litags/v1/render_service.pb.h"

namespace litags::report {

// A picture of the report: what is asked of RenderView, and its answer.
struct Picture {
  v1::RenderViewRequest request;
  v1::RenderedView view;
};

// What a report is made of: answers of the service. Whoever makes one fills the fields in this
// order.
struct ReportData {
  v1::Job job;                      // GetJob
  v1::ServerInfo server;            // GetServerInfo
  Course course;                    // WatchJob's events 1 to job.last_event
  v1::ListCamerasResponse cameras;  // ListCameras, if HasScene(job)
  std::vector<Picture> pictures;    // PicturesOf(), each with RenderView's answer
  google::protobuf::Timestamp made;
};

// Whether the job has ended, well or not.
bool HasEnded(v1::JobState state);

// Whether there is something to see.
bool HasScene(const v1::Job& job);

// The pictures that a report shows, without answers: from some of the photos' places, each in the
// photos' light and normally lit; of methods with one light only, once.
std::vector<Picture> PicturesOf(const v1::Job& job, const v1::ListCamerasResponse& cameras);

// The page. Texts of users are escaped, and the page forbids scripts and whatever lies elsewhere.
std::string ReportHtml(const ReportData& data);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_REPORT_H_
