// Words and numbers for people: durations, states, progress.
#ifndef LITAGS_CLIENT_TEXT_H_
#define LITAGS_CLIENT_TEXT_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "litags/v1/job.pb.h"

namespace litags::client {

double SecondsOf(const google::protobuf::Duration& duration);
// "43s", "1m07s", "2h05m".
std::string DurationText(double seconds);
// "23,104".
std::string CountText(int64_t count);
// "812 B", "3.4 MB"; decimal units.
std::string BytesText(int64_t bytes);
// "running", "finding-cameras".
std::string StateText(v1::JobState state);
std::string StageText(v1::Stage stage);
// "2024-05-01 12:00:03" in UTC; "" if not set.
std::string TimeText(const google::protobuf::Timestamp& time);

// Whether all of it is valid UTF-8, as every text of the service must be.
bool IsUtf8(std::string_view text);

// The text with control characters, those that steer the direction of text, and bytes that are not
// UTF-8 replaced by '?', so that names from elsewhere neither drive the terminal nor show
// themselves as others. Newlines stay.
std::string Printable(std::string_view text);

// One plain line for an event, without its newline, e.g.
// "#12 training 250/3000  loss 0.0812  5,123 Gaussians  41.2 it/s  ETA 1m07s".
std::string EventLine(const v1::JobEvent& event);

// Progress in at most `columns` columns: a bar where there is room, less where there is not.
std::string ProgressLine(const v1::Progress& progress, size_t columns);

// What came out, or what went wrong, in a few lines, each ending with a newline.
std::string OutcomeText(const v1::Job& job);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_TEXT_H_
