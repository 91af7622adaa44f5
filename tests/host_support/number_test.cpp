#include "host/support/number.h"

#include <catch2/catch.hpp>
#include <string>

using torquer::ParseNumber;

TEST_CASE("A number must be the whole text", "[support]") {
  CHECK(ParseNumber("0") == 0.0);
  CHECK(ParseNumber("-1.5") == -1.5);
  CHECK(ParseNumber("+2") == 2.0);
  CHECK(ParseNumber(".5") == 0.5);
  CHECK(ParseNumber("1e-3") == 1e-3);
  CHECK(ParseNumber("0.1") == 0.1);
  for (const std::string text : {"", " ", "+", "-", "+-1", "1 ", " 1", "1mm", "1,5", "0x10", "nan",
                                 "inf", "-inf", "1e999", "1e", "--1", "ten"}) {
    CAPTURE(text);
    CHECK_FALSE(ParseNumber(text).has_value());
  }
}
