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

constexpr char kOldGroups[] =
    "9:memory:/docker/ab12\n4:cpu,cpuacct:/docker/ab12\n1:name=systemd:/docker/ab12\n0::/\n";

TEST_F(MachineMemoryTest, LimitsOfVersion1InAContainerAreAtTheTop) {
  Write("/proc/self/cgroup", kOldGroups);
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2147483648\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "100000\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(Memory(), int64_t{2} << 30);
  EXPECT_EQ(Cores(), 1);
}

TEST_F(MachineMemoryTest, LimitsOfVersion1OnTheMachineAreOfTheGroupAndOfThoseAroundIt) {
  Write("/proc/self/cgroup", kOldGroups);
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");  // none
  Write("/sys/fs/cgroup/memory/docker/memory.limit_in_bytes", "1073741824\n");
  Write("/sys/fs/cgroup/memory/docker/ab12/memory.limit_in_bytes", "4294967296\n");
  Write("/sys/fs/cgroup/memory/docker/other/memory.limit_in_bytes", "4096\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  const int all = MachineCores(dir_.path() + "/nothing");
  EXPECT_EQ(Memory(), int64_t{1} << 30);
  EXPECT_EQ(Cores(), all);
  Write("/sys/fs/cgroup/cpu/docker/ab12/cpu.cfs_quota_us", "150000\n");
  Write("/sys/fs/cgroup/cpu/docker/ab12/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(Cores(), 1);
}

}  // namespace
}  // namespace litags
