// How a job stands, in lines for people.
#ifndef LITAGS_CLIENT_TEXT_H_
#define LITAGS_CLIENT_TEXT_H_

#include <cstddef>
#include <string>

#include "litags/v1/job.pb.h"

namespace litags::client {

// One plain line for an event, without its newline, e.g.
// "#12 training 250/3000  loss 0.0812  5,123 Gaussians  41.2 it/s  ETA 1m07s".
std::string EventLine(const v1::JobEvent& event);

// Progress in at most `columns` columns: a bar where there is room, less where there is not.
std::string ProgressLine(const v1::Progress& progress, size_t columns);

// What came out, or what went wrong, in a few lines, each ending with a newline.
std::string OutcomeText(const v1::Job& job);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_TEXT_H_
