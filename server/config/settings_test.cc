#include "server/config/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <fstream>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// A program with one option of each kind.
class SettingsTest : public ::testing::Test {
 protected:
  SettingsTest() {
    app_.add_option("--listen", listen_)->capture_default_str();
    app_.add_option("--jobs", jobs_)->check(Between(1, 100))->capture_default_str();
    app_.add_option("--rate", rate_)->capture_default_str();
    app_.add_flag("--insecure", insecure_);
    app_.add_option("--admins", admins_)->delimiter(',');
    app_.add_option("--token", tokens_)->delimiter(',');
    app_.add_flag("--check", check_);
  }
  ~SettingsTest() override {
    for (const char* name : {"LISTEN", "JOBS", "INSECURE", "ADMINS", "TOKEN"}) {
      unsetenv((std::string("TEST_") + name).c_str());
    }
    unsetenv("OTHER_LISTEN");
  }

  absl::Status Complete(const std::string& flags, const std::string& file = "") {
    app_.parse(flags, /*program_name_included=*/false);
    if (file.empty()) return settings_.Complete("");
    std::ofstream(path_) << file;
    return settings_.Complete(path_);
  }

  std::string Refusal(const std::string& file) {
    const absl::Status status = Complete("", file);
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("s3cret")));
    const auto detail = GetErrorDetail(status);
    return detail ? detail->reason + " " + detail->field : "OK";
  }

  TempDir dir_;
  const std::string path_ = dir_.path() + "/server.toml";
  CLI::App app_;
  std::string listen_ = "127.0.0.1:1";
  int jobs_ = 1;
  double rate_ = 0.5;
  bool insecure_ = false, check_ = false;
  std::vector<std::string> admins_, tokens_;
  Settings settings_{&app_, {"TEST", {{"listen", "OTHER_LISTEN"}}, {"check"}, {"token"}}};
};

TEST_F(SettingsTest, DefaultsStayWhereNothingNamesTheOption) {
  ASSERT_TRUE(Complete("").ok());
  EXPECT_EQ(listen_, "127.0.0.1:1");
  EXPECT_EQ(jobs_, 1);
  EXPECT_THAT(settings_.Print(), HasSubstr("jobs = 1  # default\n"));
  EXPECT_THAT(settings_.Print(), HasSubstr("insecure = false  # default\n"));
}

TEST_F(SettingsTest, FileIsBeatenByEnvironmentAndEnvironmentByTheCommandLine) {
  const std::string file =
      "listen = \"file:1\"\njobs = 3\nrate = 2.5\ninsecure = true\nadmins = [\"ann\", \"ben\"]\n";
  setenv("TEST_JOBS", "4", 1);
  setenv("OTHER_LISTEN", "other:1", 1);
  const absl::Status status = Complete("--rate 9", file);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(listen_, "other:1");
  EXPECT_EQ(jobs_, 4);
  EXPECT_EQ(rate_, 9);
  EXPECT_TRUE(insecure_);
  EXPECT_THAT(admins_, ElementsAre("ann", "ben"));
  const std::string text = settings_.Print();
  EXPECT_THAT(text, HasSubstr("listen = \"other:1\"  # environment OTHER_LISTEN\n"));
  EXPECT_THAT(text, HasSubstr("jobs = 4  # environment TEST_JOBS\n"));
  EXPECT_THAT(text, HasSubstr("rate = 9  # command line\n"));
  EXPECT_THAT(text, HasSubstr("insecure = true  # file " + path_));
  EXPECT_THAT(text, HasSubstr("admins = [\"ann\", \"ben\"]  # file "));
  EXPECT_THAT(text, Not(HasSubstr("check")));
}

TEST_F(SettingsTest, OwnVariableBeatsTheSecondOneAndAnEmptyOneNamesNothing) {
  setenv("OTHER_LISTEN", "other:1", 1);
  setenv("TEST_LISTEN", "own:1", 1);
  setenv("TEST_JOBS", "", 1);
  setenv("TEST_INSECURE", "true", 1);
  setenv("TEST_ADMINS", "ann,ben", 1);
  ASSERT_TRUE(Complete("", "jobs = 7\n").ok());
  EXPECT_EQ(listen_, "own:1");
  EXPECT_EQ(jobs_, 7);
  EXPECT_TRUE(insecure_);
  EXPECT_THAT(admins_, ElementsAre("ann", "ben"));
}

TEST_F(SettingsTest, WhatIsPrintedIsAFileThatSetsTheSame) {
  ASSERT_TRUE(Complete("--jobs 5 --insecure --admins ann,ben --listen unix:/a=b").ok());
  const std::string text = settings_.Print();
  CLI::App app;
  std::string listen;
  int jobs = 0;
  double rate = 0;
  bool insecure = false;
  std::vector<std::string> admins;
  app.add_option("--listen", listen);
  app.add_option("--jobs", jobs);
  app.add_option("--rate", rate);
  app.add_flag("--insecure", insecure);
  app.add_option("--admins", admins)->delimiter(',');
  app.parse("", false);
  std::ofstream(path_) << text;
  Settings settings(&app, {"NONE", {}, {}, {}});
  const absl::Status status = settings.Complete(path_);
  ASSERT_TRUE(status.ok()) << status << "\n" << text;
  EXPECT_EQ(listen, "unix:/a=b");
  EXPECT_EQ(jobs, 5);
  EXPECT_EQ(rate, 0.5);
  EXPECT_TRUE(insecure);
  EXPECT_THAT(admins, ElementsAre("ann", "ben"));
}

TEST_F(SettingsTest, EmptyListInTheFileIsAnEmptyList) {
  ASSERT_TRUE(Complete("", "admins = []\n").ok());
  EXPECT_TRUE(admins_.empty());
}

TEST_F(SettingsTest, SecretsAreNeverPrinted) {
  setenv("TEST_TOKEN", "a:s3cret,b:s3cret", 1);
  ASSERT_TRUE(Complete("").ok());
  EXPECT_EQ(tokens_.size(), 2u);
  EXPECT_THAT(settings_.Print(), Not(HasSubstr("s3cret")));
  EXPECT_THAT(settings_.Print(), HasSubstr("# token = "));
}

TEST_F(SettingsTest, MistakesAreNamed) {
  EXPECT_EQ(Refusal("jobz = 3\n"), "CONFIG_KEY_UNKNOWN jobz");
}

TEST_F(SettingsTest, WhatStandsWhereANameShouldIsToldByItsLineAlone) {
  for (const char* file : {
           "\nstore =\n\"postgresql://u:s3cret@h/d\"\n",
           "\nstore =\n\"postgresql://u:s3cret@h.example/d?a=b\"\n",
           "\n\nstore \"postgresql://u:s3cret@h/d\"\n",
           "# where\n\nstore: \"postgresql://u:s3cret@h/d\"\n",
           "jobs = 3\ntoken =\n[\"alice:sha256:s3cret\"]\n",
           "token = [\"a\"]\n\ns3cret\n",
       }) {
    EXPECT_EQ(Refusal(file), "CONFIG_INVALID --config") << file;
    EXPECT_THAT(std::string(Complete("", file).message()), HasSubstr("line 3 is not NAME = VALUE"));
  }
}

TEST_F(SettingsTest, ListMayHaveSeveralLines) {
  const absl::Status status = Complete("",
                                       "token = [  # of clients\n"
                                       "  \"alice:s3cret\",\n"
                                       "\n"
                                       "  \"ben:s3cret=\",  # the newest\n"
                                       "]\n"
                                       "admins = [\"ann\",\n"
                                       "          \"ben\"]\n"
                                       "jobs = 7\n");
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(tokens_, ElementsAre("alice:s3cret", "ben:s3cret="));
  EXPECT_THAT(admins_, ElementsAre("ann", "ben"));
  EXPECT_EQ(jobs_, 7);
}

TEST_F(SettingsTest, ListWithoutAnEndIsToldByTheLineThatBeginsIt) {
  for (const char* file : {"rate = 1\ntoken = [\n\"a:s3cret\",\njobs = 3\nadmins = [\"ann\"]\n",
                           "rate = 1\ntoken = [\"a:s3cret\",\n"}) {
    EXPECT_EQ(Refusal(file), "CONFIG_INVALID --config") << file;
    EXPECT_THAT(std::string(Complete("", file).message()), HasSubstr("begins on line 2"));
  }
}

TEST_F(SettingsTest, SectionsAreRefused) {
  EXPECT_EQ(Refusal("[server]\njobs = 3\n"), "CONFIG_KEY_UNKNOWN server");
  EXPECT_THAT(std::string(Complete("", "[server]\njobs = 3\n").message()),
              HasSubstr("has a section [server]; settings stand without sections"));
}

TEST_F(SettingsTest, OptionsOfOneRunDoNotBelongIntoAFile) {
  EXPECT_EQ(Refusal("check = true\n"), "CONFIG_KEY_UNKNOWN check");
}

TEST_F(SettingsTest, KeySetTwiceIsRefused) {
  EXPECT_EQ(Refusal("jobs = 3\nrate = 1\njobs = 4\n"), "CONFIG_KEY_TWICE jobs");
}

TEST_F(SettingsTest, KeySetTwiceInARowIsRefused) {
  EXPECT_EQ(Refusal("jobs = 3\njobs = 4\n"), "SETTING_INVALID --jobs");
}

TEST_F(SettingsTest, ValueThatTheReaderWouldCutIsRefused) {
  EXPECT_EQ(Refusal("jobs = 3  # \"quoted\"\nlisten = \"unix:/a#b\"\n"), "CONFIG_INVALID --config");
  EXPECT_EQ(Refusal("jobs = 3  # it's\nlisten = 'unix:/a#b'\n"), "CONFIG_INVALID --config");
}

TEST_F(SettingsTest, ValuesAreCheckedAsOnTheCommandLine) {
  EXPECT_EQ(Refusal("jobs = 1000\n"), "SETTING_INVALID --jobs");
}

TEST_F(SettingsTest, ABadValueIsSaidOnceWithItsPlace) {
  EXPECT_EQ(Complete("", "jobs = 1000\n").message(),
            "--jobs from file " + path_ + " takes a whole number from 1 to 100, not \"1000\"");
}

TEST_F(SettingsTest, FileThatIsNotThereIsAnError) {
  app_.parse("", false);
  const auto detail = GetErrorDetail(settings_.Complete(path_ + ".missing"));
  ASSERT_TRUE(detail);
  EXPECT_EQ(detail->reason, "CONFIG_UNREADABLE");
}

TEST_F(SettingsTest, FolderIsNoFile) {
  app_.parse("", false);
  const auto detail = GetErrorDetail(settings_.Complete(dir_.path()));
  ASSERT_TRUE(detail);
  EXPECT_EQ(detail->reason, "CONFIG_UNREADABLE");
}

TEST_F(SettingsTest, EmptyFileSetsNothing) {
  app_.parse("", false);
  std::ofstream(path_).close();
  EXPECT_TRUE(settings_.Complete(path_).ok());
}

}  // namespace
}  // namespace litags
