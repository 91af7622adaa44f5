// USB failures: the daemon waits, reports the reason, and resumes at its last position.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <thread>

#include "tests/device/usb_chain.h"

namespace {

using namespace torquer::test;

constexpr int kIdentity = 0x0302;  // value of the control request

std::string NodeOf(const UsbChain& chain, int address) {
  return chain.testbed.Root() + "/dev/bus/usb/001/00" + std::to_string(address);
}

// Drops all capabilities: root, even if only in the namespace, would get access to everything.
std::unique_ptr<ChildProcess> WithoutPowers() {
  return std::make_unique<ChildProcess>(
      std::vector<std::string>{"/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all",
                               kDaemonProgram, "--source", "usb", "--uncalibrated"});
}

int Count(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != std::string::npos; ++at) ++count;
  return count;
}

}  // namespace

TEST_CASE("A device that fails and is never plugged in again is read on") {
  UsbChain chain;
  const auto daemon = chain.Read();
  const double before_mm = chain.Push(kAddress, 10, 10).insertion_mm;
  chain.listener.Forget();
  SECTION("after transfer errors in a row") {
    for (int i = 0; i < 50; ++i) chain.testbed.Input(kAddress, {InputStep::Kind::kError});
    REQUIRE(chain.listener.UntilHealth("waiting for device", "gives only transfer errors"));
  }
  SECTION("as after a suspend of the host") {
    chain.testbed.Lose(kAddress);
    REQUIRE(chain.listener.UntilHealth("waiting for device", "was unplugged"));
  }
  REQUIRE(chain.listener.UntilHealth("running", "device BENCH-7 is connected again"));
  chain.report = StillReport();
  CHECK(chain.Push(kAddress, 10, 10).insertion_mm == Approx(before_mm + 90 * kMmPerCount));
}

TEST_CASE("A device that leaves between being opened and being claimed is waited for") {
  UsbChain chain;
  UsbDeviceScript script = Bench();
  script.lost_claims = 1;
  const auto daemon = chain.Read(script);
}

TEST_CASE("One request for the identity may go unanswered") {
  UsbChain chain;
  UsbDeviceScript script = Bench();
  script.control = [healthy = script.control, asked = 0](const ControlRequest& request) mutable {
    if (request.value == kIdentity && asked++ == 0) {
      return ControlAnswer{ControlAnswer::Kind::kSilence};
    }
    return healthy(request);
  };
  const auto daemon = chain.Read(script);
}

TEST_CASE(
    "A device that comes back unusable does not end the daemon, which reports the reason once") {
  UsbChain chain;
  const auto daemon = chain.Read();
  const double before_mm = chain.Push(kAddress, 10, 10).insertion_mm;
  chain.testbed.Unplug(kAddress);
  REQUIRE(chain.listener.UntilHealth("waiting for device", "was unplugged"));

  UsbDeviceScript script = Bench();
  std::string said;
  SECTION("it refuses its identity") {
    script.control = [](const ControlRequest&) {
      return ControlAnswer{ControlAnswer::Kind::kStall};
    };
    said = "does not report its firmware version";
  }
  SECTION("it has firmware of another version") {
    script.control = [healthy = script.control](const ControlRequest& request) {
      ControlAnswer answer = healthy(request);
      if (request.value == kIdentity) answer.data[1] = 3;
      return answer;
    };
    said = "firmware has protocol version 3";
  }
  SECTION("it runs other firmware") {
    script.input_packet_bytes = 8;
    said = "no input endpoint for reports of 32 bytes";
  }
  SECTION("another program has it") {
    script.busy = true;
    said = "stop the other program";
  }
  chain.testbed.Plug(kAddress + 1, script);
  REQUIRE(chain.listener.UntilHealth("waiting for device", said));
  REQUIRE(chain.listener.UntilHealth("waiting for device", "trying again once a second"));
  const auto holds = chain.listener.holds.size();
  REQUIRE(chain.listener.UntilHolds(holds + 15));  // several attempts later
  CHECK(Count(daemon->Error(), said) == 1);
  chain.testbed.Unplug(kAddress + 1);
  chain.testbed.Plug(kAddress + 2, Bench());
  REQUIRE(chain.listener.UntilHealth("running", "device BENCH-7 is connected again"));
  chain.report = StillReport();
  CHECK(chain.Push(kAddress + 2, 10, 10).insertion_mm == Approx(before_mm + 90 * kMmPerCount));
  daemon->Signal(SIGTERM);
  CHECK(daemon->Wait() == 0);
}

TEST_CASE("An inaccessible device of another maker with the same ids does not interfere") {
  UsbChain chain;
  UsbDeviceScript other = Bench("COFFEE-1");
  other.product = "Coffee machine";
  chain.testbed.Plug(kAddress, other);
  REQUIRE(chmod(NodeOf(chain, kAddress).c_str(), 0) == 0);
  const auto daemon = WithoutPowers();
  REQUIRE(daemon->WaitForError("waiting for USB"));
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // longer than permission may take
  chain.testbed.Plug(kAddress + 1, Bench());
  REQUIRE(daemon->WaitForError("reading device BENCH-7"));
  CHECK(Count(daemon->Error(), "may not be opened") == 0);
}
