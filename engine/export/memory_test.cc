// What writing takes of memory.
#include <gtest/gtest.h>

#include <string>

#include "absl/status/statusor.h"
#include "engine/core/peak_memory_test_util.h"
#include "engine/core/sandbox.h"
#include "engine/export/export_test_util.h"
#include "engine/export/formats.h"

namespace litags {
namespace {

// The largest files there are: beside the Gaussians only the file itself is held, once.
TEST(Memory, AFileOfFloatsIsHeldOnce) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "sanitizers take memory of their own";
  const ViewerScene scene = SmallScene(100'000);
  for (const SceneFormat format : {SceneFormat::kUsda, SceneFormat::kGlb}) {
    absl::StatusOr<std::string> bytes;
    const auto peak = PeakMemoryOf([&] { bytes = InfoOf(format).encode(scene); });
    if (!peak.has_value()) GTEST_SKIP() << "the peak cannot be reset";
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const int64_t size = static_cast<int64_t>(bytes->size());
    ASSERT_GT(size, 20 << 20);
    EXPECT_LT(*peak, size + size / 2) << InfoOf(format).name;
  }
}

}  // namespace
}  // namespace litags
