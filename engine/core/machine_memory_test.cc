#include "engine/core/machine_memory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "engine/core/temp_dir_test_util.h"

namespace litags {
namespace {

class MachineMemoryTest : public ::testing::Test {
 protected:
  MachineMemoryTest() {
    Write("/proc/meminfo", "MemFree: 1 kB\nMemTotal:  8388608 kB\nOther: 5\n");
  }

  void Write(const std::string& path, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(dir_.path() + path).parent_path());
    std::ofstream(dir_.path() + path) << text;
  }
  int64_t Memory() const { return MachineMemory(dir_.path()); }
  int Cores() const { return MachineCores(dir_.path()); }

  TempDir dir_;
};

TEST_F(MachineMemoryTest, WithoutGroupsAllOfTheMachineIsThere) {
  EXPECT_EQ(Memory(), int64_t{8} << 30);
  EXPECT_GE(Cores(), 1);
}

TEST_F(MachineMemoryTest, LimitOfAContainerCountsAndSoDoThoseAroundAGroup) {
  Write("/proc/self/cgroup", "0::/\n");
  Write("/sys/fs/cgroup/memory.max", "2147483648\n");
  Write("/sys/fs/cgroup/cpu.max", "100000 100000\n");
  EXPECT_EQ(Memory(), int64_t{2} << 30);
  EXPECT_EQ(Cores(), 1);
  Write("/sys/fs/cgroup/cpu.max", "200000 100000\n");
  EXPECT_LE(Cores(), 2);
  Write("/proc/self/cgroup", "0::/system.slice/litags.service\n");
  Write("/sys/fs/cgroup/memory.max", "max\n");
  Write("/sys/fs/cgroup/cpu.max", "max 100000\n");
  Write("/sys/fs/cgroup/system.slice/memory.max", "1073741824\n");
  Write("/sys/fs/cgroup/system.slice/litags.service/memory.max", "4294967296\n");
  EXPECT_EQ(Memory(), int64_t{1} << 30);
}

TEST_F(MachineMemoryTest, LimitThatSaysMaxAndQuotaBelowACoreAreNoZero) {
  Write("/proc/self/cgroup", "0::/\n");
  Write("/sys/fs/cgroup/memory.max", "max\n");
  Write("/sys/fs/cgroup/cpu.max", "50000 100000\n");
  EXPECT_EQ(Memory(), int64_t{8} << 30);
  EXPECT_EQ(Cores(), 1);
}

}  // namespace
}  // namespace litags
