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
    kConnected,     ///< a device is here; features can be asked for, reports follow
    kReport,        ///< one input report
    kDisconnected,  ///< it is gone; another kConnected follows when it, or one like it, is back
    kTrouble,       ///< after a first connection: a device is here that cannot be read, for now
  };
  Kind kind = Kind::kReport;
  std::int64_t host_us = 0;                ///< arrival, CLOCK_MONOTONIC
  std::span<const std::uint8_t> report{};  ///< kReport: as sent, report id first; of any length
  std::string text{};  ///< kConnected: where the device is; otherwise what happened, and remedies
};

/// A feature request that the device refused, as by a USB STALL, or did not answer in time.
class FeatureError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A feature request that the device did not answer in time; it may answer the next.
class FeatureTimeout : public FeatureError {
 public:
  using FeatureError::FeatureError;
};

/// A feature request that found no device, or lost it meanwhile; a kDisconnected event follows with
/// the reason.
class DeviceGone : public FeatureError {
 public:
  using FeatureError::FeatureError;
};

/// All calls from one thread, except Interrupt().
class ReportSource {
 public:
  using Sink = std::function<void(const SourceEvent&)>;

  virtual ~ReportSource() = default;

  /// Waits at most `timeout_ms` for events and passes them to `sink` in order of arrival; returns
  /// early after Interrupt(). While there is no device it looks for one. `sink` may ask for
  /// features. Before a first device was connected it throws UserError for what waiting does not
  /// remedy, such as a device that may not be opened; later that is kTrouble, and tried again.
  virtual void Wait(int timeout_ms, const Sink& sink) = 0;

  /// Lets go of the connected device as if it had failed: the next Wait() says kDisconnected with
  /// `reason`, and later ones look for a device again. Nothing happens when none is connected.
  virtual void LetGo(const std::string& reason) = 0;

  /// Makes a running or the next Wait() return soon. From any thread.
  virtual void Interrupt() = 0;

  /// The feature report `report_id`, report id first. Throws FeatureError.
  virtual std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) = 0;

  /// Sends a feature report, report id first. Throws FeatureError.
  virtual void SetFeature(std::span<const std::uint8_t> report) = 0;

  /// Place where the source looks for a device, for messages: "socket /run/x", "USB (1209:0001)".
  virtual std::string place() const = 0;
};

}  // namespace torquer::device
