// What writing takes of memory.
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "engine/export/export_test_util.h"
#include "engine/export/formats.h"

namespace litags {
namespace {

// A line of /proc/self/status, bytes.
int64_t OfThisProcess(const std::string& key) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(key)) return std::stoll(line.substr(key.size() + 1)) * 1024;
  }
  return 0;
}

// The largest files there are: beside the Gaussians only the file itself is held, once.
TEST(Memory, AFileOfFloatsIsHeldOnce) {
  const ViewerScene scene = SmallScene(100'000);
  for (const SceneFormat format : {SceneFormat::kUsda, SceneFormat::kGlb}) {
    std::ofstream("/proc/self/clear_refs") << 5;  // VmHWM begins anew
    const int64_t before = OfThisProcess("VmRSS");
    if (OfThisProcess("VmHWM") > before + (1 << 20)) GTEST_SKIP() << "the peak cannot be reset";
    const auto bytes = InfoOf(format).encode(scene);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const int64_t size = static_cast<int64_t>(bytes->size());
    ASSERT_GT(size, 20 << 20);
    EXPECT_LT(OfThisProcess("VmHWM") - before, size + size / 2) << InfoOf(format).name;
  }
}

}  // namespace
}  // namespace litags
