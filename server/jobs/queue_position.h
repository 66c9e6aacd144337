#ifndef LITAGS_SERVER_JOBS_QUEUE_POSITION_H_
#define LITAGS_SERVER_JOBS_QUEUE_POSITION_H_

#include <map>
#include <string>

#include "server/store/job_store.h"

namespace litags {

// When each waiting job leaves the queue, by its id: 1 is next. By JobStore::UpdateFirstQueued()'s
// order, if any worker can take any job, nothing is queued later and no running job ends before.
std::map<std::string, int> QueuePositions(const JobQueue& queue);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_QUEUE_POSITION_H_
