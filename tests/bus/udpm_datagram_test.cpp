#include "host/bus/udpm_datagram.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <optional>
#include <random>

#include "tests/bus/datagrams.h"
#include "tests/support/sanitizer.h"

using torquer::bus::Sender;
using torquer::bus::UdpmAssembly;
using torquer::test::Bytes;
using torquer::test::FragmentDatagram;
using torquer::test::FragmentHeader;
using torquer::test::WholeDatagram;
using Outcome = torquer::bus::UdpmAssembly::Outcome;

namespace {

constexpr Sender kOne{0x7f000001, 1000};
constexpr Sender kOther{0x7f000001, 1001};

const std::string kChannel("A\0", 2);

std::string Text(const UdpmAssembly::Message& message) {
  return std::string(message.channel) + ":" +
         std::string(reinterpret_cast<const char*>(message.data.data()), message.data.size());
}

}  // namespace

TEST_CASE("A whole datagram is a message") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  const Bytes datagram = WholeDatagram("A", {'x', 'y'});
  REQUIRE(assembly.Take(datagram, kOne, message) == Outcome::kMessage);
  CHECK(Text(message) == "A:xy");
  REQUIRE(assembly.Take(WholeDatagram(std::string(63, 'c'), {}), kOne, message) ==
          Outcome::kMessage);
  CHECK(message.data.empty());
}

TEST_CASE("Datagrams that are not of LCM are refused") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  const Bytes whole = WholeDatagram("A", {});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    CHECK(assembly.Take(cut, kOne, message) == Outcome::kRefused);
  }
  CHECK(assembly.Take(WholeDatagram("", {1}), kOne, message) == Outcome::kRefused);
  CHECK(assembly.Take(WholeDatagram(std::string(64, 'c'), {}), kOne, message) == Outcome::kRefused);
  Bytes other = whole;
  other[3] = '4';
  CHECK(assembly.Take(other, kOne, message) == Outcome::kRefused);
  for (std::size_t size = 0; size < 20; ++size) {
    Bytes cut = FragmentDatagram({}, "");
    cut.resize(size);
    CHECK(assembly.Take(cut, kOne, message) == Outcome::kRefused);
  }
}

TEST_CASE("Fragments of several senders are put together, each sender's apart") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  const auto take = [&](const Sender& sender, FragmentHeader header, const std::string& rest) {
    return assembly.Take(FragmentDatagram(header, rest), sender, message);
  };
  CHECK(take(kOne, {5, 6, 0, 0, 3}, kChannel + "ab") == Outcome::kFragment);
  CHECK(take(kOther, {5, 2, 0, 0, 2}, kChannel + "x") == Outcome::kFragment);
  CHECK(take(kOne, {5, 6, 2, 1, 3}, "cd") == Outcome::kFragment);
  REQUIRE(take(kOther, {5, 2, 1, 1, 2}, "y") == Outcome::kMessage);
  CHECK(Text(message) == "A:xy");
  REQUIRE(take(kOne, {5, 6, 4, 2, 3}, "ef") == Outcome::kMessage);
  CHECK(Text(message) == "A:abcdef");
}

TEST_CASE("A fragment that does not follow gives its message up, not the next") {
  const FragmentHeader wrong = GENERATE(FragmentHeader{6, 6, 2, 1, 3},   // another message
                                        FragmentHeader{5, 7, 2, 1, 3},   // another size
                                        FragmentHeader{5, 6, 3, 1, 3},   // a gap
                                        FragmentHeader{5, 6, 0, 1, 3},   // an overlap
                                        FragmentHeader{5, 6, 2, 2, 3},   // one left out
                                        FragmentHeader{5, 6, 2, 1, 4},   // another fragment count
                                        FragmentHeader{5, 6, 2, 1, 1});  // fewer than before
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  REQUIRE(assembly.Take(FragmentDatagram({5, 6, 0, 0, 3}, kChannel + "ab"), kOne, message) ==
          Outcome::kFragment);
  CHECK(assembly.Take(FragmentDatagram(wrong, "cd"), kOne, message) == Outcome::kRefused);
  CHECK(assembly.Take(FragmentDatagram({5, 6, 2, 1, 3}, "cd"), kOne, message) == Outcome::kRefused);
  REQUIRE(assembly.Take(FragmentDatagram({7, 2, 0, 0, 1}, kChannel + "ok"), kOne, message) ==
          Outcome::kMessage);
  CHECK(Text(message) == "A:ok");
}

TEST_CASE("The two fragments that end liblcm 1.3.1 are refused") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  CHECK(assembly.Take(FragmentDatagram({1, 1000, 0, 0, 3}, kChannel + "ab"), kOne, message) ==
        Outcome::kFragment);
  // Offset plus size wraps around in 32 bits; the sum is then within the announced 1000 bytes.
  CHECK(assembly.Take(FragmentDatagram({1, 1000, 0xffffff00, 1, 3}, std::string(0x200, 'z')), kOne,
                      message) == Outcome::kRefused);
}

TEST_CASE("More than was announced, less, or too much is refused") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  const auto take = [&](FragmentHeader header, const std::string& rest) {
    return assembly.Take(FragmentDatagram(header, rest), kOne, message);
  };
  CHECK(take({1, 3, 0, 0, 1}, kChannel + "abcd") == Outcome::kRefused);
  CHECK(take({1, 3, 0, 0, 2}, kChannel + "abcd") == Outcome::kRefused);
  CHECK(take({1, 5, 0, 0, 1}, kChannel + "abcd") == Outcome::kRefused);
  CHECK(take({1, 4, 0, 0, 0}, kChannel + "abcd") == Outcome::kMessage);  // says it has no fragments
  CHECK(take({1, UdpmAssembly::kLargestMessage + 1, 0, 0, 100}, kChannel) == Outcome::kRefused);
}

TEST_CASE("Only so many messages are in the making") {
  UdpmAssembly assembly;
  UdpmAssembly::Message message;
  const auto count = static_cast<std::uint16_t>(UdpmAssembly::kMostAssemblies + 1);
  for (std::uint16_t k = 0; k < count; ++k) {
    CHECK(assembly.Take(FragmentDatagram({1, 2, 0, 0, 2}, kChannel + "a"), {1, k}, message) ==
          Outcome::kFragment);
  }
  CHECK(assembly.Take(FragmentDatagram({1, 2, 1, 1, 2}, "b"), {1, 0}, message) ==
        Outcome::kRefused);
  for (std::uint16_t k = 1; k < count; ++k) {
    CHECK(assembly.Take(FragmentDatagram({1, 2, 1, 1, 2}, "b"), {1, k}, message) ==
          Outcome::kMessage);
  }
}

TEST_CASE("Random fragments give messages of the announced size, or none") {
  std::mt19937 random(3);
  UdpmAssembly assembly;
  int messages = 0;
  for (int round = 0; round < torquer::test::Rounds(200000, 10); ++round) {
    const auto pick = [&random](std::uint32_t n) {
      return static_cast<std::uint32_t>(random()) % n;
    };
    const FragmentHeader header{pick(2), pick(4), pick(8) == 0 ? pick(UINT32_MAX) : pick(4),
                                static_cast<std::uint16_t>(pick(3)),
                                static_cast<std::uint16_t>(pick(4))};
    UdpmAssembly::Message message;
    const std::string rest = (header.fragment == 0 ? kChannel : "") + std::string(pick(4), 'd');
    const auto outcome =
        assembly.Take(FragmentDatagram(header, rest), pick(2) == 0 ? kOne : kOther, message);
    if (outcome != Outcome::kMessage) continue;
    ++messages;
    REQUIRE(message.channel == "A");
    REQUIRE(message.data.size() == header.size);
    REQUIRE(std::all_of(message.data.begin(), message.data.end(), [](int b) { return b == 'd'; }));
  }
  CHECK(messages > 1000 / (torquer::test::kUnderSanitizer ? 10 : 1));
}
