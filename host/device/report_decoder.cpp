#include "host/device/report_decoder.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace torquer::device {
namespace {

constexpr std::int64_t kNominalIntervalUs = 1000;
constexpr int kSeenBits = 64;
// Reports in the device's two banks, and in the host's controller.
constexpr int kSettlingReports = 4;
constexpr double kMmPerInch = 25.4;

// The step that is congruent to `wrapped_step` modulo 2^bits and nearest to `expected`.
std::int64_t NearestStep(std::uint64_t wrapped_step, int bits, std::int64_t expected) {
  const std::int64_t period = std::int64_t{1} << bits;
  const std::int64_t residue = static_cast<std::int64_t>(wrapped_step) & (period - 1);
  // Whole periods below the expectation, by floor division.
  const std::int64_t difference = expected - residue + period / 2;
  const std::int64_t periods = difference >> bits;
  return residue + periods * period;
}

std::int64_t SignedStep(std::int32_t to, std::int32_t from) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(to) -
                                   static_cast<std::uint32_t>(from));
}

// Fields with the same meaning in every epoch.
Sample PlainFields(const protocol::InputReport& report, std::int64_t receive_us) {
  Sample sample;
  sample.receive_us = receive_us;
  sample.joystick_x = report.joystick_x;
  sample.joystick_y = report.joystick_y;
  sample.buttons = report.buttons;
  sample.flags = report.flags;
  sample.surface_quality = report.surface_quality;
  sample.shutter = report.shutter;
  sample.cpi = report.cpi;
  sample.boot_id = report.boot_id;
  return sample;
}

// Continues the mark: its distance to the continued count is the distance to the count in the
// device.
void PlaceReference(const protocol::InputReport& report, Sample& sample) {
  sample.reference_counts =
      sample.axial_counts + SignedStep(report.reference_counts, report.axial_counts);
}

}  // namespace

std::optional<Sample> ReportDecoder::Decode(std::span<const std::uint8_t> bytes,
                                            std::int64_t receive_us) {
  ++counters_.received;
  const std::optional<protocol::InputReport> report = Check(bytes);
  if (!report) return std::nullopt;
  const bool reset = any_ && report->boot_id != last_.boot_id;
  if (reset) ++counters_.resets;
  if (connecting_) {
    connecting_ = false;
    settling_ = kSettlingReports;
    return BeginEpoch(*report, receive_us, EpochStart::kConnected);
  }
  if (reset) return BeginEpoch(*report, receive_us, EpochStart::kReset);
  return Continue(*report, receive_us);
}

std::optional<protocol::InputReport> ReportDecoder::Check(std::span<const std::uint8_t> bytes) {
  // Checks id and version first, because they explain a foreign report better than its length.
  if (!bytes.empty() && bytes[0] != protocol::kInputReportId) {
    ++counters_.wrong_id;
    return std::nullopt;
  }
  if (bytes.size() >= 2 && bytes[1] != protocol::kProtocolVersion) {
    ++counters_.wrong_version;
    return std::nullopt;
  }
  if (bytes.size() != sizeof(protocol::InputReport)) {
    ++counters_.wrong_length;
    return std::nullopt;
  }
  protocol::InputReport report;
  std::memcpy(&report, bytes.data(), sizeof report);
  return report;
}

Sample ReportDecoder::BeginEpoch(const protocol::InputReport& report, std::int64_t receive_us,
                                 EpochStart start) {
  Sample sample = PlainFields(report, receive_us);
  sample.epoch_start = start;
  if (!any_) {
    sample.device_time_us = report.device_time_us;
    sample.report_number = report.sequence;
    sample.axial_counts = report.axial_counts;
    sample.transverse_counts = report.transverse_counts;
  } else {
    sample.device_time_us =
        last_.device_time_us + std::max<std::int64_t>(1, receive_us - last_.receive_us);
    sample.report_number = last_.report_number + 1;
    sample.axial_counts = last_.axial_counts;
    sample.transverse_counts = last_.transverse_counts;
  }
  PlaceReference(report, sample);
  any_ = true;
  seen_ = 1;
  epoch_first_number_ = sample.report_number;
  last_ = sample;
  last_report_ = report;
  return sample;
}

std::optional<Sample> ReportDecoder::Continue(const protocol::InputReport& report,
                                              std::int64_t receive_us) {
  Sample sample = PlainFields(report, receive_us);
  const std::int64_t time_step =
      NearestStep(static_cast<std::uint64_t>(report.device_time_us) - last_report_.device_time_us,
                  32, receive_us - last_.receive_us);
  const std::int64_t number_step =
      NearestStep(static_cast<std::uint64_t>(report.sequence) - last_report_.sequence, 16,
                  time_step / kNominalIntervalUs);
  sample.device_time_us = last_.device_time_us + time_step;
  sample.report_number = last_.report_number + number_step;
  sample.axial_counts =
      last_.axial_counts + SignedStep(report.axial_counts, last_report_.axial_counts);
  sample.transverse_counts = last_.transverse_counts +
                             SignedStep(report.transverse_counts, last_report_.transverse_counts);
  if (settling_ > 0) {
    --settling_;
    if (number_step > 1) return BeginEpoch(report, receive_us, EpochStart::kConnected);
  }
  if (!SortIn(sample.report_number)) return std::nullopt;

  // If a broken device clock runs backwards, the device time stands still.
  sample.device_time_us = std::max(sample.device_time_us, last_.device_time_us);
  if (MovedImpossibly(sample)) {
    ++counters_.jumps;
    sample.axial_counts = last_.axial_counts;
    sample.transverse_counts = last_.transverse_counts;
    sample.epoch_start = EpochStart::kJump;
  }
  PlaceReference(report, sample);
  last_ = sample;
  last_report_ = report;
  return sample;
}

// Counts a report number; true when it is the newest so far.
bool ReportDecoder::SortIn(std::int64_t report_number) {
  const std::int64_t ahead = report_number - last_.report_number;
  if (ahead > 0) {
    counters_.lost += ahead - 1;
    seen_ = ahead < kSeenBits ? (seen_ << ahead) | 1u : 1u;
    return true;
  }
  const std::int64_t behind = -ahead;
  if (behind >= kSeenBits || report_number < epoch_first_number_) {
    ++counters_.reordered;
    return false;
  }
  const std::uint64_t bit = std::uint64_t{1} << behind;
  if ((seen_ & bit) != 0) {
    ++counters_.duplicated;
  } else {
    seen_ |= bit;
    ++counters_.reordered;
    --counters_.lost;
  }
  return false;
}

bool ReportDecoder::MovedImpossibly(const Sample& sample) const {
  const double passed_s =
      1e-6 * static_cast<double>(
                 std::max(sample.device_time_us - last_.device_time_us, kNominalIntervalUs));
  const double limit =
      kImpossibleSpeedMmPerS / kMmPerInch * std::max<int>(sample.cpi, 100) * passed_s;
  const auto step = [](std::int64_t to, std::int64_t from) {
    return std::abs(static_cast<double>(to - from));
  };
  return step(sample.axial_counts, last_.axial_counts) > limit ||
         step(sample.transverse_counts, last_.transverse_counts) > limit;
}

}  // namespace torquer::device
