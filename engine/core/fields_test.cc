#include "engine/core/fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "engine/core/fields_test_util.h"

namespace litags {

enum class Fruit { kApple = 4, kPear = 7 };

template <>
struct EnumWords<Fruit> {
  static constexpr std::pair<Fruit, const char*> kWords[] = {{Fruit::kApple, "apple"},
                                                             {Fruit::kPear, "pear"}};
};

namespace {

struct Basket {
  int count = 3;
  int size = 1;
  double weight = 0.5;
  bool ripe = false;
  Fruit fruit = Fruit::kApple;
  std::optional<Fruit> other = {};
  int threads = 0;
};

template <class T, class Visit>
void VisitFields(FieldsOf<Basket>, T& b, Visit&& visit) {
  visit("count", b.count, FieldRule{.least = 1, .most = 9});
  visit("size", b.size, FieldRule{.least = 1, .most = 9, .odd = true});
  visit("weight", b.weight, FieldRule{.least = 0, .most = 1, .above_least = true});
  visit("ripe", b.ripe, FieldRule());
  visit("fruit", b.fruit, FieldRule());
  visit("other", b.other, FieldRule());
  visit("threads", b.threads,
        FieldRule{.least = 2, .most = 8, .zero = "all cores", .shapes_scene = false});
}

std::string Message(const absl::Status& status) { return std::string(status.message()); }

TEST(Fields, CountsTheMembersOfAStruct) { EXPECT_EQ(CountMembers<Basket>(), 7u); }

TEST(Fields, ChecksRanges) {
  EXPECT_TRUE(CheckFields(Basket(), "").ok());
  EXPECT_EQ(Message(CheckFields(Basket{.count = 10}, "basket.")),
            "basket.count: 10 is not in [1, 9]");
  EXPECT_EQ(GetErrorDetail(CheckFields(Basket{.count = 10}, "basket."))->field, "basket.count");
  EXPECT_EQ(Message(CheckFields(Basket{.weight = 0}, "")), "weight: 0 is not in (0, 1]");
  EXPECT_TRUE(CheckFields(Basket{.weight = 1}, "").ok());
  EXPECT_EQ(Message(CheckFields(Basket{.size = 4}, "")), "size: 4 is not odd");
  EXPECT_EQ(Message(CheckFields(Basket{.size = 11}, "")), "size: 11 is not in [1, 9]");
  EXPECT_FALSE(CheckFields(Basket{.weight = std::nan("")}, "").ok());
  EXPECT_EQ(Message(CheckFields(Basket{.threads = 1}, "")),
            "threads: 1 is neither in [2, 8] nor 0 (all cores)");
  EXPECT_EQ(Message(CheckFields(Basket{.fruit = static_cast<Fruit>(5)}, "")),
            "fruit: there is no value 5; choose one of: apple, pear");
  EXPECT_FALSE(CheckFields(Basket{.other = static_cast<Fruit>(5)}, "").ok());
}

TEST(Fields, ReadsWhatItWrites) {
  const Basket wanted{.count = 7,
                      .size = 5,
                      .weight = 1.0 / 3,
                      .ripe = true,
                      .fruit = Fruit::kPear,
                      .other = Fruit::kPear,
                      .threads = 2};
  Basket read;
  VisitFields(FieldsOf<Basket>(), wanted,
              [&](const char* name, const auto& value, const FieldRule&) {
                EXPECT_TRUE(SetField(name, FieldText(value), &read).ok()) << name;
              });
  EXPECT_EQ(FieldsText(read), FieldsText(wanted));
  EXPECT_EQ(read.weight, 1.0 / 3);
  EXPECT_EQ(FieldsText(Basket()),
            "count=3\nsize=1\nweight=0.5\nripe=false\nfruit=apple\nother=\nthreads=0\n");
  EXPECT_EQ(FieldsText(Basket(), true),
            "count=3\nsize=1\nweight=0.5\nripe=false\nfruit=apple\nother=\n");
}

TEST(Fields, RefusesWhatIsNoValueAndChangesNothing) {
  Basket basket;
  EXPECT_EQ(Message(SetField("count", "seven", &basket)),
            "count: \"seven\" is not a whole number in range");
  EXPECT_EQ(Message(SetField("count", "0", &basket)), "count: 0 is not in [1, 9]");
  EXPECT_EQ(Message(SetField("fruit", "plum", &basket)),
            "fruit: \"plum\" is not one of: apple, pear");
  EXPECT_EQ(Message(SetField("ripe", "maybe", &basket)), "ripe: \"maybe\" is not true or false");
  const absl::Status unknown = SetField("colour", "red", &basket);
  EXPECT_EQ(GetErrorDetail(unknown)->field, "colour");
  EXPECT_THAT(Message(unknown), testing::HasSubstr("count size weight ripe fruit other threads"));
  EXPECT_EQ(FieldsText(basket), FieldsText(Basket()));
}

}  // namespace
}  // namespace litags
