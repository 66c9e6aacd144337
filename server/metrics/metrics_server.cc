#include "server/metrics/metrics_server.h"

#include <prometheus/collectable.h>
#include <prometheus/exposer.h>

#include <exception>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/overview.h"
#include "server/jobs/state_machine.h"
#include "server/metrics/families.h"

namespace litags {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;

MetricFamily Gauge(std::string name, std::string help) {
  return {std::move(name), std::move(help), prometheus::MetricType::Gauge, {}};
}

void Add(double value, std::vector<ClientMetric::Label> labels, MetricFamily* family) {
  ClientMetric& metric = family->metric.emplace_back();
  metric.label = std::move(labels);
  metric.gauge.value = value;
}

// The gauges, asked for when Prometheus asks.
class JobsNow : public prometheus::Collectable {
 public:
  JobsNow(Metrics* metrics, JobStore* store) : metrics_(metrics), store_(store) {}

  std::vector<MetricFamily> Collect() const override {
    const absl::StatusOr<JobsOverview> now = OverviewOf(*store_, store_->NowMs());
    metrics_->AddIfStoreError(now.status());
    MetricFamily up = Gauge("litags_store_up", "Whether the job store answers");
    Add(now.ok() ? 1 : 0, {}, &up);
    if (!now.ok()) return {up};
    MetricFamily jobs = Gauge("litags_jobs", "Jobs by state");
    for (const auto& [state, count] : now->by_state) {
      Add(static_cast<double>(count), {{"state", std::string(JobStateName(state))}}, &jobs);
    }
    MetricFamily age = Gauge("litags_queue_age_seconds",
                             "Seconds since the job that waits longest was queued; 0: none waits");
    Add(now->queue_age_seconds, {}, &age);
    MetricFamily rate =
        Gauge("litags_iterations_per_second", "Training iterations of all running jobs together");
    Add(now->iterations_per_second, {}, &rate);
    MetricFamily unplaceable = Gauge("litags_jobs_without_fitting_worker",
                                     "Queued jobs that no worker that is there can take");
    Add(static_cast<double>(now->unplaceable), {}, &unplaceable);
    MetricFamily workers = Gauge("litags_workers", "Workers that are there");
    Add(static_cast<double>(now->workers), {}, &workers);
    return {up, jobs, age, rate, unplaceable, workers};
  }

 private:
  Metrics* const metrics_;
  JobStore* const store_;
};

}  // namespace

struct MetricsServer::Http {
  std::shared_ptr<JobsNow> jobs;
  std::shared_ptr<prometheus::Registry> registry;
  std::unique_ptr<prometheus::Exposer> exposer;  // goes first: it asks the others
};

absl::StatusOr<std::unique_ptr<MetricsServer>> MetricsServer::Start(const std::string& listen,
                                                                    Metrics* metrics,
                                                                    JobStore* store) {
  auto http = std::make_unique<Http>();
  http->jobs = std::make_shared<JobsNow>(metrics, store);
  http->registry = {metrics->families_, &metrics->families_->registry};
  try {
    http->exposer = std::make_unique<prometheus::Exposer>(listen, 2);
  } catch (const std::exception& error) {  // CivetException
    return MakeError(absl::StatusCode::kUnavailable, "CANNOT_LISTEN", "--metrics-listen",
                     absl::StrCat("cannot listen on ", listen, " for metrics (", error.what(),
                                  "); choose another --metrics-listen"));
  }
  http->exposer->RegisterCollectable(http->jobs);
  http->exposer->RegisterCollectable(http->registry);
  return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(http)));
}

MetricsServer::MetricsServer(std::unique_ptr<Http> http) : http_(std::move(http)) {}
MetricsServer::~MetricsServer() = default;

int MetricsServer::port() const { return http_->exposer->GetListeningPorts().front(); }

}  // namespace litags
