// Words and numbers for people: durations, states, texts of strangers.
#ifndef LITAGS_CLIENT_REPORT_TEXT_H_
#define LITAGS_CLIENT_REPORT_TEXT_H_

#include <google/protobuf/descriptor.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "litags/v1/job.pb.h"

namespace litags::report {

double SecondsOf(const google::protobuf::Duration& duration);
// "43s", "1m07s", "2h05m".
std::string DurationText(double seconds);
// "23,104".
std::string CountText(int64_t count);
// "1 photo", "2 photos"; `noun` is that of one thing, and takes an s for more.
std::string Counted(int64_t count, const char* noun);
// "812 B", "3.4 MiB"; binary units.
std::string BytesText(int64_t bytes);
// METHOD_LITAGS_PAPER as "litags-paper": without the enum's name, which all its values begin with.
std::string EnumWord(const google::protobuf::EnumValueDescriptor& value);
// "running", "finding-cameras".
std::string StateText(v1::JobState state);
std::string StageText(v1::Stage stage);
// Whether it was made from a video: that is no photo, and its frames are no uploaded files.
bool IsOfVideo(const v1::Job& job);
// "by=ann site=north".
std::string LabelsText(const v1::Job& job);
// "2024-05-01 12:00:03" in UTC; "" if not set.
std::string TimeText(const google::protobuf::Timestamp& time);

// Whether all of it is valid UTF-8, as every text of the service must be.
bool IsUtf8(std::string_view text);

// The text with control characters, those that steer the direction of text, and bytes that are not
// UTF-8 replaced by '?', so that names from elsewhere neither drive the terminal nor show
// themselves as others. Newlines stay.
std::string Printable(std::string_view text);
// As Printable, of what stays on one line: names of files may hold newlines, which become '?', too.
std::string PrintableLine(std::string_view text);

// How many columns a terminal shows `text` in: wide East Asian letters take two, marks that go over
// the letter before them none.
size_t ColumnsOf(std::string_view text);
// With spaces behind it, up to so many columns.
std::string Padded(std::string_view text, size_t columns);

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_TEXT_H_
