#include "engine/video/frame_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

using testing::HasSubstr;

class FrameProcess : public testing::Test {
 protected:
  absl::StatusOr<PickedFrames> Pick(const std::string& bytes,
                                    const std::vector<std::string>& program, int most = 8) {
    EXPECT_TRUE(WriteFileAtomically(video_, bytes).ok());
    std::filesystem::create_directory(frames_);
    return PickFramesInto(frames_, video_, field_, most, program, nullptr, cancel_);
  }

  std::map<std::string, std::string> Frames() const {
    std::map<std::string, std::string> frames;
    const auto names = ListPhotos(frames_, "frames");
    EXPECT_TRUE(names.ok()) << names.status();
    for (const std::string& name : names.value_or(std::vector<std::string>())) {
      frames[name] = *ReadFile(frames_ + "/" + name, "frame", 1 << 30);
    }
    return frames;
  }

  TempDir dir_;
  CancelToken cancel_;
  std::string field_ = "videos[v]";
  const std::string video_ = dir_ / "v.mov", frames_ = dir_ / "frames";
  const std::vector<std::string> program_ = {TEST_PICK_FRAMES, kPickFramesCommand};
};

// Whatever codec a phone has: the filter of system calls lets all of them work.
class FrameProcessOf : public FrameProcess, public testing::WithParamInterface<const char*> {};

TEST_P(FrameProcessOf, GivesTheSameFramesAsThisProcess) {
  TestVideo options;
  options.codec = GetParam();
  options.container = "matroska";
  const std::string video = EncodeVideo(WalkFrames(320, 180, 40, 5), options);
  if (video.empty()) GTEST_SKIP() << "this FFmpeg does not write it";
  const auto confined = Pick(video, program_);
  ASSERT_TRUE(confined.ok()) << confined.status();
  EXPECT_EQ(confined->frames, 40);
  EXPECT_EQ(confined->chosen, 8);
  const auto frames = Frames();
  ASSERT_EQ(frames.size(), 8u);
  EXPECT_TRUE(frames.contains("frame_0001.png"));
  ASSERT_TRUE(Pick(video, {}).ok());
  EXPECT_TRUE(frames == Frames());
}

INSTANTIATE_TEST_SUITE_P(Codecs, FrameProcessOf,
                         testing::Values("libx264", "libx265", "libsvtav1", "libvpx-vp9", "mpeg4"),
                         [](const auto& info) {
                           std::string name = info.param;
                           std::erase(name, '-');
                           return name;
                         });

TEST_F(FrameProcess, ErrorsComeThrough) {
  const auto picked = Pick("no video", program_);
  EXPECT_EQ(picked.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Reason(picked.status()), "VIDEO_NOT_RECOGNIZED");
  EXPECT_EQ(GetErrorDetail(picked.status())->field, "videos[v]");
  EXPECT_THAT(std::string(picked.status().message()), HasSubstr("videos[v]: is no video"));
  EXPECT_EQ(Reason(Pick("", program_).status()), "FILE_EMPTY");
  field_ = "videos[a\tb\u202e.mov]";
  const auto odd = Pick("no video", program_);
  EXPECT_EQ(Reason(odd.status()), "VIDEO_NOT_RECOGNIZED");
  EXPECT_THAT(std::string(odd.status().message()), HasSubstr("videos[a b .mov]: is no video"));
}

// The file is not to blame for what fails here.
TEST_F(FrameProcess, AnInternalErrorStaysOne) {
  const auto picked = Pick("a video", {"/bin/sh", "-c", "echo error 13 IO_ERROR the disk failed"});
  EXPECT_EQ(picked.status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(picked.status()), "IO_ERROR");
  EXPECT_EQ(picked.status().message(), "the disk failed");
  const auto odd = Pick("a video", {"/bin/sh", "-c", "echo error 7 VIDEO_CORRUPT no permission"});
  EXPECT_EQ(odd.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(FrameProcess, OneThatSaysNothingOrLiesGivesAnError) {
  const std::string video = EncodeVideo(WalkFrames(96, 64, 12, 3), {});
  EXPECT_EQ(Reason(Pick(video, {"/bin/true"}).status()), "VIDEO_CORRUPT");
  EXPECT_EQ(Reason(Pick(video, {"/bin/sh", "-c", "kill -SEGV $$"}).status()), "VIDEO_CORRUPT");
  for (const char* lie : {"frame 99", "frame -1", "frame 99999999999", "frame x", "progress",
                          "error 3 reason", "error 3 rm-rf x", "done 1 2 x", "done 1 2 3.0 0.0"}) {
    EXPECT_EQ(Reason(Pick(video, {"/bin/sh", "-c", std::string("echo ") + lie}).status()),
              "VIDEO_CORRUPT")
        << lie;
  }
}

// As the kernel tells a process whose processor time is used up.
TEST_F(FrameProcess, OneThatTakesTooLongSaysSo) {
  const std::string video = EncodeVideo(WalkFrames(96, 64, 3000, 0.1), {});
  // Once it catches the signal, number 24.
  const char* script =
      "#!/bin/sh\n"
      "(until grep -q 'SigCgt:.*[89a-f].....$' /proc/$$/status; do sleep 0.01; done; "
      "sleep 0.05; kill -XCPU $$) & "
      "exec \"$@\"";
  // Of programs it may run those in its folder.
  const std::string wrapper = dir_ / "wrapper", program = dir_ / "program";
  std::filesystem::copy_file(program_[0], program);
  ASSERT_TRUE(WriteFileAtomically(wrapper, script).ok());
  std::filesystem::permissions(wrapper, std::filesystem::perms::owner_all);
  const auto picked = Pick(video, {wrapper, program, program_[1]});
  EXPECT_EQ(Reason(picked.status()), "VIDEO_TOO_COSTLY");
  EXPECT_THAT(std::string(picked.status().message()), HasSubstr("more time than a video may"));
}

// Also while this process decodes: before a frame is looked at, one of which would be too few.
TEST_F(FrameProcess, DoesNotBeginWhereItIsCancelled) {
  cancel_.Cancel();
  const std::string video = EncodeVideo(WalkFrames(96, 64, 1, 0), {});
  for (const auto& program : {std::vector<std::string>(), program_}) {
    const auto picked = Pick(video, program);
    EXPECT_TRUE(absl::IsCancelled(picked.status())) << picked.status();
  }
}

TEST_F(FrameProcess, IsEndedByCancelling) {
  std::thread canceller([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    cancel_.Cancel();
  });
  const std::string video = EncodeVideo(WalkFrames(96, 64, 12, 3), {});
  const auto picked = Pick(video, {"/bin/sh", "-c", "sleep 60"});
  canceller.join();
  EXPECT_TRUE(absl::IsCancelled(picked.status())) << picked.status();
}

}  // namespace
}  // namespace litags
