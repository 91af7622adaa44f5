#include "host/daemon/daemon.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <utility>

#include "calibration/calibration_file.h"
#include "host/bus/clock.h"
#include "host/daemon/start_position.h"
#include "host/device/device_identity.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/printable_text.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"

namespace torquer::daemon {
namespace {

constexpr int kTickMs = 50;
constexpr std::int64_t kSilentAfterUs = 250000;
constexpr std::int64_t kHoldIntervalUs = 100000;
constexpr std::int64_t kFlagsIntervalUs = 100000;

std::string Describe(const Pose& pose) {
  return fmt::format("{:.2f} mm inserted, {:.3f} rad turned", pose.insertion_mm, pose.rotation_rad);
}

}  // namespace

Daemon::Daemon(DaemonOptions options, bus::Bus& bus, std::unique_ptr<device::ReportSource> source)
    : options_(std::move(options)),
      bus_(bus),
      source_(std::move(source)),
      start_us_(bus::MonotonicUs()),
      health_(bus, "daemon"),
      instrument_claim_(options_.instrument, bus.url()) {
  health_.SetInstrument(options_.instrument);
  const StartPosition start =
      FindStart(options_.instrument, instrument_claim_.previous(), bus_.url());
  sequence_ = start.sequence;
  pipeline_.emplace(HandTracker(options_.calibration, start.pose));
  Announce("waiting for device",
           start.from.empty()
               ? fmt::format("starting at zero; waiting for {}", source_->place())
               : fmt::format("continuing from the position of {}: {}; waiting for {}", start.from,
                             Describe(start.pose), source_->place()));
}

void Daemon::Run(Daemon* beside) {
  service_manager_.Ready();
  try {
    while (!stop_) {
      Step(kTickMs);
      if (beside != nullptr) beside->Step(0);
    }
  } catch (const std::exception& error) {
    End(&error);
    if (beside != nullptr) beside->End(&error);
    throw;
  }
  End(nullptr);
  if (beside != nullptr) beside->End(nullptr);
}

void Daemon::Step(int timeout_ms) {
  source_->Wait(timeout_ms, [this](const device::SourceEvent& event) { OnEvent(event); });
  const std::int64_t now_us = bus::MonotonicUs();
  OnTick(now_us);
  if (connections_ == 0 && now_us - start_us_ > kFirstDeviceS * 1000000LL) {
    throw UserError(
        fmt::format("no device: none found at {} for {} seconds; connect the bench device or "
                    "start torquer-emulator, and check --source and --device",
                    source_->place(), kFirstDeviceS));
  }
}

void Daemon::End(const std::exception* error) {
  if (error != nullptr) {
    health_.Change("stopping", error->what(), Counters());
    service_manager_.Status(error->what());
    return;
  }
  service_manager_.Stopping();
  Announce("stopping", "asked to stop");
}

void Daemon::Stop() {
  stop_ = true;
  source_->Interrupt();
}

void Daemon::Home() {
  home_ = true;
  source_->Interrupt();
}

void Daemon::OnEvent(const device::SourceEvent& event) {
  switch (event.kind) {
    case device::SourceEvent::Kind::kConnected:
      OnConnected(event);
      break;
    case device::SourceEvent::Kind::kReport:
      OnReport(event);
      break;
    case device::SourceEvent::Kind::kDisconnected:
      OnDisconnected(event);
      break;
    case device::SourceEvent::Kind::kTrouble:
      OnTrouble(event.text);
      break;
  }
}

// An unusable device stops a daemon that is starting. A running daemon waits until the device is
// usable.
void Daemon::OnConnected(const device::SourceEvent& event) {
  try {
    Take(event);
  } catch (const UserError& error) {
    if (connections_ == 0) throw;
    OnTrouble(error.what());
    source_->LetGo("was let go");
  }
}

void Daemon::OnTrouble(const std::string& text) {
  if (text == trouble_) return;
  trouble_ = text;
  Announce("waiting for device", fmt::format("{}; trying again once a second", text));
}

void Daemon::Take(const device::SourceEvent& event) {
  device::DeviceIdentity identity;
  try {
    identity = device::ReadIdentity(*source_);
    const std::string& serial = identity.serial;
    if (options_.calibration_by_serial && serial != device_) TakeCalibrationOf(serial);
    if (options_.calibration) {
      calibration::RequireDevice(*options_.calibration, options_.calibration_path, serial);
      CheckSensor(identity);
      CheckResolution();
    }
  } catch (const device::DeviceGone&) {
    return;  // the source reports it and tries again
  } catch (const device::FeatureError& error) {
    throw UserError(
        fmt::format("{}: the device does not report its firmware version ({}); its firmware is "
                    "missing or not Torquer's; {}",
                    event.text, error.what(), device::kFlashRemedy));
  }
  const std::string& serial = identity.serial;
  // A replugged device has another address, so it needs a new claim.
  std::string claimed = event.text + " " + serial;
  if (claimed != claimed_) {
    device_claim_.reset();
    device_claim_.emplace(DeviceClaimName(claimed),
                          bus::ClaimWords{.what = fmt::format("the device '{}'", serial)});
    claimed_ = std::move(claimed);
  }
  if (serial != device_) {
    pipeline_->ForgetMark();
    device_ = serial;
    health_.SetDevice(serial);
  }
  connected_ = true;
  trouble_.clear();
  silent_ = false;
  last_report_us_ = bus::MonotonicUs();
  pipeline_->OnConnected();
  sensor_image_.OnConnected(serial);
  ++connections_;
  const bool idle =
      identity.has_second_sensor && source_->sensor() == 1 && !options_.second_sensor_used;
  Announce("running", connections_ == 1
                          ? fmt::format("reading device {} at {}{}", serial, event.text,
                                        idle ? "; its second sensor drives no instrument here "
                                               "(--second-instrument)"
                                             : "")
                          : fmt::format("device {} is connected again; continuing from {}; the "
                                        "motion of the hand in between is unknown",
                                        serial, Describe(pipeline_->Hold().pose)));
}

void Daemon::TakeCalibrationOf(const std::string& serial) {
  options_.calibration_path = calibration::CalibrationPath(serial);
  options_.calibration = calibration::ReadCalibration(options_.calibration_path);
  pipeline_.emplace(HandTracker(options_.calibration, pipeline_->Hold().pose));
}

// A sensor that has just got power does not answer yet.
void Daemon::CheckSensor(const device::DeviceIdentity& identity) {
  calibration::RequireSensor(*options_.calibration, options_.calibration_path,
                             identity.sensor_product_id);
  sensor_checked_ =
      identity.sensor_product_id.has_value() || !options_.calibration->sensor_product_id;
}

// Before the first motion of a sensor that did not answer when the device was connected. False if
// the device cannot be used.
bool Daemon::CheckSensorOnceItAnswers(const device::SourceEvent& event) {
  protocol::InputReport report{};
  if (event.report.size() != sizeof report) return true;  // the decoder counts it
  std::memcpy(&report, event.report.data(), sizeof report);
  if ((report.flags & protocol::kFlagSensorFault) != 0) return true;
  try {
    CheckSensor(device::ReadIdentity(*source_));
    return true;
  } catch (const UserError& error) {
    if (connections_ == 1) throw;
    OnTrouble(error.what());
    source_->LetGo("was let go");
    return false;
  } catch (const device::FeatureError&) {
    return false;  // asked again with the next report
  }
}

// Sets the device to the sensor resolution for which the calibration's gains hold.
void Daemon::CheckResolution() {
  const int wanted = options_.calibration->motion.cpi;
  const auto ask = [this] {
    protocol::ConfigurationReport configuration{};
    const std::vector<std::uint8_t> answer = source_->GetFeature(protocol::kConfigurationReportId);
    if (answer.size() != sizeof configuration)
      throw device::FeatureError("incomplete configuration");
    std::memcpy(&configuration, answer.data(), sizeof configuration);
    return configuration;
  };
  const protocol::ConfigurationReport found = ask();
  if (found.cpi == wanted) return;
  bool taken = false;
  try {
    protocol::ConfigurationReport asked = found;
    asked.cpi = static_cast<std::uint16_t>(wanted);
    source_->SetFeature({reinterpret_cast<const std::uint8_t*>(&asked), sizeof asked});
    taken = ask().cpi == wanted;
  } catch (const device::DeviceGone&) {
    throw;
  } catch (const device::FeatureError&) {
    taken = false;  // reported below, with both values
  }
  if (!taken) {
    throw UserError(fmt::format(
        "{}: motion.cpi = {}, but the device's sensor is set to {} and cannot be changed; "
        "take a new calibration with torquer-calibrate",
        options_.calibration_path, wanted, found.cpi));
  }
}

void Daemon::OnReport(const device::SourceEvent& event) {
  if (!sensor_checked_ && !CheckSensorOnceItAnswers(event)) return;
  const std::optional<PipelineOutput> output = pipeline_->OnReport(event.report, event.host_us);
  if (!output) return;
  last_report_us_ = event.host_us;
  PublishCommand(output->hand, output->origin_us);
  statistics_.AddLatency(bus::MonotonicUs() - event.host_us);
  PublishSample(*output);
  if (options_.observe) options_.observe(device_, *output);
  if (silent_) {
    silent_ = false;
    Announce("running", "reports arrive again");
  }
  if (output->sample.epoch_start == device::EpochStart::kJump) {
    Announce(
        "running",
        fmt::format("the device's counts jumped faster than a hand can move; continuing from {}",
                    Describe(output->hand.pose)));
  } else if (output->sample.epoch_start == device::EpochStart::kReset) {
    sensor_image_.OnReset();
    Announce("running", fmt::format("the device was reset; continuing from {}; the motion of the "
                                    "hand in between is unknown",
                                    Describe(output->hand.pose)));
  }
  if (output->hand.mark) AnnounceMark(*output->hand.mark);
  sensor_image_.OnReport(output->sample.flags);
  AnnounceFlags(output->hand.flags, event.host_us);
}

void Daemon::OnDisconnected(const device::SourceEvent& event) {
  if (!connected_) return;
  connected_ = false;
  silent_ = false;
  ++disconnections_;
  PublishHold(event.host_us);
  Announce("waiting for device",
           fmt::format("{}; holding {}", event.text, Describe(pipeline_->Hold().pose)));
}

void Daemon::OnTick(std::int64_t now_us) {
  if (home_.exchange(false)) {
    pipeline_->Home();
    if (!connected_) PublishHold(now_us);
    Announce(health_.state(), "home: the present position is now zero");
  }
  if (connected_ && !silent_ && now_us - last_report_us_ > kSilentAfterUs) {
    silent_ = true;
    PublishHold(now_us);
    Announce("device silent",
             fmt::format("the device is connected but sends no reports; holding {}",
                         Describe(pipeline_->Hold().pose)));
  }
  if ((!connected_ || silent_) && connections_ > 0 && now_us - last_hold_us_ >= kHoldIntervalUs) {
    PublishHold(now_us);
  }
  if (connected_ && !silent_ && sensor_image_.due()) LoadSensorImage();
  if (health_.Due(now_us)) health_.Repeat(Counters());
  service_manager_.Alive(now_us);
}

void Daemon::Announce(const std::string& state, const std::string& message) {
  health_.Change(state, message, Counters());
  service_manager_.Status(fmt::format("{}: {}", state, message));
  // A message may contain text from the device, such as its serial number.
  const std::string line = Printable(fmt::format("torquer-daemon: {}: {}", state, message));
  if (options_.announce) {
    options_.announce(line);
  } else {
    PrintError("{}\n", line);
  }
}

// During some 0.1 s of the loading, the device sends no report.
void Daemon::LoadSensorImage() {
  try {
    const std::optional<std::string> message = sensor_image_.Load(*source_);
    if (message) Announce(health_.state(), *message);
  } catch (const device::DeviceGone&) {
    return;  // the source reports it
  }
  last_report_us_ = bus::MonotonicUs();
}

void Daemon::AnnounceMark(const MarkPassage& mark) {
  if (mark.first) {
    Announce(health_.state(), "the end switch closed; from now on it detects lost motion");
  } else if (mark.refused) {
    Announce(health_.state(),
             fmt::format("the end switch closed {:.1f} mm from its previous position, which is "
                         "more than the device's travel; no motion is corrected, and this "
                         "position of the switch is the new reference",
                         std::abs(mark.lost_mm)));
  } else if (mark.lost_mm != 0.0) {
    Announce(health_.state(),
             fmt::format(
                 "the end switch shows that {:.1f} mm {} were lost; the instrument now catches up",
                 std::abs(mark.lost_mm), mark.lost_mm > 0 ? "of pushing" : "of pulling back"));
  }
}

// Every command carries the flags, which can change with every report. At most ten changes a second
// are announced.
void Daemon::AnnounceFlags(std::int32_t flags, std::int64_t now_us) {
  flags &= protocol::kCommandLift | protocol::kCommandSensorFault;
  if (flags == announced_flags_ || now_us - last_flags_us_ < kFlagsIntervalUs) return;
  announced_flags_ = flags;
  last_flags_us_ = now_us;
  if ((flags & protocol::kCommandSensorFault) != 0) {
    Announce("sensor fault", "the sensor does not answer correctly; motion is held");
  } else if ((flags & protocol::kCommandLift) != 0) {
    Announce("sensor lifted", "the sensor is lifted or tracks the surface poorly; motion is held");
  } else {
    Announce("running", "the sensor works again");
  }
}

void Daemon::PublishSample(const PipelineOutput& output) {
  const device::Sample& sample = output.sample;
  torquer_lcm::device_sample_t message;
  message.device = device_;
  message.instrument = options_.instrument;
  message.clock_id = bus::ClockId();
  message.receive_us = sample.receive_us;
  message.origin_us = output.origin_us;
  message.device_time_us = sample.device_time_us;
  message.report_number = sample.report_number;
  message.axial_counts = sample.axial_counts;
  message.transverse_counts = sample.transverse_counts;
  message.joystick_x = static_cast<std::int16_t>(sample.joystick_x);
  message.joystick_y = static_cast<std::int16_t>(sample.joystick_y);
  message.buttons = static_cast<std::int8_t>(sample.buttons);
  message.flags = static_cast<std::int8_t>(sample.flags);
  message.surface_quality = sample.surface_quality;
  message.shutter = sample.shutter;
  message.cpi = sample.cpi;
  message.boot_id = sample.boot_id;
  bus_.Publish(protocol::kDeviceSampleChannel, message);
}

void Daemon::PublishCommand(const HandState& hand, std::int64_t origin_us) {
  torquer_lcm::instrument_command_t command;
  command.instrument = options_.instrument;
  command.sequence = std::exchange(sequence_, protocol::NextSequence(sequence_));
  command.clock_id = bus::ClockId();
  command.origin_us = origin_us;
  command.publish_us = bus::MonotonicUs();
  command.insertion_mm = hand.pose.insertion_mm;
  command.rotation_rad = hand.pose.rotation_rad;
  command.lao_rad = hand.pose.lao_rad;
  command.cra_rad = hand.pose.cra_rad;
  command.xray = hand.xray;
  command.contrast = hand.contrast;
  command.flags = hand.flags;
  // Stored before publishing: after a daemon killed in between, the next one does not go back.
  instrument_claim_.Remember({hand.pose, command.sequence, bus::BoottimeUs(), command.clock_id});
  if (bus_.Publish(protocol::kInstrumentCommandChannel, command)) ++commands_published_;
  table_commands_.Publish(hand.pose.table, command.publish_us, options_.instrument, bus_);
  if (options_.show) options_.show(hand);
}

void Daemon::PublishHold(std::int64_t now_us) {
  last_hold_us_ = now_us;
  PublishCommand(pipeline_->Hold(), now_us);
}

bus::HealthCounters Daemon::Counters() const {
  const std::optional<double> drift = pipeline_->clock_map().drift();
  const device::DecoderCounters& decoder = pipeline_->decoder().counters();
  const TrackerCounters& tracker = pipeline_->tracker().counters();
  return {{"reports_received", decoder.received},
          {"reports_lost", decoder.lost},
          {"reports_duplicated", decoder.duplicated},
          {"reports_reordered", decoder.reordered},
          {"reports_wrong_length", decoder.wrong_length},
          {"reports_wrong_id", decoder.wrong_id},
          {"reports_wrong_version", decoder.wrong_version},
          {"count_jumps", decoder.jumps},
          {"connections", connections_},
          {"disconnections", disconnections_},
          {"device_resets", decoder.resets},
          {"commands_published", commands_published_},
          {"publish_failures", bus_.publish_failures()},
          {"axial_counts_applied", tracker.axial_applied},
          {"axial_counts_held", tracker.axial_held},
          {"transverse_counts_applied", tracker.transverse_applied},
          {"transverse_counts_held", tracker.transverse_held},
          {"marks_passed", tracker.marks_passed},
          {"healed_um", tracker.healed_um},
          {"sensor_images_loaded", sensor_image_.loaded()},
          {"clock_drift_ppm", drift ? std::optional(std::llround(1e6 * *drift)) : std::nullopt},
          {"clock_restarts", pipeline_->clock_map().restarts()},
          {"report_to_command_p99_us", statistics_.QuantileUs(0.99)}};
}

}  // namespace torquer::daemon
