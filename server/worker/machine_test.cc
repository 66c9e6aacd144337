#include "server/worker/machine.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/testing/temp_dir.h"

namespace litags {
namespace {

class MachineTest : public ::testing::Test {
 protected:
  MachineTest() { Write("/proc/meminfo", "MemFree: 1 kB\nMemTotal:  8388608 kB\nOther: 5\n"); }

  void Write(const std::string& path, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(dir_.path() + path).parent_path());
    std::ofstream(dir_.path() + path) << text;
  }
  Resources Found() const { return FoundResources(dir_.path()); }

  TempDir dir_;
};

TEST_F(MachineTest, WithoutGroupsAllOfTheMachineIsThere) {
  EXPECT_EQ(Found().memory_bytes, int64_t{8} << 30);
  EXPECT_GE(Found().cores, 1);
}

TEST_F(MachineTest, LimitOfAContainerCountsAndSoDoThoseAroundAGroup) {
  Write("/proc/self/cgroup", "0::/\n");
  Write("/sys/fs/cgroup/memory.max", "2147483648\n");
  Write("/sys/fs/cgroup/cpu.max", "100000 100000\n");
  EXPECT_EQ(Found().memory_bytes, int64_t{2} << 30);
  EXPECT_EQ(Found().cores, 1);
  Write("/sys/fs/cgroup/cpu.max", "200000 100000\n");
  EXPECT_LE(Found().cores, 2);
  Write("/proc/self/cgroup", "0::/system.slice/litags.service\n");
  Write("/sys/fs/cgroup/memory.max", "max\n");
  Write("/sys/fs/cgroup/cpu.max", "max 100000\n");
  Write("/sys/fs/cgroup/system.slice/memory.max", "1073741824\n");
  Write("/sys/fs/cgroup/system.slice/litags.service/memory.max", "4294967296\n");
  EXPECT_EQ(Found().memory_bytes, int64_t{1} << 30);
}

TEST_F(MachineTest, LimitThatSaysMaxAndQuotaBelowACoreAreNoZero) {
  Write("/proc/self/cgroup", "0::/\n");
  Write("/sys/fs/cgroup/memory.max", "max\n");
  Write("/sys/fs/cgroup/cpu.max", "50000 100000\n");
  EXPECT_EQ(Found().memory_bytes, int64_t{8} << 30);
  EXPECT_EQ(Found().cores, 1);
}

}  // namespace
}  // namespace litags
