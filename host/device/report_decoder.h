// Report decoder: converts the bytes of input reports to samples whose numbers do not wrap.
//
// The cumulative counts, the device clock and the sequence number all wrap. Each is continued to 64
// bits, with the value nearest to an expected one. Counts are expected near the previous counts.
// The elapsed host time predicts the device time, and the elapsed device time predicts the sequence
// number. A restarted device (another boot id) and a new connection begin a new epoch. The 64-bit
// numbers continue in it without a jump. No I/O, no clock.
//
// A device that was not polled still holds the reports of that time. A gap after the first few
// reports of a connection is therefore no loss: the epoch begins after the gap.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "protocol/hid_reports.h"

namespace torquer::device {

/// Reason why a sample does not continue the previous one. The motion and the time between them are
/// unknown.
enum class EpochStart {
  kNone,       ///< it continues it
  kConnected,  ///< the device was (re)connected
  kReset,      ///< the device restarted while connected
  kJump,       ///< counts moved faster than any hand
};

/// One report, decoded.
struct Sample {
  std::int64_t receive_us = 0;         ///< host time of arrival
  std::int64_t device_time_us = 0;     ///< device clock, continued over wraps and epochs
  std::int64_t report_number = 0;      ///< counts lost reports too; continued as well
  std::int64_t axial_counts = 0;       ///< cumulative, continued as well
  std::int64_t transverse_counts = 0;  ///< cumulative, continued as well
  /// axial_counts when the end switch last closed; without meaning unless flags has kFlagReference.
  std::int64_t reference_counts = 0;
  std::uint16_t joystick_x = 0;  ///< 0 .. 1023
  std::uint16_t joystick_y = 0;  ///< 0 .. 1023
  std::uint8_t buttons = 0;      ///< protocol::Button bits
  std::uint8_t flags = 0;        ///< protocol::ReportFlag bits
  std::uint8_t surface_quality = 0;
  std::uint16_t shutter = 0;
  std::uint16_t cpi = 0;
  std::uint8_t boot_id = 0;
  EpochStart epoch_start = EpochStart::kNone;
};

/// Numbers of reports since the start.
struct DecoderCounters {
  std::int64_t received = 0;       ///< all, refused ones included
  std::int64_t lost = 0;           ///< missing in the sequence within an epoch
  std::int64_t duplicated = 0;     ///< received before; ignored
  std::int64_t reordered = 0;      ///< late, after a newer one; ignored, and no longer lost
  std::int64_t wrong_length = 0;   ///< truncated or overlong; refused
  std::int64_t wrong_id = 0;       ///< another report id; refused
  std::int64_t wrong_version = 0;  ///< another protocol version; refused
  std::int64_t resets = 0;         ///< changes of the boot id, while connected or not
  std::int64_t jumps = 0;          ///< counts that moved faster than any hand; continued from there
};

/// Largest speed at which a hand moves the sensor's surface, mm/s. Faster counts have another
/// cause, such as counters of the device that were set to zero.
inline constexpr double kImpossibleSpeedMmPerS = 25000.0;

class ReportDecoder {
 public:
  /// Call after a (re)connection: the next report begins an epoch, with any boot id.
  void OnConnected() { connecting_ = true; }

  /// Sample of one report; nullopt for a report that was refused, late or received before. The
  /// counters show the reason.
  std::optional<Sample> Decode(std::span<const std::uint8_t> report, std::int64_t receive_us);

  const DecoderCounters& counters() const { return counters_; }

 private:
  std::optional<protocol::InputReport> Check(std::span<const std::uint8_t> report);
  Sample BeginEpoch(const protocol::InputReport& report, std::int64_t receive_us, EpochStart start);
  std::optional<Sample> Continue(const protocol::InputReport& report, std::int64_t receive_us);
  bool SortIn(std::int64_t report_number);
  bool MovedImpossibly(const Sample& sample) const;

  bool connecting_ = true;
  bool any_ = false;  // a sample has been decoded
  int settling_ = 0;  // reports to come that may be older than the connection
  Sample last_;
  protocol::InputReport last_report_{};  // whose numbers last_ continues
  // Bit k: the report k before the newest has been seen in this epoch.
  std::uint64_t seen_ = 0;
  // Reports older than this one belong to an earlier epoch.
  std::int64_t epoch_first_number_ = 0;
  DecoderCounters counters_;
};

}  // namespace torquer::device
