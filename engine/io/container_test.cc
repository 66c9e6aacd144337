#include "engine/io/container.h"

#include <set>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/file_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr char kKind[] = "scene";

// A small container's bytes: three sections, one of them empty.
std::string Sample(uint32_t version = 3) {
  TempDir dir;
  const std::vector<float> numbers = {1.5f, -2.0f, 3.25f};
  ContainerWriter writer(kKind, version);
  writer.AddSection("text", "hello");
  writer.AddArrayView("numbers", numbers);
  writer.AddSection("empty", "");
  EXPECT_TRUE(writer.Commit(dir / "c").ok());
  return ReadFile(dir / "c", "c", 1 << 20).value();
}

absl::Status ParseStatus(std::string bytes, std::string_view kind = kKind, uint32_t oldest = 1,
                         uint32_t newest = 3) {
  return Container::Parse(std::move(bytes), "c", kind, oldest, newest).status();
}

TEST(Container, GivesBackWhatWasWritten) {
  TempDir dir;
  std::string big(1 << 20, '\0');
  for (size_t i = 0; i < big.size(); ++i) big[i] = static_cast<char>(i * 31 >> 3);
  const std::vector<double> doubles = {0.1, 1e300};
  ContainerWriter writer("checkpoint", 2);
  writer.AddSection("big", big);
  writer.AddArrayView("doubles", doubles);
  ASSERT_TRUE(writer.Commit(dir / "c").ok());

  const absl::StatusOr<Container> read = Container::Read(dir / "c", "checkpoint", 1, 5);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->version(), 2u);
  EXPECT_THAT(read->SectionNames(), testing::ElementsAre("big", "doubles"));
  EXPECT_EQ(read->Section("big").value(), big);
  EXPECT_EQ(read->Array<double>("doubles").value(), doubles);
  EXPECT_TRUE(read->Has("big"));
  EXPECT_FALSE(read->Has("small"));
}

TEST(Container, SurvivesMovingWithItsSections) {
  Container first = Container::Parse(Sample(), "c", kKind, 1, 3).value();
  const Container second = std::move(first);
  EXPECT_EQ(second.Section("text").value(), "hello");
  EXPECT_EQ(second.Array<float>("numbers").value(), std::vector<float>({1.5f, -2.0f, 3.25f}));
  EXPECT_TRUE(second.Array<float>("empty").value().empty());
}

TEST(Container, WritesTheSameBytesTwice) { EXPECT_EQ(Sample(), Sample()); }

TEST(Container, NamesAMissingOrOddSection) {
  const Container c = Container::Parse(Sample(), "c", kKind, 1, 3).value();
  EXPECT_EQ(Reason(c.Section("nothing").status()), "SECTION_MISSING");
  EXPECT_EQ(c.Section("nothing").status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(Reason(c.Array<float>("text").status()), "SECTION_SIZE");
}

TEST(Container, RefusesEveryTruncation) {
  const std::string bytes = Sample();
  for (size_t n = 0; n < bytes.size(); ++n) {
    const absl::Status status = ParseStatus(bytes.substr(0, n));
    const std::string expected = n == 0 ? "NOT_A_CONTAINER" : "CONTAINER_TRUNCATED";
    ASSERT_EQ(Reason(status), expected) << n << " of " << bytes.size();
  }
}

TEST(Container, RefusesEveryFlippedByte) {
  const std::string bytes = Sample();
  std::set<std::string> reasons;
  for (size_t i = 0; i < bytes.size(); ++i) {
    for (int bit : {0, 3, 7}) {
      std::string broken = bytes;
      broken[i] = static_cast<char>(broken[i] ^ (1 << bit));
      const absl::Status status = ParseStatus(broken);
      ASSERT_FALSE(status.ok()) << "byte " << i << " bit " << bit;
      reasons.insert(Reason(status));
    }
  }
  // The magic, the version number and the header's size have their own checks.
  EXPECT_THAT(reasons, testing::UnorderedElementsAre("NOT_A_CONTAINER", "CONTAINER_TOO_NEW",
                                                     "CONTAINER_TRUNCATED", "CONTAINER_CORRUPT"));
}

TEST(Container, RefusesTrailingBytes) {
  EXPECT_EQ(Reason(ParseStatus(Sample() + "x")), "CONTAINER_CORRUPT");
}

TEST(Container, RefusesForeignFilesAndKinds) {
  EXPECT_EQ(Reason(ParseStatus("ply\nformat binary_little_endian 1.0\n")), "NOT_A_CONTAINER");
  const absl::Status kind = ParseStatus(Sample(), "checkpoint");
  EXPECT_EQ(Reason(kind), "WRONG_CONTAINER_KIND");
  EXPECT_EQ(kind.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Container::Read("/nonexistent/c", kKind, 1, 1).status().code(),
            absl::StatusCode::kNotFound);
}

TEST(Container, RefusesOlderVersions) {
  EXPECT_TRUE(ParseStatus(Sample(2), kKind, 2, 3).ok());
  const absl::Status content = ParseStatus(Sample(1), kKind, 2, 3);
  EXPECT_EQ(Reason(content), "CONTAINER_TOO_OLD");
  EXPECT_EQ(content.code(), absl::StatusCode::kFailedPrecondition);
}

TEST(Container, RefusesNewerVersions) {
  EXPECT_TRUE(ParseStatus(Sample(3), kKind, 1, 3).ok());
  const absl::Status content = ParseStatus(Sample(4), kKind, 1, 3);
  EXPECT_EQ(Reason(content), "CONTAINER_TOO_NEW");
  EXPECT_EQ(content.code(), absl::StatusCode::kFailedPrecondition);
  std::string bytes = Sample();
  bytes[8] = 2;  // the format version follows the eight bytes of magic
  EXPECT_EQ(Reason(ParseStatus(bytes)), "CONTAINER_TOO_NEW");
}

TEST(Container, RefusesDoubleAndEmptyNamesWhenWriting) {
  TempDir dir;
  ContainerWriter twice(kKind, 1);
  twice.AddSection("a", "1");
  twice.AddSection("a", "2");
  EXPECT_EQ(Reason(twice.Commit(dir / "c")), "BAD_SECTION_NAME");
  ContainerWriter unnamed(kKind, 1);
  unnamed.AddSection("", "1");
  EXPECT_EQ(Reason(unnamed.Commit(dir / "c")), "BAD_SECTION_NAME");
  EXPECT_FALSE(std::filesystem::exists(dir / "c"));
}

}  // namespace
}  // namespace litags
