// Pictures and cameras of a job over the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "engine/core/photo.h"
#include "engine/io/image_io.h"
#include "server/testing/api_fixture.h"
#include "server/testing/eventually.h"
#include "server/testing/faulty_blob_store.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class RenderApi : public ApiTest {
 protected:
  void SetUp() override {
    job_ = FinishedJob();
    request_.set_name(job_);
    request_.mutable_pose()->set_camera("b.png");
  }

  // The answer's reason and field; "OK" if there is none.
  std::string Refusal() {
    v1::RenderedView view;
    const grpc::Status status = client_.Render(request_, &view);
    if (status.ok()) return "OK";
    return DetailOf(status).reason + " " + DetailOf(status).field;
  }

  void SetViewmat(std::vector<double> values) {
    auto* viewmat = request_.mutable_pose()->mutable_viewmat();
    viewmat->mutable_values()->Assign(values.begin(), values.end());
  }

  std::string job_;
  v1::RenderViewRequest request_;
};

TEST_F(RenderApi, PictureFromATrainingCameraIsAPngOfItsSize) {
  v1::RenderedView view;
  const grpc::Status status = client_.Render(request_, &view);
  ASSERT_TRUE(status.ok()) << status.error_message();
  const auto image = DecodeImage(view.data(), "view");
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width, 64);
  EXPECT_EQ(image->height, 48);
  EXPECT_EQ(view.iteration(), 10);
  EXPECT_EQ(view.camera().viewmat().values_size(), 16);
}

TEST_F(RenderApi, MatrixOfACameraGivesTheSamePictureAsItsName) {
  v1::RenderedView by_name, by_matrix;
  ASSERT_TRUE(client_.Render(request_, &by_name).ok());
  *request_.mutable_pose()->mutable_viewmat() = by_name.camera().viewmat();
  ASSERT_TRUE(client_.Render(request_, &by_matrix).ok());
  EXPECT_EQ(by_name.data(), by_matrix.data());
}

TEST_F(RenderApi, SizeFollowsTheCameraTheRequestOrItsAspectRatio) {
  v1::RenderedView view;
  request_.mutable_settings()->set_width(128);
  ASSERT_TRUE(client_.Render(request_, &view).ok());
  EXPECT_EQ(view.height(), 96);
  EXPECT_DOUBLE_EQ(view.camera().intrinsics().fx(), 120);
  request_.mutable_settings()->set_height(10);
  request_.mutable_settings()->set_vertical_fov_deg(90);
  ASSERT_TRUE(client_.Render(request_, &view).ok());
  EXPECT_EQ(view.height(), 10);
  EXPECT_NEAR(view.camera().intrinsics().fy(), 5, 1e-9);  // tan 45 degrees = 1
}

TEST_F(RenderApi, RawFloatsAreInterleavedRowsOfTheChannel) {
  request_.mutable_settings()->set_format(v1::PICTURE_FORMAT_RAW_FLOAT);
  v1::RenderedView colour, depth;
  ASSERT_TRUE(client_.Render(request_, &colour).ok());
  EXPECT_EQ(colour.planes(), 3);
  ASSERT_EQ(colour.data().size(), size_t{64 * 48 * 3 * 4});
  float rgb[3];  // the fake engine's planes differ by 0.1 c y / H
  std::memcpy(rgb, colour.data().data() + size_t{24 * 64 * 3 * 4}, sizeof(rgb));
  EXPECT_NEAR(rgb[1] - rgb[0], 0.05, 1e-6);
  EXPECT_NEAR(rgb[2] - rgb[0], 0.10, 1e-6);
  request_.mutable_settings()->set_channel(v1::CHANNEL_DEPTH);
  ASSERT_TRUE(client_.Render(request_, &depth).ok());
  EXPECT_EQ(depth.planes(), 1);
  EXPECT_EQ(depth.data().size(), size_t{64 * 48 * 4});
}

TEST_F(RenderApi, EveryChannelHasItsPlanesAndDepthItsRange) {
  for (int channel = v1::CHANNEL_COLOR; channel <= v1::CHANNEL_ALPHA; ++channel) {
    for (const auto format : {v1::PICTURE_FORMAT_PNG, v1::PICTURE_FORMAT_JPEG}) {
      SCOPED_TRACE(v1::Channel_Name(channel));
      request_.mutable_settings()->set_channel(static_cast<v1::Channel>(channel));
      request_.mutable_settings()->set_format(format);
      v1::RenderedView view;
      const grpc::Status status = client_.Render(request_, &view);
      ASSERT_TRUE(status.ok()) << status.error_message();
      EXPECT_TRUE(DecodeImage(view.data(), "view").ok());
      EXPECT_LT(view.value_min(), view.value_max());
      if (channel == v1::CHANNEL_DEPTH) {
        EXPECT_GT(view.value_min(), 2);
      }
    }
  }
}

TEST_F(RenderApi, BadPosesAreRefusedWithTheirField) {
  SetViewmat({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, kNan, 0, 0, 0, 1});
  EXPECT_EQ(Refusal(), "POSE_NOT_FINITE pose.viewmat");
  SetViewmat({1, 0, 0});
  EXPECT_EQ(Refusal(), "POSE_SIZE pose.viewmat");
  SetViewmat({2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1});
  EXPECT_EQ(Refusal(), "POSE_NOT_RIGID pose.viewmat");
  SetViewmat({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1});
  EXPECT_EQ(Refusal(), "POSE_NOT_RIGID pose.viewmat");
  auto* look = request_.mutable_pose()->mutable_look_at();
  EXPECT_EQ(Refusal(), "LOOK_AT_DEGENERATE pose.look_at");  // eye = target
  look->mutable_eye()->set_x(kNan);
  EXPECT_EQ(Refusal(), "POSE_NOT_FINITE pose.look_at.eye");
  look->mutable_eye()->set_x(3);
  EXPECT_EQ(Refusal(), "OK");
  look->mutable_up()->set_x(1);
  EXPECT_EQ(Refusal(), "LOOK_AT_DEGENERATE pose.look_at");
  request_.mutable_pose()->set_camera("nobody.jpg");
  EXPECT_EQ(Refusal(), "CAMERA_NOT_FOUND pose.camera");
  request_.clear_pose();
  EXPECT_EQ(Refusal(), "POSE_MISSING pose");
}

TEST_F(RenderApi, ACameraIsFoundByAnotherCaseOrEnding) {
  for (const char* name : {"A.PNG", "a.jpg", "low/a.png"}) {
    request_.mutable_pose()->set_camera(name);
    EXPECT_EQ(Refusal(), "OK") << name;
  }
}

TEST_F(RenderApi, BadSettingsAreRefusedWithTheirField) {
  v1::RenderSettings* s = request_.mutable_settings();
  const auto refusal_of = [&](auto change) {
    s->Clear();
    change();
    return Refusal();
  };
  EXPECT_EQ(refusal_of([&] { s->set_width(-1); }), "PICTURE_SIZE_INVALID settings.width");
  EXPECT_EQ(refusal_of([&] { s->set_width(30'000); }), "PICTURE_TOO_LARGE settings.width");
  EXPECT_EQ(refusal_of([&] { s->set_width(32'767); }), "PICTURE_SIZE_INVALID settings.width");
  EXPECT_EQ(refusal_of([&] {
              s->set_width(1);
              s->set_height(2'000'000'000);
            }),
            "PICTURE_SIZE_INVALID settings.height");
  EXPECT_EQ(refusal_of([&] { s->set_vertical_fov_deg(kNan); }),
            "FIELD_OF_VIEW_INVALID settings.vertical_fov_deg");
  EXPECT_EQ(refusal_of([&] { s->mutable_intrinsics()->set_fx(5); }),
            "PICTURE_SIZE_INVALID settings.width");
  EXPECT_EQ(refusal_of([&] { s->set_light(1); }), "LIGHT_INVALID settings.light");
  for (const double t : {kNan, 4.01, -5.0}) {
    EXPECT_EQ(refusal_of([&] {
                s->set_channel(v1::CHANNEL_LIGHT);
                s->set_light(t);
              }),
              "LIGHT_INVALID settings.light");
  }
  for (const double stops : {kNan, 10.5, -11.0}) {
    EXPECT_EQ(refusal_of([&] { s->set_exposure_stops(stops); }),
              "EXPOSURE_INVALID settings.exposure_stops");
  }
  EXPECT_EQ(refusal_of([&] {
              s->set_channel(v1::CHANNEL_DEPTH);
              s->set_exposure_stops(1);
            }),
            "EXPOSURE_INVALID settings.exposure_stops");
  EXPECT_EQ(refusal_of([&] { s->set_jpeg_quality(101); }),
            "JPEG_QUALITY_INVALID settings.jpeg_quality");
  EXPECT_EQ(refusal_of([&] { s->set_channel(static_cast<v1::Channel>(99)); }),
            "CHANNEL_UNKNOWN settings.channel");
  EXPECT_EQ(refusal_of([&] { s->set_format(static_cast<v1::PictureFormat>(99)); }),
            "FORMAT_UNKNOWN settings.format");
  EXPECT_NE(refusal_of([&] {
              s->set_width(10);
              s->set_height(10);
              s->mutable_intrinsics()->set_fx(kNan);
            }),
            "OK");
}

TEST_F(RenderApi, CamerasAreListedWithTheRegionTheySee) {
  grpc::ClientContext context;
  v1::ListCamerasRequest request;
  request.set_name(job_);
  v1::ListCamerasResponse response;
  ASSERT_TRUE(client_.render->ListCameras(&context, request, &response).ok());
  ASSERT_EQ(response.cameras_size(), 3);
  EXPECT_EQ(response.cameras(0).name(), "a.png");
  EXPECT_EQ(response.radius(), 4);
  EXPECT_EQ(response.up().y(), -1);
  EXPECT_EQ(response.gaussians(), 100);
  EXPECT_EQ(response.next_page_token(), "");
}

TEST_F(RenderApi, CamerasAreListedPageByPage) {
  v1::ListCamerasRequest request;
  request.set_name(job_);
  request.set_page_size(2);
  std::vector<std::string> names;
  std::vector<int> pages;
  do {
    grpc::ClientContext context;
    v1::ListCamerasResponse page;
    ASSERT_TRUE(client_.render->ListCameras(&context, request, &page).ok());
    for (const v1::NamedCamera& camera : page.cameras()) names.push_back(camera.name());
    pages.push_back(page.cameras_size());
    EXPECT_EQ(page.radius(), 4);  // on every page
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_THAT(names, ElementsAre("a.png", "b.png", "c.png"));
  EXPECT_THAT(pages, ElementsAre(2, 1));
  for (const auto& [size, token, reason] :
       {std::tuple(-1, "", "PAGE_SIZE_INVALID"), std::tuple(2, "xy", "PAGE_TOKEN_INVALID")}) {
    grpc::ClientContext context;
    v1::ListCamerasResponse page;
    request.set_page_size(size);
    request.set_page_token(token);
    EXPECT_EQ(DetailOf(client_.render->ListCameras(&context, request, &page)).reason, reason);
  }
}

TEST_F(RenderApi, SnapshotOfARunningJobRendersAndANewerOneReplacesIt) {
  const std::string running = client_.StartedJob({"slow", "b", "c"}, 100000);
  request_.set_name(running);
  request_.mutable_pose()->set_camera("b.png");
  v1::RenderedView view;
  grpc::Status status;
  int first = 0, last = 0;
  for (int i = 0; i < 500 && last <= first; ++i) {
    status = client_.Render(request_, &view);
    if (status.ok()) {
      last = view.iteration();
      if (first == 0) first = last;
    } else {
      EXPECT_EQ(DetailOf(status).reason, "SCENE_NOT_READY") << status.error_message();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_GT(first, 0);
  EXPECT_GT(last, first);
  v1::Job job;
  ASSERT_TRUE(client_.Get(running, &job).ok());
  EXPECT_EQ(job.state(), v1::JOB_STATE_RUNNING);
}

TEST_F(RenderApi, NobodyWaitsForTheSceneOfAJobThatEndedWithoutOne) {
  request_.set_name(client_.StartedJob({"fail", "b", "c"}));
  client_.WaitFor(request_.name(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(Refusal(), "SCENE_NOT_MADE name");
}

// A server whose blob store goes away: reads wait until `back_` and then fail.
class AwayRenderApi : public ApiTest {
 protected:
  AwayRenderApi() {
    away_blobs_.on_read = [this](std::string_view) -> absl::Status {
      if (!away_) return absl::OkStatus();
      ++reads_;
      back_.wait(false);
      return absl::UnavailableError("the blob store is away");
    };
    ServerOptions options = Options();
    options.max_waiting_pictures = 2;
    server_ = *StartServer(options, &away_jobs_, engine_.get());
    client_ = TestClient(server_->InProcessChannel());
    StartWorker();
    for (auto* request : {&in_memory_, &not_there_}) {
      request->set_name(client_.StartedJob({"a", "b", "c"}, 10));
      client_.WaitFor(request->name(), v1::JOB_STATE_SUCCEEDED);
      request->mutable_pose()->set_camera("b.png");
    }
  }
  ~AwayRenderApi() override {
    Return();
    server_.reset();
  }

  void Return() {
    back_ = true;
    back_.notify_all();
  }

  grpc::Status View(const v1::RenderViewRequest& request, std::chrono::milliseconds patience) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + patience);
    v1::RenderedView view;
    return client_.render->RenderView(&context, request, &view);
  }

  FaultyBlobStore away_blobs_{blobs_.get()};
  Jobs away_jobs_{store_.get(), &away_blobs_, data_};
  std::atomic<bool> away_ = false, back_ = false;
  std::atomic<int> reads_ = 0;
  v1::RenderViewRequest in_memory_, not_there_;
};

TEST_F(AwayRenderApi, ScenesInMemoryAreShownAndOthersFailTogether) {
  constexpr std::chrono::seconds kPatience(60);
  ASSERT_TRUE(View(in_memory_, kPatience).ok());
  away_ = true;
  std::vector<std::thread> callers;
  std::vector<grpc::Status> ends(3);
  for (grpc::Status& end : ends) {
    callers.emplace_back([&] { end = View(not_there_, kPatience); });
  }
  EXPECT_TRUE(Eventually([&] { return reads_ == 1; }));
  // One is read, two wait, whoever they are.
  EXPECT_TRUE(Eventually([&] {
    const grpc::Status another = View(not_there_, std::chrono::milliseconds(50));
    return DetailOf(another).reason == "RENDER_QUEUE_FULL";
  }));
  const grpc::Status shown = View(in_memory_, kPatience);
  EXPECT_TRUE(shown.ok()) << shown.error_message();
  Return();
  for (std::thread& caller : callers) caller.join();
  for (const grpc::Status& end : ends) {
    EXPECT_TRUE(end.error_code() == grpc::UNAVAILABLE ||
                DetailOf(end).reason == "RENDER_QUEUE_FULL")
        << end.error_message();
  }
  EXPECT_EQ(reads_, 1);
  away_ = false;
  EXPECT_TRUE(View(not_there_, kPatience).ok());
}

// A server with one thread for pictures, and room for two that wait.
class BusyRenderApi : public ApiTest {
 protected:
  BusyRenderApi() {
    ServerOptions options = Options();
    options.render_threads = 1;
    options.max_waiting_pictures = 2;
    server_ = *StartServer(options, &jobs_, engine_.get());
    client_ = TestClient(server_->InProcessChannel());
    StartWorker();
    heavy_.set_name(client_.StartedJob({"heavy", "b", "c"}, 10));
    light_.set_name(client_.StartedJob({"a", "b", "c"}, 10));
    for (auto* request : {&heavy_, &light_}) {
      client_.WaitFor(request->name(), v1::JOB_STATE_SUCCEEDED);
      request->mutable_pose()->set_camera("b.png");
    }
  }

  v1::RenderViewRequest heavy_, light_;
};

TEST_F(BusyRenderApi, FullQueueRefusesPicturesAndNothingElseAndCancelledOnesFreeIt) {
  constexpr int kPictures = 3;  // one is made, two wait
  grpc::ClientContext contexts[kPictures];
  std::vector<std::thread> callers;
  std::vector<grpc::StatusCode> codes(kPictures, grpc::OK);
  for (int i = 0; i < kPictures; ++i) {
    callers.emplace_back([&, i] {
      v1::RenderedView view;
      codes[i] = client_.render->RenderView(&contexts[i], heavy_, &view).error_code();
    });
  }
  // A picture that gave up while it waited still holds its place.
  grpc::Status refused;
  for (int i = 0; i < 100 && DetailOf(refused).reason != "RENDER_QUEUE_FULL"; ++i) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(50));
    v1::RenderedView view;
    refused = client_.render->RenderView(&context, light_, &view);
  }
  EXPECT_EQ(DetailOf(refused).reason, "RENDER_QUEUE_FULL");
  EXPECT_EQ(refused.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), ::testing::HasSubstr("2 pictures wait"));
  v1::Job job;
  EXPECT_TRUE(client_.Get(light_.name(), &job).ok());

  const auto start = std::chrono::steady_clock::now();
  for (grpc::ClientContext& context : contexts) context.TryCancel();
  for (std::thread& caller : callers) caller.join();
  v1::RenderedView view;
  grpc::Status status;
  do {
    status = client_.Render(light_, &view);
  } while (DetailOf(status).reason == "RENDER_QUEUE_FULL");
  EXPECT_TRUE(status.ok()) << status.error_message();
  // A heavy picture takes 20 s unless it is stopped.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  EXPECT_THAT(codes, ::testing::Contains(grpc::CANCELLED));
}

TEST_F(BusyRenderApi, PathThatNobodyReadsAnyMoreStops) {
  v1::RenderPathRequest path;
  path.set_name(heavy_.name());
  path.mutable_orbit()->set_radius_scale(1);
  path.set_frames(50);
  {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(200));
    v1::RenderPathResponse frame;
    auto reader = client_.render->RenderPath(&context, path);
    EXPECT_FALSE(reader->Read(&frame));
    EXPECT_EQ(reader->Finish().error_code(), grpc::DEADLINE_EXCEEDED);
  }
  const auto start = std::chrono::steady_clock::now();
  v1::RenderedView view;
  const grpc::Status status = client_.Render(light_, &view);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

}  // namespace
}  // namespace litags
