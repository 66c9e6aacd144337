#include "engine/core/name_key.h"

#include <gtest/gtest.h>

namespace litags {
namespace {

TEST(NameKey, IsTheSameForLettersWithMarksHoweverTheyAreWritten) {
  EXPECT_EQ(NameKey("Fassade S\u00FCd 1.JPG"), NameKey("Fassade Su\u0308d 1.jpg"));
  EXPECT_EQ(NameKey("\u1EAD"), NameKey("a\u0323\u0302"));  // two marks
  EXPECT_EQ(NameKey("\uD55C\uAE00"), NameKey("\u1112\u1161\u11AB\u1100\u1173\u11AF"));
  EXPECT_EQ(NameKey("\u30AC"), NameKey("\u30AB\u3099"));
  EXPECT_NE(NameKey("S\u00FCd"), NameKey("Sud"));
  EXPECT_NE(NameKey("a.jpg"), NameKey("a.png"));
}

TEST(NameKey, OtherBytesStay) {
  EXPECT_EQ(NameKey("\xF0\x9F\xA6\x8A \xFF"
                    "A"),
            "\xF0\x9F\xA6\x8A \xFF"
            "a");
  EXPECT_EQ(NameKey(""), "");
}

TEST(WithoutPercent, ReadsCodesAndLeavesTheRest) {
  EXPECT_EQ(WithoutPercent("Schlo%C3%9f%20(1).JPG"), "Schlo\u00DF (1).JPG");
  EXPECT_EQ(WithoutPercent("100%.JPG"), "100%.JPG");
  EXPECT_EQ(WithoutPercent("%4"), "%4");
}

}  // namespace
}  // namespace litags
