// Fuzz target for a device's answers to feature requests. The first byte selects the request;
// answers follow as packets (target.h), and an empty one is a refusal.
#include <cstring>

#include "host/device/report_copy.h"
#include "host/device/sensor_firmware.h"
#include "host/device/sensor_picture.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::feature_replies_target {
namespace {

class Answers : public device::FeatureReports {
 public:
  explicit Answers(std::span<const std::uint8_t> input) : packets_(input) {}
  Bytes Get(std::uint8_t, std::size_t) override {
    const auto answer = packets_.Take(packets_.Word());
    if (answer.empty()) throw device::ReportRefused("refused");
    return {answer.begin(), answer.end()};
  }
  void Set(std::span<const std::uint8_t>) override {
    if (packets_.Byte() % 2 != 0) throw device::ReportRefused("refused");
  }

 private:
  Reader packets_;
};

template <class Report>
Bytes Answer(std::uint8_t what, std::uint8_t id, bool sets = false) {
  Report report{};
  std::memset(static_cast<void*>(&report), 1, sizeof report);
  report.report_id = id;
  report.protocol_version = protocol::kProtocolVersion;
  Bytes input = {what};
  if (sets) input.push_back(0);
  AppendPacket(input, {reinterpret_cast<const std::uint8_t*>(&report), sizeof report});
  return input;
}

std::vector<Bytes> Seeds() {
  using namespace protocol;
  return {Answer<IdentityReport>(0, kIdentityReportId),
          Answer<ConfigurationReport>(1, kConfigurationReportId),
          Answer<DiagnosticsReport>(2, kDiagnosticsReportId),
          Answer<PictureReport>(3, kPictureReportId),
          Answer<DiagnosticsReport>(4, kDiagnosticsReportId, true)};
}

bool Accepts(std::span<const std::uint8_t> input) {
  if (input.empty()) return false;
  Answers device(input.subspan(1));
  try {
    switch (input[0] % 5) {
      case 0:
        device::GetReport<protocol::IdentityReport>(device, protocol::kIdentityReportId);
        return true;
      case 1:
        device::GetReport<protocol::ConfigurationReport>(device, protocol::kConfigurationReportId);
        return true;
      case 2:
        return device::RunningSrom(device) >= 0;
      case 3:
        return !device::TakeSensorPicture(device).pixels.empty();
      default:
        return device::LoadSrom(device, Bytes(protocol::kSromBytes, 1)) != 0;
    }
  } catch (const device::ReportRefused&) {
    return false;
  }
}

const Registration kRegistration(
    {.name = "feature_replies", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 60000});

}  // namespace
}  // namespace torquer::fuzz::feature_replies_target
