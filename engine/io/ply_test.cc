#include "engine/io/ply.h"

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/io/test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

Splats RandomSplats(size_t n) {
  Splats splats(n);
  const CounterRng rng(3, 0);
  for (size_t i = 0; i < n; ++i) {
    for (int row = 0; row < kSplatRows; ++row) {
      splats.at(i, row) = static_cast<float>(rng.Normal(i * kSplatRows + row));
    }
  }
  return splats;
}

bool IsLitaRow(int row) { return row >= kDepth && row < kShRest; }

std::vector<std::string> HeaderLines(const std::string& ply) {
  const size_t end = ply.find("end_header\n");
  return absl::StrSplit(ply.substr(0, end), '\n', absl::SkipEmpty());
}

// Value `property` (its index) of Gaussian `i` in a file of `count` float properties.
float FileValue(const std::string& ply, size_t count, size_t i, size_t property) {
  const size_t data = ply.find("end_header\n") + 11;
  float value;
  std::memcpy(&value, ply.data() + data + 4 * (i * count + property), 4);
  return value;
}

TEST(EncodePly, HasTheHeaderViewersExpect) {
  std::vector<std::string> expected = {"ply", "format binary_little_endian 1.0",
                                       "element vertex 2"};
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"}) {
    expected.push_back(absl::StrCat("property float ", name));
  }
  for (int i = 0; i < 45; ++i) expected.push_back(absl::StrCat("property float f_rest_", i));
  for (const char* name :
       {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    expected.push_back(absl::StrCat("property float ", name));
  }
  const std::string ply = EncodePly(RandomSplats(2), false);
  EXPECT_EQ(HeaderLines(ply), expected);
  EXPECT_EQ(ply.size(), ply.find("end_header\n") + 11 + 2 * 62 * 4);
}

TEST(EncodePly, PutsEveryValueInItsPlace) {
  const Splats splats = RandomSplats(17);  // one past a block
  const std::string ply = EncodePly(splats, false);
  const size_t i = 16;
  EXPECT_EQ(FileValue(ply, 62, i, 2), splats.at(i, kMean + 2));
  EXPECT_EQ(FileValue(ply, 62, i, 3), 0.0f);
  EXPECT_EQ(FileValue(ply, 62, i, 7), splats.at(i, kShDc + 1));
  // Coefficients k = 1, 2, 15 of red, then k = 1 of green and k = 15 of blue.
  EXPECT_EQ(FileValue(ply, 62, i, 9), splats.at(i, kShRest));
  EXPECT_EQ(FileValue(ply, 62, i, 10), splats.at(i, kShRest + 3));
  EXPECT_EQ(FileValue(ply, 62, i, 9 + 14), splats.at(i, kShRest + 3 * 14));
  EXPECT_EQ(FileValue(ply, 62, i, 9 + 15), splats.at(i, kShRest + 1));
  EXPECT_EQ(FileValue(ply, 62, i, 9 + 44), splats.at(i, kShRest + 3 * 14 + 2));
  EXPECT_EQ(FileValue(ply, 62, i, 54), splats.at(i, kLogitOpacity));
  EXPECT_EQ(FileValue(ply, 62, i, 55), splats.at(i, kLogScale));
  EXPECT_EQ(FileValue(ply, 62, i, 58), splats.at(i, kRawQuat));  // w
}

TEST(DecodePly, GivesBackWhatWasWritten) {
  const Splats splats = RandomSplats(35);
  for (bool lita : {false, true}) {
    const auto scene = DecodePly(EncodePly(splats, lita), "f");
    ASSERT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ(scene->sh_degree, 3);
    EXPECT_EQ(scene->lita_attributes, lita);
    ASSERT_EQ(scene->splats.size(), 35u);
    for (size_t i = 0; i < 35; ++i) {
      for (int row = 0; row < kSplatRows; ++row) {
        const float expected = lita || !IsLitaRow(row) ? splats.at(i, row) : 0.0f;
        ASSERT_EQ(scene->splats.at(i, row), expected) << i << " " << row;
      }
    }
  }
  EXPECT_EQ(DecodePly(EncodePly(Splats(), false), "f")->splats.size(), 0u);
}

// A one-Gaussian file with these properties; property number p has value p.
std::string CustomPly(const std::vector<std::string>& properties,
                      const std::string& format = "binary_little_endian") {
  std::string ply =
      "ply\r\nformat " + format + " 1.0\r\ncomment made by a test\r\nelement vertex 1\r\n";
  std::string data;
  for (size_t p = 0; p < properties.size(); ++p) {
    ply += "property " + properties[p] + "\r\n";
    if (properties[p].starts_with("uchar")) {
      data += static_cast<char>(p);
    } else if (properties[p].starts_with("double")) {
      const double value = static_cast<double>(p);
      data.append(reinterpret_cast<const char*>(&value), 8);
    } else {
      const float value = static_cast<float>(p);
      data.append(reinterpret_cast<const char*>(&value), 4);
    }
  }
  return ply + "element face 0\r\nproperty list uchar int vertex_indices\r\nend_header\r\n" + data;
}

std::vector<std::string> OtherOrder(int num_rest) {
  std::vector<std::string> p = {"uchar red",     "float rot_3",   "float rot_2",   "float rot_1",
                                "float rot_0",   "double x",      "float y",       "double z",
                                "float opacity", "float scale_0", "float scale_1", "float scale_2",
                                "float f_dc_0",  "float f_dc_1",  "float f_dc_2"};
  for (int i = 0; i < num_rest; ++i) p.push_back(absl::StrCat("float f_rest_", i));
  return p;
}

TEST(DecodePly, ReadsOtherOrdersTypesAndDegrees) {
  for (int degree = 0; degree <= 3; ++degree) {
    const int per_channel = (degree + 1) * (degree + 1) - 1;
    const auto scene = DecodePly(CustomPly(OtherOrder(3 * per_channel)), "f");
    ASSERT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ(scene->sh_degree, degree);
    const Splats& s = scene->splats;
    EXPECT_EQ(s.at(0, kMean), 5);
    EXPECT_EQ(s.at(0, kMean + 2), 7);
    EXPECT_EQ(s.at(0, kRawQuat), 4);
    EXPECT_EQ(s.at(0, kLogitOpacity), 8);
    for (int k = 0; k < 15; ++k) {
      for (int c = 0; c < 3; ++c) {
        const float expected = k < per_channel ? 15 + c * per_channel + k : 0;
        EXPECT_EQ(s.at(0, kShRest + 3 * k + c), expected) << degree << " " << k << " " << c;
      }
    }
  }
}

TEST(DecodePly, SaysWhatIsUnsupported) {
  const auto status = [](const std::string& bytes) {
    return DecodePly(bytes, "scene.ply").status();
  };
  EXPECT_EQ(Reason(status("solid cube")), "NOT_A_PLY");
  EXPECT_EQ(Reason(status("")), "NOT_A_PLY");
  EXPECT_EQ(Reason(status(CustomPly(OtherOrder(0), "ascii"))), "PLY_UNSUPPORTED");
  EXPECT_EQ(Reason(status(CustomPly(OtherOrder(0), "binary_big_endian"))), "PLY_UNSUPPORTED");
  EXPECT_EQ(Reason(status(CustomPly(OtherOrder(7)))), "PLY_UNSUPPORTED");
  std::vector<std::string> properties = OtherOrder(0);
  properties.push_back("list uchar int names");
  EXPECT_EQ(Reason(status(CustomPly(properties))), "PLY_UNSUPPORTED");
  properties.back() = "float x";  // twice
  EXPECT_EQ(Reason(status(CustomPly(properties))), "PLY_UNSUPPORTED");
  const absl::Status mesh = status(CustomPly({"float x", "float y", "float z"}));
  EXPECT_THAT(std::string(mesh.message()), testing::HasSubstr("'f_dc_0'"));
  EXPECT_THAT(std::string(mesh.message()), testing::StartsWith("scene.ply: "));
}

TEST(DecodePly, RefusesCountsThatTheFileCannotHold) {
  std::string ply = EncodePly(RandomSplats(2), false);
  const size_t at = ply.find("vertex 2");
  for (const auto& [count, reason] : std::vector<std::pair<std::string, std::string>>{
           {"3", "PLY_TRUNCATED"},
           {"20000000", "PLY_TRUNCATED"},
           {"20000001", "PLY_TOO_LARGE"},
           {"-1", "PLY_UNSUPPORTED"},
           {"99999999999999999999", "PLY_UNSUPPORTED"}}) {
    std::string hostile = ply;
    hostile.replace(at, 8, "vertex " + count);
    EXPECT_EQ(Reason(DecodePly(hostile, "f").status()), reason) << count;
  }
  EXPECT_EQ(Reason(DecodePly("ply\n" + std::string(100000, 'a'), "f").status()), "PLY_TRUNCATED");
}

TEST(DecodePly, RefusesValuesThatAreNotFinite) {
  Splats splats = RandomSplats(2);
  splats.at(1, kLogScale) = NAN;
  EXPECT_EQ(Reason(DecodePly(EncodePly(splats, false), "f").status()), "NOT_FINITE");
  for (const int row : {int{kShDc}, kShDc + 2, int{kShRest}, kShRest + 44}) {
    splats = RandomSplats(2);
    splats.at(0, row) = INFINITY;
    EXPECT_EQ(Reason(DecodePly(EncodePly(splats, false), "f").status()), "NOT_FINITE") << row;
  }
}

TEST(DecodePly, SurvivesTruncationAndCorruption) {
  const std::string ply = EncodePly(RandomSplats(2), true);
  for (size_t n = 0; n < ply.size(); ++n) {
    ASSERT_FALSE(DecodePly(std::string_view(ply).substr(0, n), "f").ok()) << n;
  }
  int refused = 0;
  ForEachCorruption(ply, 3000,
                    [&](const std::string& broken) { refused += !DecodePly(broken, "f").ok(); });
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace litags
