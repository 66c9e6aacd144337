// The metrics as prometheus-cpp keeps them: for this folder only.
#ifndef LITAGS_SERVER_METRICS_FAMILIES_H_
#define LITAGS_SERVER_METRICS_FAMILIES_H_

#include <prometheus/counter.h>
#include <prometheus/family.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "server/metrics/metrics.h"

namespace litags {

struct Metrics::Families {
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& calls;
  prometheus::Family<prometheus::Histogram>& call_seconds;
  prometheus::Histogram& picture_seconds;
  prometheus::Counter& uploaded_bytes;
  prometheus::Counter& worker_restarts;
  prometheus::Family<prometheus::Counter>& store_errors;

  Families();
};

}  // namespace litags

#endif  // LITAGS_SERVER_METRICS_FAMILIES_H_
