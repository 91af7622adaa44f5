// Interface of a source of reports: USB, a Unix socket, or an ordinary mouse and joystick.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace torquer::device {

/// One event from a report source.
struct SourceEvent {
  enum class Kind {
    kConnected,     ///< a device is connected; features can be requested, reports follow
    kReport,        ///< one input report
    kDisconnected,  ///< no device is connected; kConnected follows when it, or a device like it, is
                    ///< back
    kTrouble,  ///< after a first connection: a device is connected, but cannot be read at present
  };
  Kind kind = Kind::kReport;
  std::int64_t host_us = 0;                ///< arrival, CLOCK_MONOTONIC
  std::span<const std::uint8_t> report{};  ///< kReport: as sent, report id first; of any length
  std::string text{};  ///< kConnected: place of the device; otherwise cause and remedy
};

/// Error of a feature request: refused, as by a USB STALL, or not answered in time.
class FeatureError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Error of a feature request that was not answered in time; the next one may be answered.
class FeatureTimeout : public FeatureError {
 public:
  using FeatureError::FeatureError;
};

/// Error of a feature request without a device, or with a device that was unplugged during it. A
/// kDisconnected event follows with the reason.
class DeviceGone : public FeatureError {
 public:
  using FeatureError::FeatureError;
};

/// One thread makes all calls, except Interrupt().
class ReportSource {
 public:
  using Sink = std::function<void(const SourceEvent&)>;

  virtual ~ReportSource() = default;

  /// Waits at most `timeout_ms` for events and passes them to `sink` in order of arrival; returns
  /// early after Interrupt(). Without a device it searches for one. `sink` may request features.
  /// Before the first connection it throws UserError for a lasting problem, such as a device that
  /// may not be opened. After the first connection, the problem is a kTrouble event, and the next
  /// attempt follows.
  virtual void Wait(int timeout_ms, const Sink& sink) = 0;

  /// Releases the connected device as after a failure. The next Wait() gives kDisconnected with
  /// `reason`, and later calls search for a device again. Without a connected device it has no
  /// effect.
  virtual void LetGo(const std::string& reason) = 0;

  /// Makes a running or the next Wait() return soon. Any thread may call it.
  virtual void Interrupt() = 0;

  /// The feature report `report_id`, report id first. Throws FeatureError.
  virtual std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) = 0;

  /// Sends a feature report, report id first. Throws FeatureError.
  virtual void SetFeature(std::span<const std::uint8_t> report) = 0;

  /// Sensor of the box whose reports these are: 1, or 2 for the catheter's (sensor_view.h).
  virtual int sensor() const { return 1; }

  /// Place where the source looks for a device, for messages: "socket /run/x", "USB (1209:0001)".
  virtual std::string place() const = 0;
};

}  // namespace torquer::device
