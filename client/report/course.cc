#include "client/report/course.h"

#include <algorithm>

#include "client/report/text.h"

namespace litags::report {
namespace {

void Put(std::vector<CurvePoint>& curve, const CurvePoint& point) {
  while (!curve.empty() && curve.back().iteration >= point.iteration) curve.pop_back();
  curve.push_back(point);
}

}  // namespace

void Course::Add(const v1::JobEvent& event) {
  CountTime(event.time());
  if (event.has_state_change()) {
    const v1::JobState state = event.state_change().state();
    running_ = state == v1::JOB_STATE_RUNNING;
    doing_ = state == v1::JOB_STATE_QUEUED ? StateText(state) : "";
  } else if (event.has_progress()) {
    AddProgress(event.progress());
  }
}

void Course::CountTime(const google::protobuf::Timestamp& time) {
  const double now = static_cast<double>(time.seconds()) + 1e-9 * time.nanos();
  // Writers have clocks of their own.
  const double passed = last_event_ > 0 ? std::max(0.0, now - last_event_) : 0;
  last_event_ = now;
  if (running_) run_seconds_ += passed;
  if (doing_.empty()) return;
  const auto known = std::find_if(stages_.begin(), stages_.end(),
                                  [&](const StageTime& stage) { return stage.name == doing_; });
  if (known != stages_.end()) {
    known->seconds += passed;
  } else {
    stages_.push_back({doing_, passed});
  }
}

void Course::AddProgress(const v1::Progress& progress) {
  if (progress.stage() != v1::STAGE_UNSPECIFIED) doing_ = StageText(progress.stage());
  const CurvePoint at = {static_cast<double>(progress.iteration()), run_seconds_, 0};
  if (progress.loss() > 0) Put(loss_, {at.iteration, at.seconds, progress.loss()});
  // Reports repeat what was measured last.
  const bool is_new = psnr_.empty() || psnr_.back().value != progress.psnr_holdout() ||
                      psnr_.back().iteration > at.iteration;
  if (progress.has_psnr_holdout() && is_new) {
    Put(psnr_, {at.iteration, at.seconds, progress.psnr_holdout()});
  }
}

}  // namespace litags::report
