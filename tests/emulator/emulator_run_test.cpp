// Tests of torquer-emulator through its socket, as programs use it.
#include "host/emulator/emulator_run.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer::emulator {
namespace {

using Packet = std::vector<std::uint8_t>;

constexpr char kMotionHeader[] = "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons\n";
constexpr auto kPatience = std::chrono::seconds(120);

/// Emulator in its own thread, which runs as fast as its client takes the reports.
class RunningEmulator {
 public:
  explicit RunningEmulator(RunOptions options) {
    options.firmware = torquer::test::FirmwarePath("torquer-firmware.elf");
    options.socket = folder.Path("socket");
    options.use_lcm = false;
    options.fast = true;
    options.wait_client = true;
    if (options.motion.empty()) {
      options.motion = folder.Path("motion.csv");
      std::ofstream(options.motion) << kMotionHeader << "0,0,0,0,0,\n1,100,1,0,0,\n";
    }
    run_.emplace(options);
    thread_ = std::thread([this] { summary_ = run_->Run(stop_); });
  }
  ~RunningEmulator() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  RunSummary Finish() {
    thread_.join();
    return summary_;
  }
  std::string socket() const { return folder.Path("socket"); }

  test::TemporaryFolder folder;

 private:
  std::atomic<bool> stop_ = false;
  std::optional<EmulatorRun> run_;
  RunSummary summary_;
  std::thread thread_;
};

class Client {
 public:
  explicit Client(const std::string& path) : path_(path) { Connect(); }
  ~Client() { close(socket_); }

  void Connect() {
    if (socket_ >= 0) close(socket_);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof(address.sun_path) - 1);
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    do {
      socket_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
      if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
        return;
      }
      close(socket_);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    } while (std::chrono::steady_clock::now() < deadline);
    FAIL("nobody listens at " << path_);
  }
  void Send(const Packet& packet) {
    REQUIRE(send(socket_, packet.data(), packet.size(), MSG_NOSIGNAL) ==
            static_cast<ssize_t>(packet.size()));
  }
  /// Next packet; empty once the device has closed the connection.
  Packet Receive() {
    pollfd event{socket_, POLLIN, 0};
    REQUIRE(poll(&event, 1, 20000) == 1);
    Packet packet(100);
    const ssize_t size = recv(socket_, packet.data(), packet.size(), 0);
    packet.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
    return packet;
  }
  /// Next packet that is not an input report.
  Packet Answer() {
    Packet packet;
    do {
      packet = Receive();
    } while (!packet.empty() && packet[0] == 'I');
    return packet;
  }
  std::vector<protocol::InputReport> ReadToEnd() {
    std::vector<protocol::InputReport> reports;
    for (Packet packet = Receive(); !packet.empty(); packet = Receive()) {
      if (packet[0] != 'I') continue;
      REQUIRE(packet.size() == 1 + sizeof(protocol::InputReport));
      protocol::InputReport report;
      std::memcpy(&report, packet.data() + 1, sizeof(report));
      reports.push_back(report);
    }
    return reports;
  }

 private:
  std::string path_;
  int socket_ = -1;
};

TEST_CASE("a client gets every report of the motion, and its end") {
  RunningEmulator run({});
  Client client(run.socket());
  const std::vector<protocol::InputReport> reports = client.ReadToEnd();
  const RunSummary summary = run.Finish();
  CHECK(summary.reports_sent == static_cast<std::int64_t>(reports.size()));
  REQUIRE(reports.size() > 1240);
  for (std::size_t i = 1; i < reports.size(); ++i) {
    REQUIRE(reports[i].sequence == static_cast<std::uint16_t>(reports[i - 1].sequence + 1));
  }
  CHECK(reports.back().axial_counts == summary.axial_counts);
  CHECK(reports.back().transverse_counts == summary.transverse_counts);
  CHECK(summary.axial_counts == Approx(4724).margin(1));
  CHECK(summary.violations == 0);
  CHECK_FALSE(summary.serial.empty());
}

TEST_CASE("feature reports are read and written over the socket, nonsense is refused") {
  RunningEmulator run({});
  Client client(run.socket());
  client.Send({'G', protocol::kConfigurationReportId});
  Packet configuration = client.Answer();
  REQUIRE(configuration.size() == 17);
  CHECK(configuration[0] == 'F');
  configuration[0] = 'S';
  configuration[3] = 0x20;  // 800 counts per inch
  configuration[4] = 0x03;
  client.Send(configuration);
  CHECK(client.Answer() == Packet{'D'});
  client.Send({'G', protocol::kConfigurationReportId});
  configuration[0] = 'F';
  CHECK(client.Answer() == configuration);
  configuration[0] = 'S';
  configuration[3] = 1;
  client.Send(configuration);
  CHECK(client.Answer() == Packet{'X'});
  client.Send({'G', 77});
  CHECK(client.Answer() == Packet{'X'});
  client.Send({'?'});
  CHECK(client.Answer() == Packet{'X'});
  client.Send({'G'});
  CHECK(client.Answer() == Packet{'X'});
  CHECK(client.ReadToEnd().back().cpi == 800);
}

TEST_CASE("dropped and repeated reports are counted, and equal for equal seeds") {
  const auto result_of = [](std::uint32_t seed) {
    RunOptions options;
    options.drop_probability = 0.1;
    options.repeat_probability = 0.05;
    options.bench.seed = seed;
    RunningEmulator run(options);
    Client client(run.socket());
    const std::vector<protocol::InputReport> reports = client.ReadToEnd();
    const RunSummary summary = run.Finish();
    CHECK(static_cast<std::int64_t>(reports.size()) ==
          summary.reports_sent - summary.reports_dropped + summary.reports_repeated);
    CHECK(summary.reports_dropped > 50);
    CHECK(summary.reports_repeated > 20);
    return std::tuple{summary.reports_dropped, summary.reports_repeated,
                      reports.back().device_time_us, reports.back().axial_counts};
  };
  const auto first = result_of(3);
  CHECK(result_of(3) == first);
  CHECK(result_of(4) != first);
}

TEST_CASE("unplugging closes the connection, and the device is back after it") {
  RunOptions options;
  options.unplugs = {{0.3, 0.2}};
  options.resets_s = {0.8};
  RunningEmulator run(options);
  Client client(run.socket());
  const std::vector<protocol::InputReport> before = client.ReadToEnd();
  client.Connect();
  const std::vector<protocol::InputReport> between = client.ReadToEnd();
  client.Connect();
  const std::vector<protocol::InputReport> after = client.ReadToEnd();
  REQUIRE_FALSE(before.empty());
  REQUIRE_FALSE(between.empty());
  REQUIRE_FALSE(after.empty());
  CHECK(before.back().boot_id != between.front().boot_id);
  CHECK(between.back().boot_id != after.front().boot_id);
}

TEST_CASE("lift and fault come and go at their times") {
  RunOptions options;
  options.lifts = {{0.2, 0.1}};
  options.faults = {{0.5, 0.1}};
  RunningEmulator run(options);
  Client client(run.socket());
  int lifted = 0, faulty = 0;
  for (const protocol::InputReport& report : client.ReadToEnd()) {
    lifted += (report.flags & protocol::kFlagLift) != 0;
    faulty += (report.flags & protocol::kFlagSensorFault) != 0;
  }
  CHECK(lifted == Approx(100).margin(2));
  CHECK(faulty >= 100);
  CHECK(faulty < 800);
}

TEST_CASE("a second client is turned away") {
  RunningEmulator run({});
  Client first(run.socket());
  CHECK_FALSE(first.Receive().empty());
  Client second(run.socket());
  CHECK(second.Receive().empty());
  CHECK_FALSE(first.Receive().empty());
}

TEST_CASE("settings outlive a run in the EEPROM file") {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.eeprom_file = folder.Path("eeprom");
  {
    RunningEmulator run(options);
    Client client(run.socket());
    Packet packet(17);
    packet[0] = 'S';
    packet[1] = protocol::kConfigurationReportId;
    packet[2] = protocol::kProtocolVersion;
    packet[3] = 0x20;
    packet[4] = 0x03;
    client.Send(packet);
    CHECK(client.Answer() == Packet{'D'});
    client.ReadToEnd();
    run.Finish();
  }
  RunningEmulator run(options);
  Client client(run.socket());
  CHECK(client.ReadToEnd().back().cpi == 800);
  run.Finish();
  std::ofstream(folder.Path("eeprom")) << "short";
  RunOptions bad = options;
  CHECK_THROWS_WITH(RunningEmulator(bad), Catch::Contains("--eeprom") && Catch::Contains("1024"));
}

TEST_CASE("a path that cannot be listened at is refused") {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.firmware = torquer::test::FirmwarePath("torquer-firmware.elf");
  options.use_lcm = false;
  options.duration_s = 1;
  for (const std::string& path :
       {std::string(200, 'x'), folder.Path("no/such/folder/socket"), std::string("/etc/passwd")}) {
    options.socket = path;
    CHECK_THROWS_AS(EmulatorRun(options), UserError);
  }
}

struct Outcome {
  int status;
  std::string output, error;
};

Outcome Emulator(std::vector<std::string> words) {
  words.insert(words.begin(), torquer::test::ProgramPath("torquer-emulator"));
  test::ChildProcess emulator(words);
  const int status = emulator.Wait();
  return {status, emulator.Output(), emulator.Error()};
}

TEST_CASE("the program ends with its summary as JSON") {
  const test::TemporaryFolder folder;
  std::ofstream(folder.Path("motion.csv")) << kMotionHeader << "0,0,0,0,0,\n1,50,0,0,0,\n";
  const Outcome outcome =
      Emulator({"--motion", folder.Path("motion.csv"), "--socket", folder.Path("socket"),
                "--lcm-url", "none", "--fast", "--json", "--serial", "ABC"});
  CHECK(outcome.status == 0);
  const std::string last =
      outcome.output.substr(outcome.output.rfind('\n', outcome.output.size() - 2) + 1);
  const nlohmann::json summary = nlohmann::json::parse(last);
  CHECK(summary["axial_counts"] == 2362);
  CHECK(summary["reports_sent"] == 0);  // no client read the reports
  CHECK(summary["violations"] == 0);
  CHECK(summary["cycles_used_fraction"] < 0.6);
  CHECK(summary["time_simulated_s"] > 1.25);
  CHECK(summary.at("latest_frame_ms").is_null());  // nothing is late without real time
}

const std::string kBootloader = torquer::test::FirmwarePath("torquer-bootloader.elf");

TEST_CASE("the firmware runs the same with and without a bootloader") {
  const test::TemporaryFolder folder;
  std::ofstream(folder.Path("motion.csv")) << kMotionHeader << "0,0,0,0,0,\n1,50,0,0,0,\n";
  const Outcome outcome =
      Emulator({"--motion", folder.Path("motion.csv"), "--socket", folder.Path("socket"),
                "--lcm-url", "none", "--fast", "--json", "--bootloader", kBootloader});
  CHECK(outcome.status == 0);
  CHECK_THAT(outcome.output,
             Catch::Contains("\"axial_counts\":2362") && Catch::Contains("\"violations\":0"));
}

TEST_CASE("the program refuses unusable input, with status 2 and a reason") {
  const std::pair<std::vector<std::string>, const char*> cases[] = {
      {{"--motion", "/nonexistent.csv"}, "/nonexistent.csv"},
      {{"--firmware", "/nonexistent.elf"}, "/nonexistent.elf"},
      {{"--bootloader", torquer::test::FirmwarePath("torquer-bootloader-8mhz.elf")}, "8 MHz"},
      {{"--bootloader", torquer::test::FirmwarePath("torquer-firmware.elf")}, "lies where"},
      {{"--drop", "2"}, "--drop"},
      {{"--lift-at", "3"}, "2.5:0.3"},
      {{"--scale", "big"}, "big"},
      {{"--laser"}, "--laser"},
      {{"--sensor", "adns9800"}, "is not one of pmw3360, pmw3389"},
      {{"--supply-mv", "9000"}, "--supply-mv"},
      {{"--serial", "a b"}, "a b"},
  };
  const test::TemporaryFolder folder;
  for (auto [words, reason] : cases) {
    words.insert(words.end(),
                 {"--lcm-url", "none", "--duration", "1", "--socket", folder.Path("socket")});
    const Outcome outcome = Emulator(words);
    INFO(outcome.error);
    CHECK(outcome.status == 2);
    CHECK_THAT(outcome.error, Catch::Contains(reason));
  }
}

}  // namespace
}  // namespace torquer::emulator
