#include "client/report/html.h"

#include <gtest/gtest.h>

namespace litags::report {
namespace {

TEST(Html, TextIsEscapedInElementsAndAttributes) {
  EXPECT_EQ(El("p", {{"title", "\"><script>"}}, {"<script>alert('x')</script> & more"}).markup(),
            "<p title=\"&quot;&gt;&lt;script&gt;\">"
            "&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt; &amp; more</p>");
}

TEST(Html, ElementsInsideElementsStayMarkup) {
  EXPECT_EQ(El("p", {}, {"a ", El("b", {}, {"<"}), std::string(" & c")}).markup(),
            "<p>a <b>&lt;</b> &amp; c</p>");
  EXPECT_EQ(El("img", {{"alt", "x"}}).markup(), "<img alt=\"x\">");
}

TEST(Html, CharactersThatHideOrTurnTextAreNotPassedOn) {
  EXPECT_EQ(Html("a\xe2\x80\xaegpj.exe\x01").markup(), "a?gpj.exe?");
}

TEST(Html, ConstantsOfTheProgramAreTakenAsTheyAre) {
  EXPECT_EQ(El("style", {}, {Html::Literal("a > b {}")}).markup(), "<style>a > b {}</style>");
}

}  // namespace
}  // namespace litags::report
