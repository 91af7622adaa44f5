#include "tests/hil/timing_report.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "host/bus/clock.h"
#include "host/device/clock_map.h"
#include "host/device/report_decoder.h"
#include "host/device/usb_source.h"
#include "host/support/error.h"

namespace torquer::hil {
namespace {

constexpr int kFeatureReads = 100;
constexpr std::int64_t kTimingPatienceUs = 60000000;

// One line: median, 99th percentile, minimum and maximum.
std::string Line(const char* name, std::vector<double> values) {
  if (values.empty()) return std::string(name) + ": none\n";
  std::sort(values.begin(), values.end());
  const auto quantile = [&values](double fraction) {
    return values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
  };
  char text[160];
  std::snprintf(text, sizeof text, "%-38s p50 %8.1f  p99 %8.1f  min %8.1f  max %8.1f us\n", name,
                quantile(0.5), quantile(0.99), values.front(), values.back());
  return text;
}

struct Series {
  std::vector<double> arrivals_us, samples_us, latencies_us;
};

}  // namespace

std::string TimingReport(const std::string& serial, double seconds) {
  device::UsbSource source(serial);
  device::ReportDecoder decoder;
  device::ClockMap clock_map;
  std::vector<std::pair<std::int64_t, std::int64_t>> seen;  // device time, arrival
  bool connected = false;
  const auto sink = [&](const device::SourceEvent& event) {
    if (event.kind == device::SourceEvent::Kind::kConnected) connected = true;
    if (event.kind != device::SourceEvent::Kind::kReport) return;
    const auto sample = decoder.Decode(event.report, event.host_us);
    if (!sample || sample->epoch_start != device::EpochStart::kNone) return;
    seen.emplace_back(sample->device_time_us, event.host_us);
  };
  const std::int64_t begin_us = bus::MonotonicUs();
  while (!connected) {
    source.Wait(50, sink);
    if (bus::MonotonicUs() - begin_us > kTimingPatienceUs) {
      throw UserError("no bench device at " + source.place() + "; is it plugged in?");
    }
  }
  const std::int64_t start_us = bus::MonotonicUs();
  while (static_cast<double>(bus::MonotonicUs() - start_us) < 1e6 * seconds || seen.size() < 20) {
    source.Wait(50, sink);
    if (bus::MonotonicUs() - start_us >
        kTimingPatienceUs + static_cast<std::int64_t>(1e6 * seconds)) {
      throw UserError("the device at " + source.place() + " sends no reports");
    }
  }
  std::vector<double> reads_us;
  for (int i = 0; i < kFeatureReads; ++i) {
    const std::int64_t asked_us = bus::MonotonicUs();
    source.GetFeature(protocol::kDiagnosticsReportId);
    reads_us.push_back(static_cast<double>(bus::MonotonicUs() - asked_us));
    source.Wait(0, [](const device::SourceEvent&) {});
  }

  Series series;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto [device_us, host_us] = seen[i];
    series.latencies_us.push_back(static_cast<double>(host_us - clock_map.Map(device_us, host_us)));
    if (i == 0) continue;
    series.arrivals_us.push_back(static_cast<double>(host_us - seen[i - 1].second));
    series.samples_us.push_back(static_cast<double>(device_us - seen[i - 1].first));
  }
  const device::DecoderCounters& counters = decoder.counters();
  char drift[40] = "an unknown drift";
  if (clock_map.drift()) std::snprintf(drift, sizeof drift, "%.1f ppm", 1e6 * *clock_map.drift());
  char head[200];
  std::snprintf(head, sizeof head,
                "%zu reports in %.1f s, %lld lost, %lld repeated or late; device clock off by %s\n",
                seen.size(), seconds, static_cast<long long>(counters.lost),
                static_cast<long long>(counters.duplicated + counters.reordered), drift);
  return head + Line("between arrivals (host's clock)", series.arrivals_us) +
         Line("between samples (device's clock)", series.samples_us) +
         Line("from sample to arrival, over the least", series.latencies_us) +
         Line("feature report, asked to answered", reads_us);
}

}  // namespace torquer::hil
