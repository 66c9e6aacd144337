#include "engine/onnx/wire.h"

#include <gtest/gtest.h>

#include "engine/onnx/divisors.h"

namespace litags {
namespace {

TEST(Wire, FieldsComeBackInOrder) {
  const std::string message = WireNumber(1, 300) + WireBytes(200, "abc") +
                              "\x1d"
                              "four" +
                              WireBytes(2, "");
  const auto fields = ReadWireFields(message);
  ASSERT_TRUE(fields.has_value());
  ASSERT_EQ(fields->size(), 4u);
  EXPECT_EQ((*fields)[0].whole, WireNumber(1, 300));
  EXPECT_EQ((*fields)[1].number, 200);
  EXPECT_EQ((*fields)[1].value, "abc");
  EXPECT_EQ((*fields)[2].number, 3);  // 32 bits
  EXPECT_EQ((*fields)[3].value, "");
}

TEST(Wire, WhatEndsEarlyIsNoMessage) {
  const std::string message = WireBytes(7, "graph") + WireNumber(1, int64_t{1} << 40);
  for (size_t length = 1; length < message.size(); ++length) {
    const bool whole_field = length == WireBytes(7, "graph").size();
    EXPECT_EQ(ReadWireFields(message.substr(0, length)).has_value(), whole_field) << length;
  }
}

TEST(Wire, BadKeysLengthsAndNumbersAreRefused) {
  EXPECT_FALSE(ReadWireFields(std::string("\x00\x00", 2)));                  // field 0
  EXPECT_FALSE(ReadWireFields("\x0b\x0c"));                                  // a group
  EXPECT_FALSE(ReadWireFields("\x0a\xff\xff\xff\xff\xff\xff\xff\xff\x7f"));  // 2^63 bytes
  EXPECT_FALSE(ReadWireFields(std::string("\x08").append(11, '\xff')));      // endless number
}

TEST(UnshareDivisors, BrokenModelsAreRefusedAndKept) {
  for (const std::string& model :
       {std::string(), WireNumber(1, 7), WireBytes(7, "x") + WireBytes(7, "y"),
        WireBytes(7, WireBytes(1, "\xff")), WireBytes(7, WireBytes(5, "\xff"))}) {
    std::string bytes = model;
    EXPECT_FALSE(UnshareDivisors(&bytes));
    EXPECT_EQ(bytes, model);
  }
}

TEST(UnshareDivisors, AModelWithoutConstantDivisorsKeepsItsBytes) {
  const std::string node = WireBytes(1, "a") + WireBytes(1, "b") + WireBytes(4, "Div");
  const std::string model = WireNumber(1, 7) + WireBytes(7, WireBytes(1, node)) + WireNumber(3, 2);
  std::string bytes = model;
  EXPECT_TRUE(UnshareDivisors(&bytes));
  EXPECT_EQ(bytes, model);
}

}  // namespace
}  // namespace litags
