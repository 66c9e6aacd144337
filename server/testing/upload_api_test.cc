// Uploads: what is refused, and what goes on where it was broken off.
#include <gmock/gmock.h>
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>
#include <thread>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/limits.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/depth_io.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/png_codes.h"
#include "engine/video/testing_video.h"
#include "proto/litags/v1/limits.h"
#include "server/api/upload_files.h"
#include "server/testing/api_fixture.h"
#include "server/testing/archives.h"
#include "server/testing/faulty_blob_store.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class UploadApi : public ApiTest {
 protected:
  // What the service answers to the upload of one file into a new job.
  grpc::Status UploadOne(const TestFile& file) { return client_.Upload(NewJob(), {file}); }

  v1::ListFilesResponse FilesOf(const std::string& job) {
    v1::ListFilesRequest request;
    request.set_name(job);
    v1::ListFilesResponse files;
    grpc::ClientContext context;
    EXPECT_TRUE(client_.jobs->ListFiles(&context, request, &files).ok());
    return files;
  }
};

TEST_F(UploadApi, PhotosThatAreNoneAreRefusedByName) {
  const std::string jpeg = TestJpeg(200, 150);
  EXPECT_REFUSED(UploadOne({"a.jpg", "hello, this is text"}), INVALID_ARGUMENT,
                 "IMAGE_NOT_RECOGNIZED", "images[a.jpg]");
  EXPECT_REFUSED(UploadOne({"b.jpg", ""}), INVALID_ARGUMENT, "FILE_EMPTY", "images[b.jpg]");
  EXPECT_REFUSED(UploadOne({"c.jpg", jpeg.substr(0, jpeg.size() / 2)}), INVALID_ARGUMENT,
                 "IMAGE_TRUNCATED", "images[c.jpg]");
  const grpc::Status cameras = UploadOne({"d.json", "{", v1::FILE_ROLE_CAMERAS});
  EXPECT_EQ(cameras.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_THAT(DetailOf(cameras).field, HasSubstr("cameras[d.json]"));
  EXPECT_EQ(UploadOne({"e.npy", "junk", v1::FILE_ROLE_DEPTH}).error_code(), grpc::INVALID_ARGUMENT);
}

TEST_F(UploadApi, FilesOfAColmapModelAreReadWhenTheyCome) {
  const auto file = [](const char* name, const std::string& bytes) {
    return TestFile{name, bytes, v1::FILE_ROLE_COLMAP};
  };
  EXPECT_REFUSED(UploadOne(file("cameras.bin", "junk")), INVALID_ARGUMENT, "MODEL_TRUNCATED",
                 "colmap[cameras.bin]");
  EXPECT_REFUSED(UploadOne(file("cameras.txt", "1 PINHOLE 64 48 50 50 99 24\n")), INVALID_ARGUMENT,
                 "BAD_PRINCIPAL_POINT", "colmap[cameras.txt][1]");
  // Bytes that were read as one file are not known as another.
  const std::string no_points(8, '\0');
  EXPECT_TRUE(UploadOne(file("points3D.bin", no_points)).ok());
  EXPECT_REFUSED(UploadOne(file("images.bin", no_points)), INVALID_ARGUMENT, "NO_CAMERAS",
                 "colmap[images.bin]");
}

TEST_F(UploadApi, AVideoIsACaptureByItselfAndNeedsNoPhotos) {
  const TestFile video{"night.mov", EncodeVideo(WalkFrames(96, 64, 9, 2), {}), v1::FILE_ROLE_VIDEO};
  const TestFile other{"day.mp4", EncodeVideo(WalkFrames(96, 64, 8, 2), {}), v1::FILE_ROLE_VIDEO};
  EXPECT_REFUSED(UploadOne({"a.mov", "junk", v1::FILE_ROLE_VIDEO}), INVALID_ARGUMENT,
                 "VIDEO_NOT_RECOGNIZED", "videos[a.mov]");
  EXPECT_REFUSED(UploadOne({"a.jpg", TestJpeg(), v1::FILE_ROLE_VIDEO}), INVALID_ARGUMENT,
                 "BAD_FILE_NAME", "videos[a.jpg]");
  const auto start = [&](const std::vector<TestFile>& files) {
    const std::string job = NewJob();
    EXPECT_TRUE(client_.Upload(job, files).ok());
    return client_.Start(job);
  };
  EXPECT_TRUE(start({video}).ok());
  EXPECT_REFUSED(start({video, other}), FAILED_PRECONDITION, "VIDEO_NOT_ALONE", "videos");
  EXPECT_REFUSED(start({video, {"a.jpg", TestJpeg()}}), FAILED_PRECONDITION, "VIDEO_NOT_ALONE",
                 "videos");
}

// A mask whose right half counts.
std::string TestMask(int width = 64, int height = 48) {
  PlaneU8 mask(width, height);
  for (size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = int(i) % width < width / 2 ? 0 : 255;
  return EncodeMask(mask).value();
}

TEST_F(UploadApi, FilesTellWhatWasFoundInPhotosAndWhichAreLeftOut) {
  ImageU8 light = TestPhoto(), grey(64, 48);
  for (uint8_t& sample : light.data) sample *= 4;
  std::fill(grey.data.begin(), grey.data.end(), uint8_t{20});
  const std::string strip =
      WithPngChunk(TestPng(256, 64), "tEXt",
                   "of GPano:ProjectionType=\"equirectangular\" GPano:FullPanoWidthPixels=\"256\" "
                   "GPano:FullPanoHeightPixels=\"128\" GPano:CroppedAreaImageWidthPixels=\"256\" "
                   "GPano:CroppedAreaImageHeightPixels=\"64\" GPano:CroppedAreaTopPixels=\"32\"");
  const std::string job = NewJob();
  ASSERT_TRUE(client_
                  .Upload(job, {{"a.png", TestPng()},
                                {"s.png", strip},
                                {"a copy.png", TestPng()},
                                {"b.png", TestPng(64, 48, 1)},
                                {"c.png", *EncodePng(light)},
                                {"d.png", *EncodePng(grey)},
                                {"a.png", TestMask(), v1::FILE_ROLE_MASK}})
                  .ok());
  const v1::ListFilesResponse files = FilesOf(job);
  std::map<std::string, v1::PhotoFindings> found;
  for (const v1::JobFile& file : files.files()) {
    EXPECT_EQ(file.has_found(), file.role() == v1::FILE_ROLE_PHOTO);
    if (file.has_found()) found[file.file_name()] = file.found();
  }
  EXPECT_EQ(found["a copy.png"].left_out(), "is the same photo as a.png");
  EXPECT_EQ(found["a.png"].left_out(), "");
  EXPECT_EQ(found["s.png"].left_out(), "");
  EXPECT_THAT(found["d.png"].left_out(), HasSubstr("one colour"));
  EXPECT_GT(found["c.png"].stops(), 2);
  EXPECT_NEAR(found["d.png"].mean_code(), 20, 0.1);
  EXPECT_EQ(found["a.png"].focal_length_mm(), 0);
  EXPECT_GT(found["a.png"].sharpness(), 0);
  EXPECT_EQ(found["d.png"].sharpness(), 0);
}

TEST_F(UploadApi, OfCopiesTheOneThatCamerasNameIsNotLeftOut) {
  std::string colmap;
  for (int i = 1; i <= 2; ++i) {
    absl::StrAppend(&colmap, i, " 1 0 0 0 0 0 ", i, " 1 long_name_", i, ".png\n\n");
  }
  const std::string job = NewJob();
  ASSERT_TRUE(client_
                  .Upload(job, {{"1.png", TestPng()},
                                {"long_name_1.png", TestPng()},
                                {"2.png", TestPng(64, 48, 1)},
                                {"another_long_name_2.png", TestPng(64, 48, 1)},
                                {"images.txt", colmap, v1::FILE_ROLE_COLMAP},
                                {"another_long_name_2.pfm", EncodePfm(Planes(1, 48, 64)),
                                 v1::FILE_ROLE_DEPTH}})
                  .ok());
  const v1::ListFilesResponse files = FilesOf(job);
  std::vector<std::string> left_out;
  for (const v1::JobFile& file : files.files()) {
    if (!file.found().left_out().empty()) left_out.push_back(file.file_name());
  }
  EXPECT_THAT(left_out, ElementsAre("1.png", "2.png"));
}

TEST_F(UploadApi, MasksThatAreNoneAreRefusedByName) {
  const auto mask = [](const std::string& name, const std::string& bytes) {
    return TestFile{name, bytes, v1::FILE_ROLE_MASK};
  };
  EXPECT_REFUSED(UploadOne(mask("a.png", "junk")), INVALID_ARGUMENT, "IMAGE_NOT_RECOGNIZED",
                 "masks[a.png]");
  EXPECT_REFUSED(UploadOne(mask("a.jpg", TestJpeg())), INVALID_ARGUMENT, "BAD_FILE_NAME",
                 "masks[a.jpg]");
  EXPECT_REFUSED(UploadOne(mask("a.png", TestJpeg())), INVALID_ARGUMENT, "MASK_FORMAT",
                 "masks[a.png]");
  EXPECT_REFUSED(UploadOne(mask("a.png", EncodeMask(PlaneU8(9, 9)).value())), INVALID_ARGUMENT,
                 "MASK_BLACK", "masks[a.png]");
}

TEST_F(UploadApi, MasksMustFitAPhotoWhenTheJobStarts) {
  const std::vector<TestFile> photos = {
      {"a.png", TestPng(64, 48, 1)}, {"b.png", TestPng(64, 48, 2)}, {"d.png", TestPng(64, 48, 3)}};
  const auto start = [&](const std::string& name, const std::string& mask) {
    const std::string job = NewJob();
    // Masks may come before their photos.
    EXPECT_TRUE(client_.Upload(job, {{name, mask, v1::FILE_ROLE_MASK}}).ok());
    EXPECT_TRUE(client_.Upload(job, photos).ok());
    return client_.Start(job);
  };
  EXPECT_REFUSED(start("c.png", TestMask()), INVALID_ARGUMENT, "MASK_WITHOUT_PHOTO",
                 "masks[c.png]");
  EXPECT_REFUSED(start("a.png.png", TestMask(48, 64)), INVALID_ARGUMENT, "MASK_SIZE",
                 "masks[a.png.png]");
  EXPECT_TRUE(start("a.png.png", TestMask()).ok());
  EXPECT_TRUE(start("b.png", TestMask()).ok());
}

// Which the engine reads.
TEST_F(UploadApi, MasksMayBeNamedByTheCameras) {
  const std::string cameras =
      R"({"fl_x": 50, "frames": [{"file_path": "a.png", "mask_path": "masks/c.png",
          "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]})";
  const std::string job = NewJob();
  EXPECT_TRUE(client_
                  .Upload(job, {{"a.png", TestPng(64, 48, 1)},
                                {"b.png", TestPng(64, 48, 2)},
                                {"d.png", TestPng(64, 48, 3)},
                                {"c.png", TestMask(), v1::FILE_ROLE_MASK},
                                {"transforms.json", cameras, v1::FILE_ROLE_CAMERAS}})
                  .ok());
  EXPECT_TRUE(client_.Start(job).ok());
}

TEST_F(UploadApi, NamesThatAreNotPlainFileNamesAreRefused) {
  for (const std::string name : {"../a.jpg", "a/b.jpg", "/etc/a.jpg", "..", "", ".hidden.jpg",
                                 "a\\b.jpg", "a\nb.jpg", "a.txt", "noextension"}) {
    EXPECT_REFUSED(UploadOne({name, TestJpeg()}), INVALID_ARGUMENT, "BAD_FILE_NAME",
                   "images[" + name + "]");
  }
  const std::string longest(256, 'x');
  EXPECT_REFUSED(UploadOne({longest + ".jpg", TestJpeg()}), INVALID_ARGUMENT, "BAD_FILE_NAME",
                 "images[" + longest + ".jpg]");
}

TEST_F(UploadApi, DamagedAndDisorderlyUploadsAreRefused) {
  const std::string name = NewJob();
  const auto with_name = [&](std::vector<v1::UploadImagesRequest> messages) {
    messages.insert(messages.begin(), NameMessage(name));
    return messages;
  };
  const TestFile file{"a.png", TestPng()};
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, std::string(32, 'x')))),
                 INVALID_ARGUMENT, "FILE_DIGEST_MISMATCH", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "short"))), INVALID_ARGUMENT,
                 "FILE_DIGEST_MISSING", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", 1'000'000))), INVALID_ARGUMENT,
                 "FILE_TRUNCATED", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", 10))), INVALID_ARGUMENT,
                 "FILE_SIZE_MISMATCH", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(with_name(FileMessages(file, "", int64_t{1} << 40))),
                 RESOURCE_EXHAUSTED, "FILE_TOO_LARGE", "images[a.png]");
  EXPECT_REFUSED(UploadOne({file.name, file.bytes, static_cast<v1::FileRole>(99)}),
                 INVALID_ARGUMENT, "FILE_ROLE_UNKNOWN", "file.role");
  auto messages = with_name(FileMessages(file));
  for (const size_t size : {size_t{0}, v1::kMaxChunkBytes + 1}) {
    messages[2].set_chunk(std::string(size, 'x'));
    EXPECT_REFUSED(client_.UploadRaw(messages), INVALID_ARGUMENT, "CHUNK_SIZE_INVALID",
                   "images[a.png]");
  }
  messages[1].mutable_file()->set_offset(-1);
  EXPECT_REFUSED(client_.UploadRaw(messages), INVALID_ARGUMENT, "OFFSET_NEGATIVE", "images[a.png]");
  EXPECT_REFUSED(client_.UploadRaw(FileMessages(file)), INVALID_ARGUMENT, "UPLOAD_ORDER", "part");
  EXPECT_REFUSED(client_.UploadRaw({}), INVALID_ARGUMENT, "UPLOAD_ORDER", "part");
  EXPECT_REFUSED(client_.UploadRaw({NameMessage(name), NameMessage(name)}), INVALID_ARGUMENT,
                 "UPLOAD_ORDER", "part");
  v1::Job job;
  ASSERT_TRUE(client_.Get(name, &job).ok());
  EXPECT_EQ(job.photos(), 0);
  ASSERT_TRUE(client_.Cancel(name).ok());
  EXPECT_TRUE(std::filesystem::is_empty(data_.tmp()));  // nothing is left of them
  EXPECT_TRUE(std::filesystem::is_empty(data_.uploads()));
}

// The messages of a file from its byte `offset` on.
std::vector<v1::UploadImagesRequest> RestMessages(const std::string& job, const TestFile& file,
                                                  size_t offset) {
  std::vector<v1::UploadImagesRequest> messages = {NameMessage(job)};
  TestFile rest = file;
  rest.bytes = file.bytes.substr(offset);
  for (const auto& message : FileMessages(rest)) messages.push_back(message);
  messages[1] = FileMessages(file)[0];
  messages[1].mutable_file()->set_offset(static_cast<int64_t>(offset));
  messages.push_back(EndMessage(1));
  return messages;
}

TEST_F(UploadApi, UploadGoesOnInsideAFileWhereABrokenStreamEnded) {
  const std::string name = NewJob();
  const TestFile file{"a.jpg", TestJpeg(640, 480)};
  const TestFile other{"b.png", TestPng()};
  ASSERT_GT(file.bytes.size(), 3000u);
  {
    grpc::ClientContext call;
    v1::UploadImagesResponse response;
    const auto writer = client_.jobs->UploadImages(&call, &response);
    auto messages = FileMessages(file);  // chunks of 1000 bytes
    messages.insert(messages.begin(), NameMessage(name));
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(writer->Write(messages[i]));
    v1::QueryUploadResponse query;
    do {  // until the server has stored the chunks; then the connection breaks
      ASSERT_TRUE(client_.Query(name, {file}, &query).ok());
    } while (query.files(0).offset() < 2000);
    call.TryCancel();
    (void)writer->Finish();
  }
  v1::QueryUploadResponse query;
  const grpc::Status asked = client_.Query(name, {file, other}, &query);
  ASSERT_TRUE(asked.ok()) << asked.error_message();
  EXPECT_FALSE(query.files(0).stored());
  EXPECT_EQ(query.files(0).offset(), 2000);
  EXPECT_EQ(query.files(1).offset(), 0);
  EXPECT_REFUSED(client_.UploadRaw(RestMessages(name, file, 2500)), OUT_OF_RANGE, "OFFSET_INVALID",
                 "images[a.jpg]");
  const grpc::Status rest = client_.UploadRaw(RestMessages(name, file, 2000));
  ASSERT_TRUE(rest.ok()) << rest.error_message();
  ASSERT_TRUE(client_.Query(name, {file}, &query).ok());
  EXPECT_TRUE(query.files(0).stored());
  EXPECT_TRUE(std::filesystem::is_empty(data_.uploads() + "/" + name.substr(5)));
}

TEST_F(UploadApi, BytesThatAreKnownFromAnotherJobNeedNotBeSent) {
  const TestFile file{"a.png", TestPng()};
  ASSERT_TRUE(client_.Upload(NewJob(), {file}).ok());
  const std::string name = NewJob();
  TestFile renamed = file;
  renamed.name = "b.png";
  v1::QueryUploadResponse query;
  ASSERT_TRUE(client_.Query(name, {renamed}, &query).ok());
  EXPECT_FALSE(query.files(0).stored());
  ASSERT_EQ(query.files(0).offset(), static_cast<int64_t>(file.bytes.size()));
  ASSERT_TRUE(client_.UploadRaw(RestMessages(name, renamed, file.bytes.size())).ok());
  v1::Job job;
  ASSERT_TRUE(client_.Get(name, &job).ok());
  EXPECT_EQ(job.photos(), 1);
  // Whoever only claims to have the bytes of a file gets nothing.
  const TestFile unknown{"c.png", TestPng(64, 48, 9)};
  EXPECT_REFUSED(client_.UploadRaw(RestMessages(name, unknown, unknown.bytes.size())), OUT_OF_RANGE,
                 "OFFSET_INVALID", "images[c.png]");
}

TEST_F(UploadApi, UploadThatSaysNothingIsEndedAndItsBytesAreKept) {
  UploadLimits limits;
  limits.max_silence_seconds = 0.3;
  Jobs jobs(store_.get(), blobs_.get(), data_, SystemClockMs, limits);
  const auto server = *StartServer(Options(), &jobs, engine_.get());
  TestClient client(server->InProcessChannel());
  const std::string name = NewJob();
  const TestFile file{"a.jpg", TestJpeg(640, 480)};
  grpc::ClientContext call;
  v1::UploadImagesResponse response;
  const auto writer = client.jobs->UploadImages(&call, &response);
  const auto messages = FileMessages(file);
  ASSERT_TRUE(writer->Write(NameMessage(name)));
  ASSERT_TRUE(writer->Write(messages[0]));
  ASSERT_TRUE(writer->Write(messages[1]));
  EXPECT_REFUSED(writer->Finish(), DEADLINE_EXCEEDED, "UPLOAD_STALLED", "");
  v1::QueryUploadResponse query;
  ASSERT_TRUE(client_.Query(name, {file}, &query).ok());
  EXPECT_EQ(query.files(0).offset(), 1000);
}

// Takes no file until it is told to.
class StuckBlobStore : public FaultyBlobStore {
 public:
  explicit StuckBlobStore(BlobStore* blobs) : FaultyBlobStore(blobs) {
    on_write = [this](auto) {
      for (++waiting_; !released_;) std::this_thread::sleep_for(std::chrono::milliseconds(5));
      return absl::OkStatus();
    };
  }

  int waiting() const { return waiting_; }
  void Release() { released_ = true; }

 private:
  std::atomic<int> waiting_ = 0;
  std::atomic<bool> released_ = false;
};

TEST_F(UploadApi, UploadsThatTakeLongHoldUpNoShortCall) {
  StuckBlobStore stuck(blobs_.get());
  Jobs jobs(store_.get(), &stuck, data_);
  ServerOptions options = Options();
  options.store_threads = options.blob_threads = 2;
  const auto server = *StartServer(options, &jobs, engine_.get());
  TestClient client(server->InProcessChannel());
  std::vector<std::thread> uploads;
  for (int i = 0; i < 4; ++i) {
    uploads.emplace_back([&, job = NewJob(), i] {
      EXPECT_TRUE(client.Upload(job, {{"a.png", TestPng(64, 48, i)}}).ok());
    });
  }
  const int theirs = options.blob_threads - 1;  // one is left for other clients
  for (int i = 0; i < 1000 && stuck.waiting() < theirs; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(stuck.waiting(), theirs);
  const std::string name = NewJob();
  grpc::ClientContext call;
  call.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(5));
  v1::GetJobRequest request;
  request.set_name(name);
  v1::Job job;
  EXPECT_TRUE(client.jobs->GetJob(&call, request, &job).ok());
  std::vector<v1::JobEvent> events;
  EXPECT_TRUE(client.Watch(name, 0, &events, 1).error_code() == grpc::CANCELLED);
  EXPECT_EQ(events.size(), 1u);
  stuck.Release();
  for (std::thread& upload : uploads) upload.join();
}

TEST_F(UploadApi, ArchiveIsNotUnpackedFurtherWhenTheClientIsGone) {
  StuckBlobStore stuck(blobs_.get());
  Jobs jobs(store_.get(), &stuck, data_);
  const auto server = *StartServer(Options(), &jobs, engine_.get());
  TestClient client(server->InProcessChannel());
  std::string tar;
  constexpr int kPhotos = 200;
  for (int i = 0; i < kPhotos; ++i) tar += TarEntry(std::to_string(i) + ".png", TestPng(64, 48, i));
  auto messages = FileMessages({"a.tar", tar + std::string(1024, '\0'), v1::FILE_ROLE_ARCHIVE});
  messages.insert(messages.begin(), NameMessage(NewJob()));
  grpc::ClientContext call;
  v1::UploadImagesResponse response;
  const auto writer = client.jobs->UploadImages(&call, &response);
  for (const auto& message : messages) ASSERT_TRUE(writer->Write(message));
  for (int i = 0; i < 1000 && stuck.waiting() == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_EQ(stuck.waiting(), 1);  // the first photo
  call.TryCancel();
  EXPECT_EQ(writer->Finish().error_code(), grpc::CANCELLED);
  stuck.Release();
  server->Shutdown();  // once the upload has ended
  // Some more may have come before the server heard of it.
  EXPECT_LT(stuck.waiting(), kPhotos);
}

TEST_F(UploadApi, QueriesAreCheckedAsUploadsAre) {
  const std::string name = NewJob();
  v1::QueryUploadResponse response;
  EXPECT_REFUSED(client_.Query(name, {{"../a.jpg", "x"}}, &response), INVALID_ARGUMENT,
                 "BAD_FILE_NAME", "images[../a.jpg]");
  EXPECT_REFUSED(client_.Query(name, std::vector<TestFile>(1001, {"a.jpg", "x"}), &response),
                 INVALID_ARGUMENT, "TOO_MANY_IN_CALL", "files");
  ASSERT_TRUE(client_.Cancel(name).ok());
  EXPECT_REFUSED(client_.Query(name, {{"a.jpg", "x"}}, &response), FAILED_PRECONDITION,
                 "JOB_NOT_UPLOADING", "name");
}

TEST_F(UploadApi, RequestIdForOtherFilesIsFoundOut) {
  v1::CreateJobRequest request;
  request.set_request_id("abc");
  request.set_content_digest("one");
  v1::Job job;
  ASSERT_TRUE(client_.Create(request, &job).ok());
  EXPECT_TRUE(job.has_expire_time());
  ASSERT_TRUE(client_.Create(request, &job).ok());
  request.set_content_digest("two");
  EXPECT_REFUSED(client_.Create(request, &job), ALREADY_EXISTS, "REQUEST_ID_REUSED", "request_id");
  request.set_content_digest(std::string(65, 'x'));
  EXPECT_REFUSED(client_.Create(request, &job), INVALID_ARGUMENT, "CONTENT_DIGEST_INVALID",
                 "content_digest");
}

TEST_F(UploadApi, FilesBeforeTheBadOneStayAndUnchangedFilesCostNothing) {
  const std::string name = NewJob();
  EXPECT_EQ(client_.Upload(name, {{"a.png", TestPng(64, 48, 1)}, {"b.png", "bad"}}).error_code(),
            grpc::INVALID_ARGUMENT);
  v1::UploadImagesResponse response;
  const grpc::Status again = client_.Upload(
      name, {{"a.png", TestPng(64, 48, 1)}, {"b.png", TestPng(64, 48, 2)}}, &response);
  ASSERT_TRUE(again.ok()) << again.error_message();
  EXPECT_EQ(response.files_unchanged(), 1);
  EXPECT_EQ(response.files_stored(), 1);
  EXPECT_EQ(response.job().photos(), 2);
}

TEST_F(UploadApi, TwoPhotosAreRefusedAtTheStartAndTwoSizesAreNot) {
  const std::string job = NewJob();
  ASSERT_TRUE(
      client_.Upload(job, {{"a.png", TestPng(64, 48)}, {"b.png", TestPng(48, 64, 2)}}).ok());
  EXPECT_REFUSED(client_.Start(job), FAILED_PRECONDITION, "TOO_FEW_PHOTOS", "images");
  ASSERT_TRUE(client_.Upload(job, {{"c.png", TestPng(64, 48, 1)}}).ok());
  const grpc::Status started = client_.Start(job);
  EXPECT_TRUE(started.ok()) << started.error_message();
}

// The engine reads transforms.json up to this size only.
TEST_F(UploadApi, CamerasThatTheEngineWouldNotReadAreRefused) {
  const TestFile file{"transforms.json", "{}", v1::FILE_ROLE_CAMERAS};
  const auto upload = [&](int64_t bytes) {
    std::vector<v1::UploadImagesRequest> messages = FileMessages(file, "", bytes);
    messages.insert(messages.begin(), NameMessage(NewJob()));
    return client_.UploadRaw(messages);
  };
  const std::string field = "cameras[transforms.json]";
  EXPECT_REFUSED(upload(kMaxCamerasBytes + 1), RESOURCE_EXHAUSTED, "FILE_TOO_LARGE", field);
  EXPECT_REFUSED(upload(kMaxCamerasBytes), INVALID_ARGUMENT, "FILE_TRUNCATED", field);
}

// Its images list what their features saw.
TEST_F(UploadApi, AFileOfAColmapModelMayBeLargerThanAPhoto) {
  const auto upload = [&](int64_t bytes) {
    const TestFile file{"images.bin", "", v1::FILE_ROLE_COLMAP};
    std::vector<v1::UploadImagesRequest> messages = FileMessages(file, "", bytes);
    messages.insert(messages.begin(), NameMessage(NewJob()));
    return client_.UploadRaw(messages);
  };
  const std::string field = "colmap[images.bin]";
  EXPECT_REFUSED(upload((int64_t{1} << 30) + 1), RESOURCE_EXHAUSTED, "FILE_TOO_LARGE", field);
  EXPECT_REFUSED(upload(int64_t{1} << 30), INVALID_ARGUMENT, "FILE_TRUNCATED", field);
}

// The engine includes no proto and so has its own lists of endings.
TEST_F(UploadApi, TheEngineFindsFilesOfEveryEndingThatIsTaken) {
  const TempDir dir;
  const auto put = [&](const std::string& folder, std::string_view ending) {
    const std::string name = "a" + std::string(ending);
    std::filesystem::create_directories(dir.path() + "/" + folder);
    std::ofstream(dir.path() + "/" + folder + "/" + name) << "x";
    return name;
  };
  for (const std::string_view ending : v1::kPhotoEndings) {
    const std::string name = put("photos" + std::string(ending), ending);
    const auto found = ListPhotos(dir.path() + "/photos" + std::string(ending), "images");
    ASSERT_TRUE(found.ok()) << found.status();
    EXPECT_THAT(*found, ElementsAre(name));
  }
  for (const std::string_view taken : v1::kDepthEndings) {
    const std::string lower(taken);
    for (const std::string& ending : {lower, absl::AsciiStrToUpper(lower)}) {
      const std::string folder = "depths" + ending;
      const std::string name = put(folder, ending);
      const std::string path = absl::StrCat(dir.path(), "/", folder, "/", name);
      EXPECT_EQ(FindDepthMap(dir.path() + "/" + folder, "a"), path);
      EXPECT_TRUE(CheckName(name, FileRole::kDepth, "depths").ok()) << name;
    }
  }
  EXPECT_EQ(Reason(CheckName("a.Npy", FileRole::kDepth, "depths")), "BAD_FILE_NAME");
  for (const std::string_view ending : v1::kMaskEndings) {
    put("masks", ending);
    EXPECT_TRUE(FindMasks(dir.path() + "/masks", {"a.jpg"}).ok());
  }
}

}  // namespace
}  // namespace litags
