#include "engine/pipeline/exception_status.h"

#include <gtest/gtest.h>

#include <functional>
#include <new>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "engine/core/error_test_util.h"
#include "engine/core/parallel.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

// Throws when a stage begins.
class Thrower : public ReconstructObserver {
 public:
  Thrower(Stage stage, std::function<void()> act) : stage_(stage), act_(std::move(act)) {}
  void OnProgress(const Progress& progress) override {
    if (progress.stage == stage_) act_();
  }
  void OnSnapshot(const std::string&) override {}

 private:
  const Stage stage_;
  const std::function<void()> act_;
};

TEST(WithoutExceptions, ReturnsWhatTheCallReturnsOrWhatItsExceptionSays) {
  EXPECT_TRUE(WithoutExceptions([] { return absl::OkStatus(); }).ok());
  const auto thrown = [](const auto& exception) {
    return WithoutExceptions([&]() -> absl::Status { throw exception; });
  };
  EXPECT_EQ(thrown(std::runtime_error("odd")), absl::InternalError("the engine failed: odd"));
  EXPECT_EQ(thrown(7).code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(thrown(std::bad_alloc())), "MEMORY_EXCEEDED");
  EXPECT_EQ(thrown(std::bad_alloc()).code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(thrown(cv::Exception(cv::Error::StsNoMem, "", "", "", 0))), "MEMORY_EXCEEDED");
  EXPECT_EQ(thrown(cv::Exception(cv::Error::StsAssert, "", "", "", 0)).code(),
            absl::StatusCode::kInternal);
}

TEST(WithoutExceptions, ARunThatRanOutOfMemoryFailsAndTheNextOneInItsFolderDoesNot) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  const auto engine = MakeEngine(kNoColmap);
  for (const Stage stage : {Stage::kLoading, Stage::kTraining}) {
    Thrower thrower(stage, [] { ParallelFor(2, 2, [](size_t, int) { throw std::bad_alloc(); }); });
    const auto failed = engine->Reconstruct(input, SmallOptions(), CancelToken(), &thrower);
    EXPECT_EQ(failed.status().code(), absl::StatusCode::kResourceExhausted) << failed.status();
    EXPECT_EQ(Reason(failed.status()), "MEMORY_EXCEEDED");
  }
  const auto report = engine->Reconstruct(input, SmallOptions(), CancelToken(), nullptr);
  EXPECT_TRUE(report.ok()) << report.status();
}

}  // namespace
}  // namespace litags
