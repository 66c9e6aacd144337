// How a job stands, in lines for people; the words of report/text.h, too.
#ifndef LITAGS_CLIENT_TEXT_H_
#define LITAGS_CLIENT_TEXT_H_

#include <cstddef>
#include <string>

#include "client/report/text.h"
#include "litags/v1/job.pb.h"

namespace litags::client {

using report::BytesText;
using report::ColumnsOf;
using report::Counted;
using report::CountText;
using report::DurationText;
using report::IsUtf8;
using report::LabelsText;
using report::Padded;
using report::Printable;
using report::SecondsOf;
using report::StageText;
using report::StateText;
using report::TimeText;

// One plain line for an event, without its newline, e.g.
// "#12 training 250/3000  loss 0.0812  5,123 Gaussians  41.2 it/s  ETA 1m07s".
std::string EventLine(const v1::JobEvent& event);

// Progress in at most `columns` columns: a bar where there is room, less where there is not.
std::string ProgressLine(const v1::Progress& progress, size_t columns);

// What came out, or what went wrong, in a few lines, each ending with a newline.
std::string OutcomeText(const v1::Job& job);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_TEXT_H_
