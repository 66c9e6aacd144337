#include "server/errors/scrub.h"

#include <gtest/gtest.h>

#include "engine/core/error.h"

namespace litags {
namespace {

TEST(Scrub, LeavesOfAPathTheLastName) {
  const std::pair<const char*, const char*> cases[] = {
      {"cannot open /srv/litags/uploads/7/ab: denied", "cannot open ab: denied"},
      {"'/srv/a/0012.jpg' and \"/srv/a/b c.jpg\"", "'0012.jpg' and \"b c.jpg\""},
      {"/srv/a/b/", "b/"},
      {"images[/etc/a.jpg]: no plain name", "images[/etc/a.jpg]: no plain name"},
      {"24 it/s, 16/32 px, 1 / 2, see https://a.b/c or docs/errors.md or /x",
       "24 it/s, 16/32 px, 1 / 2, see https://a.b/c or docs/errors.md or /x"},
      {"", ""},
      {"/", "/"},
  };
  for (const auto& [text, scrubbed] : cases) EXPECT_EQ(WithoutPaths(text), scrubbed);
}

TEST(Scrub, LeavesTheClientsOwnWordsAlone) {
  EXPECT_EQ(MessageForClients(InvalidInput("ARCHIVE_ENTRY_UNSAFE", "", "\"/etc/a.png\"")),
            "\"/etc/a.png\"");
  EXPECT_EQ(MessageForClients(absl::InternalError("no \"/etc/a.png\"")), "no \"a.png\"");
}

TEST(Scrub, SaysOfAStoreNoMoreThanThatItIsAway) {
  const std::string shown = MessageForClients(MakeError(
      absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "",
      "the job store's database is away: connection to server at \"10.0.0.5\", port 5432 failed"));
  EXPECT_EQ(shown.find("10.0.0.5"), std::string::npos) << shown;
  EXPECT_NE(shown.find("nothing was changed"), std::string::npos) << shown;
}

TEST(Scrub, AStoreIsNoFieldOfTheRequest) {
  constexpr auto kCode = absl::StatusCode::kFailedPrecondition;
  for (const char* reason : {"BLOBS_DENIED", "STORE_NOT_OPENED"}) {
    const absl::Status denied = MakeError(kCode, reason, "blobs", "at 10.0.0.5");
    EXPECT_EQ(DetailForClients(denied).reason, reason);
    EXPECT_EQ(DetailForClients(denied).field, "");
    EXPECT_EQ(MessageForClients(denied).find("10.0.0.5"), std::string::npos);
  }
  EXPECT_EQ(DetailForClients(MakeError(kCode, "VIDEO_NOT_ALONE", "videos", "")).field, "videos");
  EXPECT_EQ(DetailForClients(absl::InternalError("")).reason, "INTERNAL");
}

}  // namespace
}  // namespace litags
