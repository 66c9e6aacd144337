#include "proto/arguments/arguments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// A program with options of each kind and a command.
class ArgumentsTest : public ::testing::Test {
 protected:
  ArgumentsTest() {
    app_.add_option("--workers", workers_)->check(Between(0, 256));
    app_.add_option("--keepalive", seconds_)->check(Between(0.001, 1e6));
    app_.add_option("--max-jobs", bytes_)->check(AtLeastZero(bytes_));
    app_.add_option("--max-wait", seconds_)->check(AboveZero(seconds_));
    app_.add_option("--cache", bytes_)->transform(ByteSize());
    app_.add_option("--room", bytes_)->transform(ByteSize())->check(AboveZero(bytes_));
    app_.add_option("--log-format", word_)->check(OneOf({"text", "json"}));
    app_.add_option("--seed", seed_)->check(AtLeastZero(seed_));
    app_.add_option("--threads", workers_);
    app_.add_option("--scale", seconds_);
    app_.add_flag("--check", flag_);
    auto* cert = app_.add_option("--cert", word_);
    app_.add_option("--key", word_)->needs(cert);
    app_.add_option("--orbit", word_)->excludes(cert);
    CLI::App* command = app_.add_subcommand("paint", "Paints");
    command->add_option("FILE", word_)->required();
    command->add_option("--look-at", points_)->expected(2);
    CLI::Option_group* output = app_.add_subcommand("write", "Writes")->add_option_group("File");
    output->add_option("-o,--output", word_);
    output->add_option("--ply", word_);
    output->require_option(1);
  }

  // What is said of `arguments`, and the exit status behind it.
  std::string Said(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "/usr/bin/litags-test");
    std::vector<char*> argv;
    for (std::string& word : arguments) argv.push_back(word.data());
    testing::internal::CaptureStderr();
    const auto exit = ParseArguments(app_, static_cast<int>(argv.size()), argv.data());
    return testing::internal::GetCapturedStderr() + (exit ? std::to_string(*exit) : "goes on");
  }
  std::string Sentence(std::vector<std::string> arguments) {
    const std::string said = Said(std::move(arguments));
    return said.substr(0, said.find("; litags-test"));
  }

  CLI::App app_;
  int workers_ = 0;
  double seconds_ = 0;
  int64_t bytes_ = 0;
  uint64_t seed_ = 0;
  bool flag_ = false;
  std::string word_;
  std::vector<std::string> points_;
};

TEST_F(ArgumentsTest, GoodArgumentsAreReadAndNothingIsSaid) {
  EXPECT_EQ(Said({"--workers", "3", "--cache", "2MiB", "--max-wait", "0.5"}), "goes on");
  EXPECT_EQ(workers_, 3);
  EXPECT_EQ(bytes_, 2 << 20);
}

TEST_F(ArgumentsTest, ASentenceNamesOptionRuleValueAndHelp) {
  EXPECT_EQ(Said({"--workers", "999"}),
            "--workers takes a whole number from 0 to 256, not \"999\"; litags-test --help says "
            "what there is\n2");
}

TEST_F(ArgumentsTest, NumbersOutOfRange) {
  EXPECT_EQ(Sentence({"--workers", "many"}),
            "--workers takes a whole number from 0 to 256, not \"many\"");
  EXPECT_EQ(Sentence({"--workers", "1.5"}),
            "--workers takes a whole number from 0 to 256, not \"1.5\"");
  EXPECT_EQ(Sentence({"--keepalive", "0"}),
            "--keepalive takes a number from 0.001 to 1000000, not \"0\"");
  EXPECT_EQ(Sentence({"--max-jobs", "-1"}),
            "--max-jobs takes a whole number from 0 on, not \"-1\"");
  EXPECT_EQ(Sentence({"--max-wait", "0"}), "--max-wait takes a number above 0, not \"0\"");
  EXPECT_EQ(Sentence({"--max-wait", "nan"}), "--max-wait takes a number above 0, not \"nan\"");
}

TEST_F(ArgumentsTest, NumbersWithoutARange) {
  EXPECT_EQ(Sentence({"--threads", "many"}), "--threads takes a whole number, not \"many\"");
  EXPECT_EQ(Sentence({"--threads", "99999999999"}), "--threads: 99999999999 is too large a number");
  EXPECT_EQ(Sentence({"--seed", "-1"}), "--seed takes a whole number from 0 on, not \"-1\"");
  EXPECT_EQ(Sentence({"--scale", "big"}), "--scale takes a number, not \"big\"");
}

TEST_F(ArgumentsTest, BytesAndWords) {
  for (const char* size : {"1lb", "many", "-5", "1.5GiB"}) {
    EXPECT_EQ(
        Sentence({"--cache", size}),
        std::string("--cache takes a number of bytes, as 512MiB or 4GiB, not \"") + size + "\"");
  }
  EXPECT_EQ(Sentence({"--room", "0"}), "--room takes a whole number above 0, not \"0\"");
  EXPECT_EQ(Sentence({"--log-format", "xml"}), "--log-format takes text or json, not \"xml\"");
  EXPECT_EQ(Sentence({"--check=maybe"}), "--check takes true or false");
}

TEST_F(ArgumentsTest, MissingAndTooMany) {
  EXPECT_EQ(Sentence({"--scale"}), "--scale has no value");
  EXPECT_EQ(Sentence({"--scale", "1", "--scale", "2"}), "--scale is given more than once");
  EXPECT_EQ(Sentence({"paint"}), "FILE is not given");
  EXPECT_EQ(Sentence({"paint", "f", "--look-at", "1,2,3"}), "--look-at takes 2 values");
  EXPECT_EQ(Sentence({"write"}), "give one of -o,--output,--ply");
  EXPECT_EQ(Sentence({"write", "-o", "a", "--ply", "b"}), "give only one of -o,--output,--ply");
  EXPECT_EQ(Sentence({"--key", "k"}), "--key needs --cert, too");
  EXPECT_EQ(Sentence({"--orbit", "o", "--cert", "c"}),
            "--cert and --orbit exclude each other: leave one out");
}

TEST_F(ArgumentsTest, WhatIsNotTakenIsNamedInItsOrder) {
  EXPECT_EQ(Sentence({"--worker", "3"}), "there is no option --worker of litags-test");
  EXPECT_EQ(Sentence({"paint", "f", "second", "third"}),
            "litags-test paint does not take: second third");
  // Before what is missing.
  EXPECT_EQ(Sentence({"paint", "--file", "f"}), "there is no option --file of litags-test paint");
}

TEST_F(ArgumentsTest, AMissingOrUnknownCommandIsAnsweredWithThoseThereAre) {
  app_.require_subcommand(1);
  EXPECT_EQ(Said({}),
            "no command is given; choose one of: paint write\n"
            "litags-test --help and litags-test COMMAND --help say more\n2");
  EXPECT_THAT(Said({"draw"}),
              HasSubstr("there is no command \"draw\"; choose one of: paint write\n"));
}

TEST_F(ArgumentsTest, CharactersThatSteerTheTerminalAreNotShown) {
  EXPECT_THAT(Said({"a\x1b[2J\xC2\x9B"
                    "b\xC3\xA4"}),
              HasSubstr("a?[2J?b\xC3\xA4"));
}

TEST(RunProgram, SaysWhatWasThrownAndFails) {
  const auto said = [](const std::function<int()>& run) {
    testing::internal::CaptureStderr();
    const int exit = RunProgram("litags-test", run);
    return absl::StrCat(testing::internal::GetCapturedStderr(), exit);
  };
  EXPECT_EQ(said([] { return 7; }), "7");
  EXPECT_EQ(said([]() -> int { throw std::runtime_error("no\x1b"); }), "litags-test: no?\n1");
  EXPECT_EQ(said([]() -> int { throw std::bad_alloc(); }), "litags-test: out of memory\n1");
  EXPECT_EQ(said([]() -> int { throw 7; }), "litags-test: an exception of unknown kind\n1");
  EXPECT_EQ(RunProgram(
                "litags-test", []() -> int { throw 7; }, 5),
            5);
}

TEST_F(ArgumentsTest, HelpGoesToStdoutWithTheRanges) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(Said({"--help"}), "0");
  const std::string help = testing::internal::GetCapturedStdout();
  for (const char* range :
       {"INT:0..256", "FLOAT:above 0", "INT:from 0", "INT:bytes", "TEXT:text|json"}) {
    EXPECT_THAT(help, HasSubstr(range));
  }
}

}  // namespace
}  // namespace litags
