// From the bytes of input reports to samples whose numbers no longer wrap.
//
// A cumulative count, the device clock and the sequence number all wrap; each is continued to 64
// bits by taking the value nearest to an expectation: counts near the previous ones, device time
// near the host time that has passed, sequence near the device time that has passed. Restarted
// devices (another boot id) and new connections begin a new epoch, in which the 64-bit numbers go
// on from where they were, without a jump. No I/O, no clock.
//
// A device that nobody polled still holds the reports of that time: a gap behind the first few
// reports of a connection is no loss, the epoch merely begins behind it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "protocol/hid_reports.h"

namespace torquer::device {

/// Why a sample does not continue the one before: what the hand moved in between is not known, and
/// neither is how long it took.
enum class EpochStart {
  kNone,       ///< it does continue it
  kConnected,  ///< the device was (re)connected
  kReset,      ///< the device restarted while connected
  kJump,       ///< counts moved faster than any hand
};

/// One report, understood.
struct Sample {
  std::int64_t receive_us = 0;         ///< host time of arrival
  std::int64_t device_time_us = 0;     ///< device clock, continued over wraps and epochs
  std::int64_t report_number = 0;      ///< counts lost reports too; continued likewise
  std::int64_t axial_counts = 0;       ///< cumulative, continued likewise
  std::int64_t transverse_counts = 0;  ///< cumulative, continued likewise
  std::uint16_t joystick_x = 0;        ///< 0 .. 1023
  std::uint16_t joystick_y = 0;        ///< 0 .. 1023
  std::uint8_t buttons = 0;            ///< protocol::Button bits
  std::uint8_t flags = 0;              ///< protocol::ReportFlag bits
  std::uint8_t surface_quality = 0;
  std::uint16_t shutter = 0;
  std::uint16_t cpi = 0;
  std::uint8_t boot_id = 0;
  EpochStart epoch_start = EpochStart::kNone;
};

/// What became of reports, since the start.
struct DecoderCounters {
  std::int64_t received = 0;       ///< all, refused ones included
  std::int64_t lost = 0;           ///< missing in the sequence within an epoch
  std::int64_t duplicated = 0;     ///< seen before; ignored
  std::int64_t reordered = 0;      ///< late, after a newer one; ignored, and no longer lost
  std::int64_t wrong_length = 0;   ///< truncated or overlong; refused
  std::int64_t wrong_id = 0;       ///< another report id; refused
  std::int64_t wrong_version = 0;  ///< another protocol version; refused
  std::int64_t resets = 0;         ///< changes of the boot id, whether seen connected or not
  std::int64_t jumps = 0;  ///< counts that moved faster than any hand; begun anew from there
};

/// Plausible speed of the sensor's surface, mm/s. Counts that change faster did not come from a
/// hand (the device's counters were set to zero, say).
inline constexpr double kImpossibleSpeedMmPerS = 25000.0;

class ReportDecoder {
 public:
  /// The device was (re)connected: the next report begins an epoch whatever its boot id.
  void OnConnected() { connecting_ = true; }

  /// The sample in one report, or nothing when it was refused, late or seen before; the counters
  /// tell which.
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
