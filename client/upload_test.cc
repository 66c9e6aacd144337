// Uploads to services of our own making, in this process.
#include "client/upload.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/capture.h"
#include "client/client.h"
#include "client/client_test_util.h"
#include "client/status.h"

namespace litags::client {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class UploadTest : public ClientTest {
 protected:
  absl::Status Upload() {
    auto capture = ScanCapture(dir_.string(), "", "", "");
    if (!capture.ok()) return capture.status();
    return UploadFiles(*client_, "jobs/1", capture->files,
                       [this](const UploadProgress& progress) { last_progress_ = progress; });
  }

  UploadProgress last_progress_;
};

TEST_F(UploadTest, AnUploadSendsNamesWithoutFoldersAndAllBytes) {
  const std::string large(700'000, 'x');  // more than two chunks
  Write("b.jpg", large);
  Write("a.JPG", "small");
  ASSERT_TRUE(Upload().ok());
  EXPECT_THAT(service_.state()->stored,
              ElementsAre(std::pair("a.JPG", "small"), std::pair("b.jpg", large)));
  EXPECT_EQ(last_progress_.files_done, 2);
  EXPECT_EQ(last_progress_.bytes_done, 700'005);
}

TEST_F(UploadTest, AnUploadOfWhichTheServerHasLessIsNoSuccess) {
  Write("a.jpg", "photo");
  Write("lost.jpg", "photo");
  const absl::Status status = Upload();
  EXPECT_EQ(DetailOf(status).reason(), "UPLOAD_BROKEN");
  EXPECT_THAT(std::string(status.message()), HasSubstr("1 of 2 files"));
}

TEST_F(UploadTest, AFileThatBecomesShorterIsNotSentWhole) {
  Write("a.jpg", "photo");
  auto capture = ScanCapture(dir_.string(), "", "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  ASSERT_TRUE(ContentDigest(capture->files, interrupt_, [](const LocalFile&) {}).ok());
  std::filesystem::resize_file(dir_ / "a.jpg", 3);
  const absl::Status status =
      UploadFiles(*client_, "jobs/1", capture->files, [](const UploadProgress&) {});
  EXPECT_EQ(DetailOf(status).reason(), "FILE_CHANGED");
}

class ReadFilesTest : public UploadTest {
 protected:
  // What is left out of the folder, with depth maps in "depth"; files_ is the rest.
  absl::StatusOr<std::vector<std::string>> Read(bool strict = false) {
    const std::filesystem::path depth = dir_ / "depth";
    auto capture = ScanCapture(dir_, "", std::filesystem::exists(depth) ? depth : "", "");
    if (!capture.ok()) return capture.status();
    auto left_out = ReadFiles(
        capture->files, interrupt_, [](const LocalFile&) {}, strict);
    files_.clear();
    for (const LocalFile& file : capture->files) files_.push_back(file.name);
    return left_out;
  }

  void Link(const std::string& name, const std::string& target) {
    std::filesystem::create_directories((dir_ / name).parent_path());
    std::filesystem::create_symlink(target, dir_ / name);
  }

  std::vector<std::string> files_;
};

TEST_F(ReadFilesTest, PhotosThatCannotBeSentAreLeftOutWithWhatIsTheirs) {
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "masks/a.png", "masks/gone.jpg.png",
                           "masks/caf\xE9.png", "depth/a.npy", "depth/caf\xE9.npy"}) {
    Write(name, "x");
  }
  Write("caf\xE9.jpg", "photo");
  Link("gone.jpg", "nowhere");
  Link("damaged.jpg", "/proc/self/mem");  // of which no byte can be read
  Link("masks/gone.png", "nowhere");
  Link("depth/gone.npy", "nowhere");
  const auto left_out = Read();
  ASSERT_TRUE(left_out.ok()) << left_out.status();
  EXPECT_THAT(
      *left_out,
      ElementsAre(AllOf(HasSubstr("caf?.jpg is left out, with caf?.png: "), HasSubstr("not UTF-8")),
                  AllOf(HasSubstr("gone.jpg is left out, with gone.jpg.png, gone.png: "),
                        HasSubstr("No such file")),
                  HasSubstr("caf?.npy is left out: "), HasSubstr("gone.npy is left out: "),
                  HasSubstr("damaged.jpg is left out: ")));
  EXPECT_THAT(files_, ElementsAre("a.jpg", "b.jpg", "c.jpg", "a.npy", "a.png"));
  EXPECT_EQ(DetailOf(Read(/*strict=*/true).status()).reason(), "BAD_FILE_NAME");
}

TEST_F(ReadFilesTest, OfTooFewPhotosNoneIsLeftOut) {
  for (const char* name : {"a.jpg", "b.jpg"}) Write(name, "x");
  Link("gone.jpg", "nowhere");
  EXPECT_EQ(DetailOf(Read().status()).reason(), "FILE_UNREADABLE");
  Write("caf\xE9.jpg", "x");
  EXPECT_EQ(DetailOf(Read().status()).reason(), "BAD_FILE_NAME");
}

TEST_F(ReadFilesTest, WhatAPhotoThatIsSentWouldMissIsNotLeftOut) {
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "d.jpg"}) Write(name, "x");
  for (const std::string name : {"masks/a.png", "depth/a.npy"}) {
    Link(name, "nowhere");
    const absl::Status status = Read().status();
    EXPECT_EQ(DetailOf(status).reason(), "FILE_UNREADABLE") << name;
    EXPECT_EQ(DetailOf(status).field(), (dir_ / name).string());
    std::filesystem::remove_all((dir_ / name).parent_path());
  }
  EXPECT_TRUE(Read().ok());
}

TEST_F(UploadTest, APhotoWhoseNameIsRefusedIsLeftOutOnOneLine) {
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg", "two\nlines.jpg", "masks/two\nlines.png"}) {
    Write(name, "x");
  }
  ASSERT_TRUE(Upload().ok());
  EXPECT_EQ(service_.state()->stored.size(), 3u);
  EXPECT_THAT(last_progress_.left_out,
              ElementsAre(HasSubstr("two?lines.jpg is left out, with two?lines.png: ")));
}

TEST_F(UploadTest, AnUploadOverABreakingConnectionCompletes) {
  for (int i = 0; i < 6; ++i) Write(absl::StrCat(i, ".png"), absl::StrCat("photo ", i));
  ASSERT_TRUE(client_->GetJob("jobs/1").ok());  // the server has answered once
  service_.state()->breaks_left = 2;
  ASSERT_TRUE(Upload().ok());
  EXPECT_EQ(service_.state()->streams, 3);
  EXPECT_EQ(service_.state()->stored.size(), 6u);
  EXPECT_EQ(service_.state()->stored["5.png"], "photo 5");
}

TEST_F(UploadTest, ARefusedFileIsNotSentAgain) {
  Write("bad.jpg", "no photo");
  const absl::Status status = Upload();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).field(), "images[bad.jpg]");
  EXPECT_EQ(service_.state()->streams, 1);
}

TEST_F(UploadTest, NoPhotoIsSentBesideCamerasThatAreRefused) {
  Write("a.jpg", "photo");
  Write("m/cameras.txt", "cameras");
  Write("m/images.txt", "images");
  auto capture = ScanCapture(dir_.string(), (dir_ / "m").string(), "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  service_.state()->refused = "cameras.txt";
  const auto upload = [&] {
    return UploadFiles(*client_, "jobs/1", capture->files, [](const UploadProgress&) {});
  };
  EXPECT_EQ(DetailOf(upload()).reason(), "MODEL_CORRUPT");
  EXPECT_EQ(service_.state()->announced.count("a.jpg"), 0);
  service_.state()->refused = "";
  EXPECT_EQ(upload(), absl::OkStatus());
  EXPECT_EQ(service_.state()->stored.size(), 3u);
}

TEST_F(UploadTest, AVideoIsSentAsOneFile) {
  Write("night.MP4", "video");
  const auto capture = ScanCapture((dir_ / "night.MP4").string(), "", "", "");
  ASSERT_TRUE(capture.ok()) << capture.status();
  ASSERT_EQ(capture->files.size(), 1u);
  EXPECT_EQ(capture->files[0].role, v1::FILE_ROLE_VIDEO);
  EXPECT_EQ(capture->files[0].name, "night.MP4");
  // In a folder it is none of the photos.
  const absl::Status folder = ScanCapture(dir_.string(), "", "", "").status();
  EXPECT_THAT(std::string(folder.message()), HasSubstr("give the video itself: night.MP4"));
}

TEST_F(UploadTest, AnUnreadablePhotoIsLeftOutWithItsMaskWhileEnoughRemain) {
  for (const char* name :
       {"a.jpg", "b.jpg", "bad.jpg", "c.jpg", "masks/a.jpg.png", "masks/bad_MASK.png"}) {
    Write(name, "x");
  }
  ASSERT_TRUE(Upload().ok());
  EXPECT_EQ(service_.state()->stored.size(), 4u);
  EXPECT_EQ(service_.state()->stored.count("bad_MASK.png"), 0u);
  EXPECT_THAT(last_progress_.left_out,
              ElementsAre(HasSubstr("bad.jpg is left out, with bad_MASK.png: ")));
  EXPECT_EQ(last_progress_.files_done, 4);
  EXPECT_EQ(last_progress_.bytes, 4);

  auto capture = ScanCapture(dir_.string(), "", "", "");
  ASSERT_TRUE(capture.ok());
  const absl::Status strict = UploadFiles(
      *client_, "jobs/1", capture->files, [](const UploadProgress&) {}, /*strict=*/true);
  EXPECT_EQ(DetailOf(strict).field(), "images[bad.jpg]");
}

// As of a camera that writes raw files beside JPEGs.
TEST_F(UploadTest, AnUnreadablePhotoLeavesItsMaskToAnotherOfItsStem) {
  for (const char* name : {"a.jpg", "b.jpg", "bad.jpg", "bad.png", "masks/bad_mask.png"}) {
    Write(name, "x");
  }
  ASSERT_TRUE(Upload().ok());
  EXPECT_EQ(service_.state()->stored.size(), 4u);
  EXPECT_EQ(service_.state()->stored.count("bad_mask.png"), 1u);
  EXPECT_THAT(last_progress_.left_out, ElementsAre(HasSubstr("bad.jpg is left out: ")));
  EXPECT_EQ(last_progress_.files_done, 4);
}

TEST_F(UploadTest, AnUnreadablePhotoThatComesLastIsNamedToo) {
  for (const char* name : {"a.jpg", "aa.jpg", "ab.jpg", "ac.jpg"}) Write(name, "x");
  Write("bad.jpg", std::string(9 << 20, 'x'));  // alone in its stream
  ASSERT_TRUE(Upload().ok());
  EXPECT_EQ(last_progress_.files, 4);
  EXPECT_EQ(last_progress_.files_done, 4);
  EXPECT_THAT(last_progress_.left_out, ElementsAre(HasSubstr("bad.jpg is left out: ")));
}

TEST_F(UploadTest, AnUnreadablePhotoAfterItsMaskTakesNothingElseAlong) {
  std::vector<LocalFile> files;
  const auto add = [&](const std::string& name, v1::FileRole role, const std::string& content) {
    Write(name, content);
    files.push_back({dir_ / name, name, role, "", static_cast<int64_t>(content.size()), ""});
  };
  add("bad.png", v1::FILE_ROLE_MASK, std::string(9 << 20, 'x'));  // alone in the first stream
  add("bad_mask.png", v1::FILE_ROLE_MASK, "x");
  for (const char* name : {"bad.jpg", "a.jpg", "b.jpg", "c.jpg"}) {
    add(name, v1::FILE_ROLE_PHOTO, "x");
  }
  add("a.png", v1::FILE_ROLE_MASK, "x");
  const absl::Status status =
      UploadFiles(*client_, "jobs/1", files,
                  [this](const UploadProgress& progress) { last_progress_ = progress; });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_THAT(service_.state()->stored,
              ElementsAre(std::pair("a.jpg", "x"), std::pair("a.png", "x"), std::pair("b.jpg", "x"),
                          std::pair("c.jpg", "x")));
  EXPECT_EQ(files.size(), 4u);
  EXPECT_EQ(last_progress_.files_done, 4);
  EXPECT_EQ(last_progress_.bytes_done, 4);
  EXPECT_EQ(last_progress_.bytes, 4);
}

}  // namespace
}  // namespace litags::client
