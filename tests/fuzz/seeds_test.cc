// Seeds that are refused at the first look let nothing behind it be fuzzed.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/scene_file.h"
#include "engine/train/train_state.h"
#include "tests/fuzz/fuzz_support.h"

namespace litags {
namespace {

template <typename Look>
void ForEachSeed(const std::string& target, const Look& look) {
  const std::string folder = absl::StrCat(LITAGS_SOURCE_DIR, "/tests/fuzz/corpus/", target);
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename();
    if (name.starts_with("found-")) continue;  // need not be valid
    SCOPED_TRACE(name);
    const auto bytes = ReadFile(entry.path(), "seed", 1 << 20);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    look(*bytes);
  }
}

TEST(Seeds, ScenesOfEveryVersionLoad) {
  std::set<uint32_t> versions;
  ForEachSeed("scene", [&](const std::string& bytes) {
    versions.insert(WriteScratchScene(bytes));
    const auto scene = LoadSceneFile(ScratchPath());
    EXPECT_TRUE(scene.ok()) << scene.status();
  });
  EXPECT_EQ(versions, (std::set<uint32_t>{1, 2, 3, 4}));
}

TEST(Seeds, CheckpointsLoadWithAndWithoutPoses) {
  std::set<bool> with_poses;
  ForEachSeed("checkpoint", [&](const std::string& bytes) {
    WriteScratchContainer(bytes, "checkpoint", kCheckpointVersion);
    const auto state = LoadTrainState(ScratchPath(), "fuzz");
    ASSERT_TRUE(state.ok()) << state.status();
    with_poses.insert(!state->poses.empty());
  });
  EXPECT_EQ(with_poses.size(), 2u);
}

}  // namespace
}  // namespace litags
