// Daemon: reads the reports of one device and publishes commands for one instrument.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "calibration/motion_model.h"
#include "host/bus/bus.h"
#include "host/bus/health_reporter.h"
#include "host/daemon/claim.h"
#include "host/daemon/pipeline.h"
#include "host/daemon/sensor_image.h"
#include "host/daemon/service_manager.h"
#include "host/daemon/statistics.h"
#include "host/daemon/table_commands.h"
#include "host/device/device_identity.h"
#include "host/device/report_source.h"

namespace torquer::daemon {

struct DaemonOptions {
  std::string instrument;
  std::string calibration_path;                         ///< for messages; "" without calibration
  std::optional<calibration::Calibration> calibration;  ///< nullopt: nominal gains
  /// Without a calibration: use the one that torquer-calibrate stored for the connected device.
  bool calibration_by_serial = false;
  /// The second sensor of the box drives another instrument; else its presence is announced.
  bool second_sensor_used = false;
  /// Gets the output for every report, with the device's serial number; may be empty.
  std::function<void(const std::string& device, const PipelineOutput& output)> observe;
  /// Gets each published state, also without a device; may be empty.
  std::function<void(const HandState& hand)> show;
  /// Gets each announcement, one line; if empty, announcements go to standard error.
  std::function<void(const std::string& line)> announce;
};

class Daemon {
 public:
  /// Claims the instrument, and continues from its position (start_position.h). `bus` must outlive
  /// the daemon. Throws UserError when the instrument is in use.
  Daemon(DaemonOptions options, bus::Bus& bus, std::unique_ptr<device::ReportSource> source);

  /// Reads and publishes until Stop(), then reports its end on the health channel. Throws UserError
  /// if no device is found within kFirstDeviceS, or if the first one cannot be used. Causes:
  /// firmware, calibration, permission, use by another daemon. `beside` is null, or the daemon of
  /// the box's second sensor, whose source does not read (sensor_view.h). It runs and ends with
  /// this one.
  void Run(Daemon* beside = nullptr);

  /// Makes Run() return. From any thread.
  void Stop();
  /// Makes the instrument's present position its start. From any thread.
  void Home();

  /// For the statistics at the end.
  bus::HealthCounters Counters() const;
  const Statistics& statistics() const { return statistics_; }

  static constexpr int kFirstDeviceS = 5;

 private:
  void Step(int timeout_ms);
  void End(const std::exception* error);
  void OnEvent(const device::SourceEvent& event);
  void Take(const device::SourceEvent& event);
  void OnTrouble(const std::string& text);
  void OnConnected(const device::SourceEvent& event);
  void OnReport(const device::SourceEvent& event);
  void OnDisconnected(const device::SourceEvent& event);
  void OnTick(std::int64_t now_us);

  void TakeCalibrationOf(const std::string& serial);
  void CheckSensor(const device::DeviceIdentity& identity);
  bool CheckSensorOnceItAnswers(const device::SourceEvent& event);
  void CheckResolution();
  void Announce(const std::string& state, const std::string& message);
  void AnnounceMark(const MarkPassage& mark);
  void LoadSensorImage();
  void AnnounceFlags(std::int32_t flags, std::int64_t now_us);
  void PublishSample(const PipelineOutput& output);
  void PublishCommand(const HandState& hand, std::int64_t origin_us);
  void PublishHold(std::int64_t now_us);

  DaemonOptions options_;
  bus::Bus& bus_;
  std::unique_ptr<device::ReportSource> source_;
  const std::int64_t start_us_;
  bus::HealthReporter health_;
  ServiceManager service_manager_;
  InstrumentClaim instrument_claim_;
  std::optional<bus::Claim> device_claim_;
  std::string claimed_;  // address and serial number of the claimed device
  std::optional<Pipeline> pipeline_;
  SensorImage sensor_image_;
  std::string device_;  // serial number, once known
  bool connected_ = false;
  bool sensor_checked_ = true;  // against the calibration; false until the sensor has answered
  std::string trouble_;         // last announced problem; cleared when a device is connected
  bool silent_ = false;
  std::int64_t last_report_us_ = 0;
  std::int64_t last_hold_us_ = 0;
  std::int64_t last_flags_us_ = 0;
  std::int32_t announced_flags_ = 0;
  TableCommands table_commands_;
  std::int64_t sequence_ = 0;
  std::int64_t commands_published_ = 0;
  std::int64_t connections_ = 0;
  std::int64_t disconnections_ = 0;
  Statistics statistics_;
  std::atomic<bool> stop_ = false;
  std::atomic<bool> home_ = false;
};

}  // namespace torquer::daemon
