#include "server/store/open_stores.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

TEST(OpenStores, UrlsAreCheckedAndSecretsAreNotRepeated) {
  for (const char* url : {"", "sqlite:///a/b.db", "postgresql://u:p@db/x", "postgres:///x"}) {
    EXPECT_TRUE((StorePlaces{url, "", ""}.Validate().ok())) << url;
  }
  for (const char* url :
       {"a/b.db", "sqlite://a.db", "mysql://secret@x", "postgresql://secret@[::1"}) {
    const absl::Status status = StorePlaces{url, "", ""}.Validate();
    ASSERT_TRUE(GetErrorDetail(status)) << url;
    EXPECT_EQ(GetErrorDetail(status)->reason, "STORE_URL_INVALID") << url;
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("secret")));
  }
  for (const char* url : {"", "file:///a", "s3://bucket", "s3://bucket/a/b"}) {
    EXPECT_TRUE((StorePlaces{"", url, ""}.Validate().ok())) << url;
  }
  for (const char* url : {"/a", "file://a", "s3://", "s3://bucket/a b", "s3://B"}) {
    EXPECT_FALSE((StorePlaces{"", url, ""}.Validate().ok())) << url;
  }
}

TEST(OpenStores, AnS3ServerWithoutBlobsThereIsRefused) {
  EXPECT_TRUE((StorePlaces{"", "s3://bucket", "http://s3:7070"}.Validate().ok()));
  for (const char* url : {"", "file:///a"}) {
    const absl::Status status = StorePlaces{"", url, "http://s3:7070"}.Validate();
    ASSERT_TRUE(GetErrorDetail(status)) << url;
    EXPECT_EQ(GetErrorDetail(status)->reason, "SETTING_UNUSED") << url;
  }
}

TEST(OpenStores, NetworkIsNeededForServersThatAreNotReachedBySocketFiles) {
  EXPECT_FALSE((StorePlaces{"", "", ""}.NeedNetwork()));
  EXPECT_FALSE((StorePlaces{"postgresql:///x?host=/run/postgresql", "", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"postgresql://db/x", "", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"postgresql://127.0.0.1/x", "", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"", "s3://bucket", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"postgresql:///x?host=/run/postgresql,db", "", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"postgresql:///x?hostaddr=192.0.2.1", "", ""}.NeedNetwork()));
  EXPECT_TRUE((StorePlaces{"postgresql:///x?service=fleet", "", ""}.NeedNetwork()));
  const StorePlaces unnamed{"postgresql:///x", "", ""};
  EXPECT_FALSE(unnamed.NeedNetwork());
  for (const char* variable : {"PGHOST", "PGHOSTADDR", "PGSERVICE"}) {
    setenv(variable, "192.0.2.1", 1);
    EXPECT_TRUE(unnamed.NeedNetwork()) << variable;
    unsetenv(variable);
  }
  setenv("PGHOST", "/run/postgresql", 1);
  EXPECT_FALSE(unnamed.NeedNetwork());
  unsetenv("PGHOST");
}

TEST(OpenStores, OtherProcessesGetTheSecretsOfTheStoresInUseOnly) {
  setenv("AWS_SECRET_ACCESS_KEY", "key", 1);
  setenv("PGPASSWORD", "password", 1);
  setenv("MY_TOKEN", "token", 1);
  EXPECT_THAT((StorePlaces{"", "", ""}.Environment()),
              UnorderedElementsAre("LITAGS_STORE=", "LITAGS_BLOBS=", "LITAGS_S3_ENDPOINT="));
  EXPECT_THAT((StorePlaces{"postgresql://db/x", "", ""}.Environment()),
              AllOf(Contains("LITAGS_STORE=postgresql://db/x"), Contains("PGPASSWORD=password"),
                    Not(Contains(HasSubstr("AWS"))), Not(Contains(HasSubstr("TOKEN")))));
  EXPECT_THAT((StorePlaces{"", "s3://bucket", "https://s3"}.Environment()),
              AllOf(Contains("LITAGS_S3_ENDPOINT=https://s3"), Not(Contains(HasSubstr("PG"))),
                    Contains("AWS_SECRET_ACCESS_KEY=key")));
}

TEST(OpenStores, DefaultsAreInTheDataFolderAndPathsCanBeNamed) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir.path() + "/data");
  ASSERT_TRUE(OpenJobStore({}, data).ok());
  EXPECT_TRUE(std::filesystem::exists(data.database()));
  EXPECT_EQ(std::filesystem::status(data.database()).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  const StorePlaces places{"sqlite://" + dir.path() + "/jobs.db", "file://" + dir.path() + "/b",
                           ""};
  EXPECT_TRUE(OpenJobStore(places, data).ok());
  EXPECT_TRUE(OpenBlobStore(places, data).ok());
  EXPECT_TRUE(std::filesystem::exists(dir.path() + "/jobs.db"));
  EXPECT_TRUE(std::filesystem::exists(dir.path() + "/b"));
}

}  // namespace
}  // namespace litags
