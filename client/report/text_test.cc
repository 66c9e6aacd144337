#include "client/report/text.h"

#include <gtest/gtest.h>

namespace litags::report {
namespace {

TEST(Text, NumbersReadWell) {
  EXPECT_EQ(DurationText(0.4), "0s");
  EXPECT_EQ(DurationText(67), "1m07s");
  EXPECT_EQ(DurationText(7500), "2h05m");
  EXPECT_EQ(CountText(0), "0");
  EXPECT_EQ(CountText(999), "999");
  EXPECT_EQ(CountText(1000), "1,000");
  EXPECT_EQ(CountText(-1234567), "-1,234,567");
  EXPECT_EQ(Counted(1, "photo"), "1 photo");
  EXPECT_EQ(Counted(2, "photo"), "2 photos");
  EXPECT_EQ(BytesText(1023), "1023 B");
  EXPECT_EQ(BytesText(3'400'000), "3.2 MiB");
  EXPECT_EQ(BytesText(int64_t{1} << 28), "256 MiB");
  EXPECT_EQ(BytesText(int64_t{16} << 30), "16 GiB");
  EXPECT_EQ(BytesText((int64_t{1} << 30) - 1), "1.0 GiB");
}

TEST(Text, ControlCharactersDoNotReachTheTerminal) {
  EXPECT_EQ(Printable("a\x1b[2Jb\nc\x7f"), "a?[2Jb\nc?");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "2J"),
            "?2J");
  EXPECT_EQ(Printable("a\xe2\x80\xaegpj.png \xe2\x80\x8f \xe2\x80\xa8 \xff\xed\xa0\x80"),
            "a?gpj.png ? ? ????");
  EXPECT_EQ(Printable("h\xc3\xb6he"), "h\xc3\xb6he");
  EXPECT_EQ(PrintableLine("a\nb\x1b.png"), "a?b?.png");
}

TEST(Text, WordsOfEnumsAreThoseOfTheCommandLine) {
  EXPECT_EQ(StateText(v1::JOB_STATE_RUNNING), "running");
  EXPECT_EQ(StageText(v1::STAGE_FINDING_CAMERAS), "finding-cameras");
  EXPECT_EQ(EnumWord(*v1::Method_descriptor()->FindValueByNumber(v1::METHOD_LITAGS_PAPER)),
            "litags-paper");
  EXPECT_EQ(EnumWord(*v1::WhiteBalance_descriptor()->FindValueByNumber(1)), "camera");
  EXPECT_EQ(StateText(static_cast<v1::JobState>(99)), "99");
}

TEST(Text, ColumnsAreThoseOfATerminal) {
  EXPECT_EQ(ColumnsOf("room.jpg"), 8u);
  EXPECT_EQ(ColumnsOf("Küche.jpg"), 9u);
  EXPECT_EQ(ColumnsOf("Ku\u0308che.jpg"), 9u);  // as macOS writes it
  EXPECT_EQ(ColumnsOf("夜景.jpg"), 8u);
  EXPECT_EQ(ColumnsOf("한밤.jpg"), 8u);
  EXPECT_EQ(Padded("夜景.jpg", 10), "夜景.jpg  ");
  EXPECT_EQ(Padded("夜景.jpg", 3), "夜景.jpg");
}

}  // namespace
}  // namespace litags::report
