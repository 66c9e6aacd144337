#include "server/jobs/codec.h"

#include <gtest/gtest.h>

#include <limits>

#include "engine/core/error_test_util.h"

namespace litags {
namespace {

TEST(Codec, OptionsSurviveTheirJson) {
  ReconstructOptions options;
  options.method = Method::k3dgs;
  options.tone = Tone::kNone;
  options.seed = std::numeric_limits<uint64_t>::max();
  options.max_gaussians = int64_t{1} << 40;
  options.min_registered = 0.1234567890123456;
  const auto read = Decode<ReconstructOptions>(Encode(options));
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(Encode(*read), Encode(options));
  EXPECT_EQ(read->min_registered, options.min_registered);
  EXPECT_EQ(read->tone, Tone::kNone);
  EXPECT_EQ(read->seed, options.seed);
  EXPECT_EQ(read->method, Method::k3dgs);
}

// As the store of version 98a1698 has it; "tone" 1 and "theta" are gone.
TEST(Codec, OptionsOfOldStoresAreRead) {
  const auto old = Decode<ReconstructOptions>(
      "{\"method\":1,\"tone\":3,\"theta\":0.4,\"settle_epochs\":9.0,\"iterations\":77}");
  ASSERT_TRUE(old.ok()) << old.status();
  EXPECT_EQ(old->method, Method::k3dgs);
  EXPECT_EQ(old->tone, Tone::kCapture);
  EXPECT_EQ(old->iterations, 77);
  EXPECT_FALSE(Decode<ReconstructOptions>("{\"tone\":1}")->tone.has_value());
}

TEST(Codec, MissingKeysTakeDefaultsAndBrokenTextIsAnError) {
  EXPECT_EQ(Decode<ReconstructOptions>("{\"unknown\": 1}")->iterations,
            ReconstructOptions().iterations);
  EXPECT_EQ(Reason(Decode<ReconstructOptions>("{\"min_registered\": \"x\"}").status()),
            "STORE_CORRUPT");
  EXPECT_EQ(Reason(Decode<StateChange>("").status()), "STORE_CORRUPT");
}

}  // namespace
}  // namespace litags
