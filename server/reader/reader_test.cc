#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/sandbox.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/testing_photos.h"
#include "engine/video/testing_video.h"
#include "server/reader/channel.h"
#include "server/reader/file_findings.h"
#include "server/reader/file_reader.h"
#include "server/testing/archives.h"
#include "server/testing/eventually.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pair;

std::vector<pid_t> ChildrenOf(pid_t process) {
  std::vector<pid_t> found;
  std::error_code error;  // threads come and go
  const std::string tasks = "/proc/" + std::to_string(process) + "/task";
  for (std::filesystem::directory_iterator it(tasks, error), end; !error && it != end;
       it.increment(error)) {
    std::ifstream children(it->path() / "children");
    for (pid_t child; children >> child;) found.push_back(child);
  }
  return found;
}

class RemoteReaderTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& bytes) {
    const std::string path = dir_.path() + "/" + std::to_string(++files_);
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  absl::Status Check(const std::string& bytes, FileRole role = FileRole::kPhoto,
                     const std::string& name = "") {
    FileRecord file;
    file.name = name;
    file.role = role;
    file.size_bytes = static_cast<int64_t>(bytes.size());
    const absl::Status status = reader_->Check(Write(bytes), "images[x]", &file, cancel_);
    size_ = {file.width, file.height};
    about_ = file.about;
    return status;
  }

  absl::Status Extract(const std::string& bytes, ArchiveSink* sink,
                       const ArchiveLimits& limits = {}) {
    const auto archive = reader_->OpenArchive(Write(bytes), limits, "archives[a]", sink, cancel_);
    if (!archive.ok()) return archive.status();
    for (;;) {
      const absl::StatusOr<bool> more = (*archive)->ReadNext();
      if (!more.ok() || !*more) return more.status();
    }
  }

  // The program that makes the processes.
  static pid_t Program() {
    pid_t found = 0;
    Eventually([&] {
      const auto children = ChildrenOf(getpid());
      if (!children.empty()) found = children.front();
      return found != 0;
    });
    return found;
  }

  // The process of the archive in hand.
  static pid_t ReaderProcess() {
    pid_t found = 0;
    Eventually([&] {
      const auto children = ChildrenOf(Program());
      if (!children.empty()) found = children.back();
      return found != 0;
    });
    return found;
  }

  static std::string ProcFile(pid_t process, const std::string& name) {
    std::ifstream file("/proc/" + std::to_string(process) + "/" + name);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  // One that nobody has waited for yet has ended, too.
  static bool HasEnded(pid_t process) {
    const std::string stat = ProcFile(process, "stat");
    return stat.empty() || stat.find(") Z") != std::string::npos;
  }

  TempDir dir_;
  CancelToken cancel_;
  std::unique_ptr<FileReader> reader_ = MakeRemoteReader({TEST_READER});
  std::pair<int, int> size_;
  std::string about_;
  int files_ = 0;
};

TEST(Channel, TheLastWordsOfAnEndThatClosesBeforeItHasReadAllAreReceived) {
  auto ends = Channel::MakePair();
  ASSERT_TRUE(ends.ok()) << ends.status();
  ASSERT_TRUE(ends->first.Send("unread"));
  ASSERT_TRUE(ends->second.Send("last words"));
  ends->second = Channel();
  EXPECT_EQ(ends->first.Receive(), "last words");
  EXPECT_EQ(ends->first.Receive(), std::nullopt);
}

TEST(PhotoFindings, ComeBackAsTheyWereWritten) {
  const PhotoFindings wrote{35,  1 / 30.0, 800, 1.8,  12.25, -0.001,
                            0.5, 0.25,     0.4, 0.01, 1,     "0123456789abcdef"};
  const auto read = ParsePhotoFindings(Encode(wrote));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(Encode(*read), Encode(wrote));
  EXPECT_EQ(read->focal_length, 35);
  EXPECT_EQ(read->light, -0.001);
  EXPECT_EQ(read->has_views, 1);
  EXPECT_EQ(ParsePhotoFindings(Encode(PhotoFindings{}))->pixels, "");
}

TEST(PhotoFindings, OfAProcessThatWasTakenOverAreChecked) {
  const std::string good = "4 35 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 0123456789abcdef";
  EXPECT_TRUE(ParsePhotoFindings(good).has_value());
  for (const char* bad : {"", "4", "2 35 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 0123456789abcdef",
                          "4 nan 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 -",
                          "4 1e99 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 -",
                          "4 x 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 -",
                          "4 35 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 <b>",
                          "4 35 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0 - -",
                          "4 35 0.03 800 1.8 12 0.004 0.5 0.2 0.4 0.01 0"}) {
    EXPECT_FALSE(ParsePhotoFindings(bad).has_value()) << bad;
  }
}

TEST(VideoFindings, ComeBackAsTheyWereWrittenAndAreChecked) {
  const auto read = ParseVideoFindings(Encode(VideoFindings{12.5, 375}));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->seconds, 12.5);
  EXPECT_EQ(read->frames, 375);
  for (const char* bad : {"", "video1", "video1 1", "video1 -1 2", "video1 1 nan", "video1 1 2 3",
                          "video2 1 2", "2 35 0.03 800 1.8 12 0.004 0.5 0.2 -"}) {
    EXPECT_FALSE(ParseVideoFindings(bad).has_value()) << bad;
  }
}

TEST_F(RemoteReaderTest, SaysOfEachRoleWhatTheSameCodeHereSays) {
  const auto here = MakeInProcessReader();
  const std::string json = R"({"w": 64, "h": 48, "fl_x": 50, "frames": [)";
  const std::vector<std::pair<FileRole, std::string>> files = {
      {FileRole::kPhoto, TestJpeg()},
      {FileRole::kPhoto, TestPng(7, 5)},
      {FileRole::kPhoto, TestPng(1600, 1200)},  // which OpenCV shrinks by threads
      {FileRole::kPhoto, TestJpeg().substr(0, 300)},
      {FileRole::kPhoto, "neither"},
      {FileRole::kMask, TestPng()},
      {FileRole::kMask, TestJpeg()},
      {FileRole::kDepth, "Pf\n2 1\n-1.0\n12345678"},
      {FileRole::kDepth, "\x93NUMPY"},
      {FileRole::kCameras, json},
      {FileRole::kCameras, json + "]}"}};
  for (const auto& [role, bytes] : files) {
    FileRecord file;
    file.role = role;
    file.size_bytes = static_cast<int64_t>(bytes.size());
    const absl::Status expected = here->Check(Write(bytes), "images[x]", &file, {});
    const absl::Status status = Check(bytes, role);
    EXPECT_EQ(status, expected);
    EXPECT_EQ(Reason(status), Reason(expected));
    EXPECT_EQ(about_, file.about);
    EXPECT_EQ(size_, std::pair(file.width, file.height));
  }
}

// Of what they are read as, only the name tells.
TEST_F(RemoteReaderTest, FilesOfAColmapModelAreReadAsTheirNamesSay) {
  const std::string camera = "1 PINHOLE 64 48 50 50 32 24\n";
  const auto check = [&](const char* name) { return Check(camera, FileRole::kColmap, name); };
  EXPECT_EQ(check("cameras.txt"), absl::OkStatus());
  EXPECT_EQ(Reason(check("images.txt")), "MODEL_CORRUPT");
  EXPECT_EQ(Reason(check("cameras.bin")), "MODEL_TRUNCATED");
}

TEST_F(RemoteReaderTest, TheNamesOfCamerasPhotosAreFound) {
  const auto check = [&](int count) {
    std::string images;
    for (int i = 1; i <= count; ++i) {
      absl::StrAppend(&images, i, " 1 0 0 0 0 0 ", i, " 1 left/", i, ".jpg\n\n");
    }
    return Check(images, FileRole::kColmap, "images.txt");
  };
  ASSERT_EQ(check(4000), absl::OkStatus());
  EXPECT_EQ(about_, "") << "more keys than a row should hold";
  ASSERT_EQ(check(2000), absl::OkStatus());
  const auto cameras = ParseCameraFindings(about_);
  ASSERT_TRUE(cameras);
  EXPECT_EQ(cameras->path, "left/1.jpg");
  EXPECT_TRUE(cameras->MayHave("7.png"));
  EXPECT_TRUE(cameras->MayHave("left_7.jpg"));
  EXPECT_FALSE(cameras->MayHave("right_7.jpg"));
  ASSERT_EQ(Check("1 PINHOLE 64 48 50 50 32 24\n", FileRole::kColmap, "cameras.txt"),
            absl::OkStatus());
  EXPECT_EQ(about_, "");
}

TEST(CameraFindings, AreTakenAsTheyAreWrittenOnly) {
  const std::string about = Encode(CameraFindings::Of({"a.jpg", "b.jpg"}));
  const auto read = ParseCameraFindings(about);
  ASSERT_TRUE(read);
  EXPECT_EQ(Encode(*read), about);
  for (const char* other : {"", "cameras1", "cameras1 YQ==", "cameras1 YQ== AAAA",
                            "cameras1 YQ== A", "cameras1 /w== AAAAAA==", "cameras2 YQ== AAAAAA==",
                            "cameras1 YQ== AgAAAAEAAAA=", "cameras1 YQ== AAAAAA== x"}) {
    EXPECT_FALSE(ParseCameraFindings(other)) << other;
  }
  EXPECT_TRUE(ParseCameraFindings("cameras1 YQ== AAAAAA=="));
}

// As the engine does, which trains its photo without.
TEST_F(RemoteReaderTest, ADepthMapMayHaveHolesOnly) {
  const std::string nan("\0\0\xC0\x7F", 4);
  EXPECT_EQ(Check("Pf\n2 1\n-1.0\n" + nan + nan, FileRole::kDepth), absl::OkStatus());
  EXPECT_EQ(size_, std::pair(2, 1));
  EXPECT_EQ(Reason(Check("Pf\n2 1\n-1.0\n" + nan, FileRole::kDepth)), "DEPTH_TRUNCATED");
}

// As the engine does: the size is that of the photo, which may come later.
TEST_F(RemoteReaderTest, CamerasMaySayTheirAngleAlone) {
  const std::string frame =
      R"({"file_path": "r_0", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]})";
  EXPECT_EQ(Check(R"({"camera_angle_x": 0.7, "frames": [)" + frame + "]}", FileRole::kCameras),
            absl::OkStatus());
  EXPECT_EQ(Reason(Check(R"({"frames": [)" + frame + "]}", FileRole::kCameras)), "MISSING_KEY");
}

// Of videos the head is read, and the first frames. All codecs that phones and cameras have.
TEST_F(RemoteReaderTest, SaysOfVideosWhatTheSameCodeHereSays) {
  const auto here = MakeInProcessReader();
  std::vector<std::string> videos = {"no video", EncodeVideo(WalkFrames(96, 64, 1, 0), {})};
  for (const char* codec : {"libx264", "libx265", "libsvtav1", "libvpx-vp9", "mpeg4"}) {
    TestVideo options;
    options.codec = codec;
    options.container = "matroska";
    videos.push_back(EncodeVideo(WalkFrames(96, 64, 6, 1), options));
    EXPECT_NE(videos.back(), "") << codec;
    videos.push_back(videos.back().substr(0, 600));
  }
  int good = 0;
  for (const std::string& bytes : videos) {
    FileRecord file;
    file.role = FileRole::kVideo;
    file.size_bytes = static_cast<int64_t>(bytes.size());
    const absl::Status expected = here->Check(Write(bytes), "images[x]", &file, {});
    const absl::Status status = Check(bytes, FileRole::kVideo);
    EXPECT_EQ(status, expected);
    EXPECT_EQ(Reason(status), Reason(expected));
    EXPECT_EQ(size_, std::pair(file.width, file.height));
    good += status.ok();
  }
  EXPECT_EQ(good, 5);
}

// Their decoders have to do without threads, files and whatever else the process gave up.
TEST_F(RemoteReaderTest, SaysOfEachFormatOfPhotosWhatTheSameCodeHereSays) {
  const auto here = MakeInProcessReader();
  std::vector<std::pair<std::string, std::string>> photos = {
      {"dng", EncodeDng(FlatFrame({1000, 2000, 500}, 320, 240))}};
  for (const TestFormat& format : TestFormats()) {
    photos.emplace_back(format.name, format.encode(Ramp(3, 320, 240), {}));
  }
  for (const auto& [name, whole] : photos) {
    for (const size_t size : {whole.size(), whole.size() - 20, whole.size() / 2, size_t{40}}) {
      const std::string bytes = whole.substr(0, size);
      FileRecord file;
      file.size_bytes = static_cast<int64_t>(size);
      const absl::Status expected = here->Check(Write(bytes), "images[x]", &file, {});
      EXPECT_EQ(expected.ok(), size == whole.size()) << name << expected;
      const absl::Status status = Check(bytes);
      EXPECT_EQ(status, expected) << name;
      EXPECT_EQ(Reason(status), Reason(expected)) << name;
      EXPECT_EQ(size_, std::pair(file.width, file.height)) << name;
    }
  }
}

TEST_F(RemoteReaderTest, UnpacksAnArchiveAndHandsOnItsErrors) {
  const std::string large(300'000, 'x');
  const std::string tar =
      Tar({{"a/b\xC3\xBC.png", large}, {"unwanted", "1234"}, {"c.jpg", "short"}});
  MapSink sink;
  EXPECT_EQ(Extract(tar, &sink), absl::OkStatus());
  EXPECT_THAT(sink.files, ElementsAre(Pair("a|b\xC3\xBC.png", large), Pair("c.jpg", "short")));
  ArchiveLimits limits;
  limits.max_entry_bytes = 1000;
  EXPECT_EQ(Reason(Extract(tar, &sink, limits)), "ARCHIVE_ENTRY_TOO_LARGE");
  EXPECT_EQ(Reason(Extract(Tar({{"../a", "x"}}), &sink)), "ARCHIVE_ENTRY_UNSAFE");
  EXPECT_EQ(Reason(Extract("no archive", &sink)), "ARCHIVE_NOT_RECOGNIZED");
}

TEST_F(RemoteReaderTest, ManyFilesAtOnceGetTheirOwnAnswers) {
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    const std::string path = Write(TestPng(10 + i, 20));
    threads.emplace_back([&, path, i] {
      for (int round = 0; round < 10; ++round) {
        FileRecord file;
        if (!reader_->Check(path, "images[x]", &file, {}).ok() || file.width != 10 + i) ++wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST_F(RemoteReaderTest, AFileThatTakesTooMuchMemoryIsRefusedAndTheNextOneIsRead) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "a sanitizer needs more memory";
  reader_ = MakeRemoteReader({TEST_READER}, {.memory_bytes = int64_t{88} << 20});
  const absl::Status status = Check(TestPng(3500, 3500));
  EXPECT_EQ(Reason(status), "FILE_CHECK_FAILED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("images[x]: reading it takes more memory"));
  // What libjpeg says when it gets no memory.
  EXPECT_EQ(Reason(Check(TestJpeg(6000, 4000))), "IMAGE_CORRUPT");
  EXPECT_EQ(Check(TestJpeg()), absl::OkStatus());
}

TEST_F(RemoteReaderTest, AFileThatTakesTooMuchTimeIsRefused) {
  MapSink sink;
  sink.on_begin = [] { kill(ReaderProcess(), SIGXCPU); };  // as the kernel does
  const absl::Status status = Extract(Tar({{"a.png", "x"}}), &sink);
  EXPECT_EQ(Reason(status), "FILE_CHECK_FAILED");
  EXPECT_THAT(std::string(status.message()), HasSubstr("more time"));
}

TEST_F(RemoteReaderTest, AProcessThatDiesInTheMiddleFailsItsFileAndNoOther) {
  MapSink sink;
  pid_t program = 0;
  sink.on_begin = [&] {
    program = Program();
    kill(ReaderProcess(), SIGSEGV);
  };
  const std::string tar = Tar({{"a.png", std::string(1 << 20, 'x')}, {"b.png", "x"}});
  const absl::Status status = Extract(tar, &sink);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Reason(status), "FILE_CHECK_FAILED");
  EXPECT_EQ(GetErrorDetail(status)->field, "archives[a]");
  sink.on_begin = nullptr;
  EXPECT_EQ(Extract(tar, &sink), absl::OkStatus());
  EXPECT_EQ(Program(), program);
}

TEST_F(RemoteReaderTest, AProgramThatDiesIsStartedAgainAndTheFileIsNotToBlame) {
  ASSERT_EQ(Check(TestPng()), absl::OkStatus());
  const pid_t program = Program();
  MapSink sink;
  sink.on_begin = [&] {
    const pid_t reader = ReaderProcess();
    kill(program, SIGKILL);
    EXPECT_TRUE(Eventually([&] { return HasEnded(reader); }));
  };
  const absl::Status status = Extract(Tar({{"a.png", std::string(1 << 20, 'x')}}), &sink);
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
  EXPECT_EQ(Reason(status), "FILE_CHECK_UNAVAILABLE");
  EXPECT_EQ(Check(TestPng()), absl::OkStatus());
  EXPECT_NE(Program(), program);
}

TEST_F(RemoteReaderTest, ACancelledCallEndsItsProcess) {
  ASSERT_EQ(Check(TestPng()), absl::OkStatus());
  const pid_t program = Program();
  pid_t reader = 0;
  MapSink sink;
  sink.on_begin = [&] {
    reader = ReaderProcess();
    cancel_.Cancel();
  };
  const std::string tar = Tar({{"a.png", std::string(1 << 20, 'x')}, {"b.png", "x"}});
  EXPECT_EQ(Extract(tar, &sink).code(), absl::StatusCode::kCancelled);
  ASSERT_NE(reader, 0);
  EXPECT_TRUE(Eventually([&] { return HasEnded(reader); }));
  // ThreadSanitizer handles a signal only once the call returns that the program waits in.
  if (!kBuiltWithSanitizer) {
    EXPECT_TRUE(Eventually([&] { return ChildrenOf(program).empty(); }));
  }
}

TEST_F(RemoteReaderTest, ProcessesHaveNoSecretsFewSystemCallsAndLimits) {
  setenv("AWS_SECRET_ACCESS_KEY", "SECRET", 1);
  MapSink sink;
  std::string status, environment, limits;
  sink.on_begin = [&] {
    const pid_t process = ReaderProcess();
    status = ProcFile(process, "status");
    environment = ProcFile(process, "environ");
    limits = ProcFile(process, "limits");
  };
  ASSERT_EQ(Extract(Tar({{"a.png", "x"}}), &sink), absl::OkStatus());
  EXPECT_THAT(environment, HasSubstr("OMP_NUM_THREADS=1"));
  EXPECT_THAT(environment, Not(HasSubstr("SECRET")));
  EXPECT_THAT(status, HasSubstr("NoNewPrivs:\t1"));
  EXPECT_THAT(status, HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(limits, ContainsRegex("Max cpu time +600 +602 "));
  EXPECT_THAT(limits, ContainsRegex("Max file size +0 +0 "));
  if (!kBuiltWithSanitizer) {
    EXPECT_THAT(limits, ContainsRegex("Max data size +3221225472 "));
  }
}

}  // namespace
}  // namespace litags
