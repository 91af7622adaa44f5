#include "host/support/printable_text.h"

#include <catch2/catch.hpp>
#include <random>

using torquer::Printable;

TEST_CASE("Printable text does not change") {
  CHECK(Printable("").empty());
  CHECK(Printable("reading device A-1 at 3%, \\ and \"") == "reading device A-1 at 3%, \\ and \"");
  // Bytes of an accent, Greek, Chinese, and an emoji beyond 16 bits.
  for (const char* text : {"caf\xc3\xa9", "\xce\xbc", "\xe8\xa1\x80", "\xf0\x9f\xa9\xb8"}) {
    CHECK(Printable(text) == text);
  }
}

TEST_CASE("Control characters are written out") {
  CHECK(Printable("\x1b[2J\rdevice running") == "\\x1b[2J\\x0ddevice running");
  CHECK(Printable("a\nb\tc\x7f") == "a\\x0ab\\x09c\\x7f");
  CHECK(Printable(std::string_view("a\0b", 3)) == "a\\x00b");
  // U+009B: some terminals treat it as ESC [.
  CHECK(Printable("\xc2\x9b"
                  "2J") == "\\u{9b}2J");
  CHECK(Printable("ok\xe2\x80\xaetxet") == "ok\\u{202e}txet");
  CHECK(Printable("a\xe2\x80\x8b"
                  "b") == "a\\u{200b}b");
}

TEST_CASE("Invalid UTF-8 is written out byte by byte") {
  CHECK(Printable("\x9b"
                  "2J") == "\\x9b2J");
  CHECK(Printable("a\xc3") == "a\\xc3");
  CHECK(Printable("\xe8\xa1") == "\\xe8\\xa1");
  CHECK(Printable("\xc0\x9b") == "\\xc0\\x9b");                    // an overlong form of ESC
  CHECK(Printable("\xe0\x80\x9b") == "\\xe0\\x80\\x9b");           // another overlong form
  CHECK(Printable("\xed\xa0\x80") == "\\xed\\xa0\\x80");           // half of a surrogate pair
  CHECK(Printable("\xf5\x80\x80\x80") == "\\xf5\\x80\\x80\\x80");  // beyond the last code point
  CHECK(Printable("\xff") == "\\xff");
}

TEST_CASE("Long text is cut between characters") {
  CHECK(Printable("abcdef", 6) == "abcdef");
  CHECK(Printable("abcdefg", 6) == "abcdef..");
  CHECK(Printable("abcde\xc3\xa9", 6) == "abcde..");
  CHECK(Printable("abcd\x1b", 6) == "abcd..");
}

TEST_CASE("Random bytes become text that steers no terminal") {
  std::mt19937 random(11);
  for (int round = 0; round < 2000; ++round) {
    std::string text(random() % 40, '\0');
    for (char& byte : text) byte = static_cast<char>(random());
    const std::string shown = Printable(text);
    for (const char byte : shown) {
      REQUIRE(static_cast<unsigned char>(byte) >= 0x20);
      REQUIRE(byte != 0x7f);
    }
    // Printable output stays unchanged when printed again.
    REQUIRE(Printable(shown) == shown);
  }
}
