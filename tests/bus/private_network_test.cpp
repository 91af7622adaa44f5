#include "tests/support/private_network.h"

#include <catch2/catch.hpp>
#include <cstdio>
#include <string>

#include "host/bus/bus.h"
#include "host/support/error.h"
#include "tests/support/paths.h"

namespace {

struct ShellOutcome {
  int status;
  std::string output;  // both streams
};

ShellOutcome RunShell(const std::string& command) {
  FILE* pipe = popen(("{ " + command + "; } 2>&1").c_str(), "r");
  REQUIRE(pipe != nullptr);
  ShellOutcome outcome{};
  char buffer[256];
  while (fgets(buffer, sizeof buffer, pipe) != nullptr) outcome.output += buffer;
  outcome.status = WEXITSTATUS(pclose(pipe));
  return outcome;
}

const std::string kScript = torquer::test::SourcePath("/host/bus/private_network");

}  // namespace

TEST_CASE("private_network runs its command in a network with only loopback") {
  const ShellOutcome links = RunShell(kScript + " ip -o link");
  CHECK(links.status == 0);
  CHECK(links.output.find("1: lo: <LOOPBACK,MULTICAST,UP") == 0);
  CHECK(links.output.find("\n2: eth") == std::string::npos);
  const ShellOutcome route = RunShell(kScript + " ip route");
  CHECK(route.output.find("224.0.0.0/4 dev lo") != std::string::npos);
}

TEST_CASE("private_network hands on words, open files and the exit status") {
  const ShellOutcome words = RunShell(kScript + " printf '%s|' 'a b' \"c'd\" ''");
  CHECK(words.output == "a b|c'd||");
  CHECK(RunShell("exec 7<<X\nhello\nX\n" + kScript + " cat <&7").output == "hello\n");
  CHECK(RunShell(kScript + " sh -c 'exit 37'").status == 37);
}

TEST_CASE("private_network refuses a missing command and forbidden namespaces") {
  const ShellOutcome nothing = RunShell(kScript);
  CHECK(nothing.status == 2);
  CHECK(nothing.output.find("usage: private_network COMMAND") != std::string::npos);

  // A PATH with a failing unshare simulates a kernel that forbids namespaces.
  const ShellOutcome forbidden = RunShell(
      "d=$(mktemp -d); printf '#!/bin/sh\\nexit 1\\n' >$d/unshare; chmod +x $d/unshare; "
      "PATH=$d:$PATH " +
      kScript + " true; s=$?; rm -r $d; exit $s");
  CHECK(forbidden.status == 2);
  CHECK(forbidden.output.find("namespaces are forbidden") != std::string::npos);
  CHECK(forbidden.output.find("--cap-add SYS_ADMIN") != std::string::npos);
}

TEST_CASE("Without a multicast route the bus names the commands that add one") {
  const ShellOutcome outcome =
      RunShell("unshare -rn ip route; unshare -rn " + torquer::test::ProgramPath("") +
               "/bus_test 'Opening the default bus' --reporter compact");
  CHECK(outcome.output.find("ip route add 224.0.0.0/4 dev lo") != std::string::npos);
}

TEST_CASE("Opening the default bus", "[.]") {
  // The test above runs this case in a namespace that has no route.
  CHECK_NOTHROW(torquer::bus::Bus("udpm://239.255.76.67:7667?ttl=0"));
}
