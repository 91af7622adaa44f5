// Fuzz target for a device's input reports, from bytes to a command. Each packet (target.h) has a
// word of time since the previous one in 0.1 ms, and the report. An empty packet is a new
// connection.
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "host/daemon/pipeline.h"
#include "tests/fuzz/target.h"
#include "tests/support/reports.h"

namespace torquer::fuzz::device_reports_target {
namespace {

std::vector<Bytes> Seeds() {
  Bytes still, moving;
  protocol::InputReport report = test::StillReport(65530);
  for (int i = 0; i < 12; ++i) {
    Bytes packet = {10, 0};
    const auto bytes = test::BytesOf(report);
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(still, packet);
    report = test::Next(report);
  }
  for (int i = 0; i < 12; ++i) {
    report.axial_counts += 1000;
    report.transverse_counts -= 7;
    report.buttons = i % 3 == 0 ? protocol::kButtonClutch : 0;
    report.flags = i == 5 ? protocol::kFlagReference : 0;
    Bytes packet = {static_cast<std::uint8_t>(i), 0};
    const auto bytes = test::BytesOf(report);
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(moving, packet);
    if (i == 7) AppendPacket(moving, {});
    report = test::Next(report);
  }
  return {still, moving};
}

bool Accepts(std::span<const std::uint8_t> input) {
  daemon::Pipeline pipeline(
      daemon::HandTracker(calibration::NominalCalibration("FUZZ-1", 1200), {}));
  bool any = false;
  std::int64_t now_us = 1'000'000;
  std::int64_t last_origin_us = 0;
  for (Reader packets(input); !packets.empty();) {
    Reader packet(packets.Take(packets.Word()));
    if (packet.empty()) {
      pipeline.OnConnected();
      continue;
    }
    now_us += 100 * packet.Word();
    const auto bytes = packet.Take(1000);
    const Bytes report(bytes.begin(), bytes.end());
    const auto output = pipeline.OnReport(report, now_us);
    if (!output) continue;
    any = true;
    const daemon::Pose& pose = output->hand.pose;
    if (!std::isfinite(pose.insertion_mm) || !std::isfinite(pose.rotation_rad) ||
        std::abs(pose.lao_rad) > daemon::kLaoLimitRad ||
        std::abs(pose.cra_rad) > daemon::kCraLimitRad) {
      throw std::logic_error("a pose beyond its range");
    }
    if (output->origin_us > now_us || output->origin_us < 0) {
      throw std::logic_error("sampled after its arrival");
    }
    last_origin_us = output->origin_us;
  }
  return any && last_origin_us != 0;
}

// Corrects the report id and the protocol version of each report.
void Repair(Bytes& input) {
  for (std::size_t at = 0; at + 6 <= input.size();) {
    const std::size_t size = static_cast<std::size_t>(input[at] | input[at + 1] << 8);
    if (size > 3) {
      input[at + 4] = protocol::kInputReportId;
      input[at + 5] = protocol::kProtocolVersion;
    }
    at += 2 + size;
  }
}

const Registration kRegistration({.name = "device_reports",
                                  .seeds = Seeds,
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 40000});

}  // namespace
}  // namespace torquer::fuzz::device_reports_target
