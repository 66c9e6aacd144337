// What a job's events say over time: curves and stages.
#ifndef LITAGS_CLIENT_REPORT_COURSE_H_
#define LITAGS_CLIENT_REPORT_COURSE_H_

#include <string>
#include <vector>

#include "litags/v1/job.pb.h"

namespace litags::report {

// One value of a curve.
struct CurvePoint {
  double iteration = 0;
  double seconds = 0;  // that workers have spent on the job by then
  double value = 0;
};

// Time in one stage, of all runs of the job together.
struct StageTime {
  std::string name;  // "queued", or a stage: "training"
  double seconds = 0;
};

// Follows a job's events, given in order.
class Course {
 public:
  void Add(const v1::JobEvent& event);

  // Over rising iterations: a job that goes on from a checkpoint replaces what came after it.
  const std::vector<CurvePoint>& loss() const { return loss_; }
  // On held-out photos, dB; each measurement once.
  const std::vector<CurvePoint>& psnr() const { return psnr_; }
  // That workers have spent on the job.
  double run_seconds() const { return run_seconds_; }
  // In the order in which they began.
  const std::vector<StageTime>& stages() const { return stages_; }

 private:
  // The time since the event before goes to what the job was doing then.
  void CountTime(const google::protobuf::Timestamp& time);
  void AddProgress(const v1::Progress& progress);

  std::vector<CurvePoint> loss_, psnr_;
  std::vector<StageTime> stages_;
  std::string doing_;  // as in StageTime; empty: nothing that is counted
  bool running_ = false;
  double last_event_ = 0;  // seconds since 1970; 0: none
  double run_seconds_ = 0;
};

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_COURSE_H_
