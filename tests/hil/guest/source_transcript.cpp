// source_transcript usb|hidraw prints one conversation with the only bench device through a report
// source. The text is the same for every source. The device is restarted once; its settings do not
// change.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>

#include "host/bus/clock.h"
#include "host/device/device_identity.h"
#include "host/device/report_decoder.h"
#include "host/device/source_choice.h"
#include "protocol/hid_reports.h"

namespace {

using namespace torquer;
using device::SourceEvent;
using Bytes = std::vector<std::uint8_t>;

constexpr int kReports = 100;
constexpr std::int64_t kPatienceUs = 120000000;

class Conversation {
 public:
  explicit Conversation(const std::string& kind) {
    device::SourceChoice choice;
    choice.source = kind;
    source_ = device::OpenSource(choice);
  }

  // Runs until `done`; false on timeout.
  template <class Done>
  bool Until(const char* what, Done done) {
    const std::int64_t end_us = bus::MonotonicUs() + kPatienceUs;
    while (!done() && bus::MonotonicUs() < end_us) {
      source_->Wait(50, [this](const SourceEvent& event) { Take(event); });
    }
    std::printf("%s: %s\n", what, done() ? "yes" : "no");
    return done();
  }
  bool Connected() {
    return Until("connected", [this] { return connected_; });
  }
  bool Gone() {
    return Until("gone", [this] { return !connected_; });
  }
  bool Reports() {
    const std::int64_t from = decoder_.counters().received;
    return Until("reports follow", [&] { return decoder_.counters().received >= from + kReports; });
  }

  void Get(const char* what, std::uint8_t id) {
    try {
      Print(what, source_->GetFeature(id));
    } catch (const device::FeatureError& error) {
      std::printf("%s: %s\n", what, error.what());
    }
  }
  void Set(const char* what, const Bytes& report) {
    try {
      source_->SetFeature(report);
      std::printf("%s: taken\n", what);
    } catch (const device::FeatureError& error) {
      std::printf("%s: %s\n", what, error.what());
    }
  }

  device::ReportSource& source() { return *source_; }
  const device::DecoderCounters& counters() const { return decoder_.counters(); }

 private:
  void Take(const SourceEvent& event) {
    switch (event.kind) {
      case SourceEvent::Kind::kConnected:
        connected_ = true;
        decoder_.OnConnected();
        break;
      case SourceEvent::Kind::kDisconnected:
      case SourceEvent::Kind::kTrouble:
        connected_ = false;
        break;
      case SourceEvent::Kind::kReport:
        decoder_.Decode(event.report, event.host_us);
        break;
    }
  }
  static void Print(const char* what, const Bytes& bytes) {
    std::printf("%s:", what);
    for (const std::uint8_t byte : bytes) std::printf(" %02x", byte);
    std::printf("\n");
  }

  std::unique_ptr<device::ReportSource> source_;
  device::ReportDecoder decoder_;
  bool connected_ = false;
};

template <class Report>
Bytes BytesOf(const Report& report) {
  Bytes bytes(sizeof report);
  std::memcpy(bytes.data(), &report, sizeof report);
  return bytes;
}

Bytes Configuration(std::uint16_t cpi, std::size_t length) {
  protocol::ConfigurationReport report{};
  report.report_id = protocol::kConfigurationReportId;
  report.protocol_version = protocol::kProtocolVersion;
  report.cpi = cpi;
  report.joystick_deadzone = 40;
  Bytes bytes(std::max(length, sizeof report), 0xee);
  std::memcpy(bytes.data(), &report, sizeof report);
  return bytes;
}

int Converse(const std::string& kind) {
  Conversation talk(kind);
  if (!talk.Connected()) return 1;
  std::printf("serial: %s\n", device::ReadIdentity(talk.source()).serial.c_str());
  if (!talk.Reports()) return 1;
  constexpr std::size_t kWhole = sizeof(protocol::ConfigurationReport);
  talk.Get("identity", protocol::kIdentityReportId);
  const Bytes before = talk.source().GetFeature(protocol::kConfigurationReportId);
  talk.Set("another configuration", Configuration(1600, kWhole));
  talk.Get("configuration", protocol::kConfigurationReportId);
  talk.Set("a padded one", Configuration(800, protocol::kLongestReportBytes));
  talk.Get("configuration", protocol::kConfigurationReportId);
  talk.Set("an impossible one", Configuration(123, kWhole));
  talk.Set("half of one", Configuration(1600, kWhole / 2));
  talk.Get("configuration", protocol::kConfigurationReportId);
  talk.Set("that from before", before);
  talk.Get("a report that there is not", 99);
  talk.Get("one that cannot be read", protocol::kCommandReportId);
  if (!talk.Reports()) return 1;
  const std::int64_t resets = talk.counters().resets;
  talk.Set("a restart",
           BytesOf(protocol::CommandReport{
               protocol::kCommandReportId, protocol::kCommandReset, protocol::kCommandKey, {}}));
  if (!talk.Gone() || !talk.Connected() || !talk.Reports()) return 1;
  std::printf("another boot: %s\n", talk.counters().resets == resets + 1 ? "yes" : "no");
  std::printf("refused reports: %lld\n",
              static_cast<long long>(talk.counters().wrong_length + talk.counters().wrong_id +
                                     talk.counters().wrong_version));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return argc == 2 ? Converse(argv[1]) : 2;
  } catch (const std::exception& error) {
    std::printf("%s\n", error.what());
    return 1;
  }
}
