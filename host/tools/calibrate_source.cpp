#include "host/tools/calibrate_source.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <functional>
#include <optional>
#include <utility>

#include "host/bus/clock.h"
#include "host/device/device_identity.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::tools {
namespace {

using calibration::Key;
using calibration::Reading;
using calibration::Step;

constexpr std::int64_t kFirstDeviceUs = 5000000;

// Surface quality (features / 8) below which the daemon holds motion as well.
constexpr int kPoorSurface = 10;

// A script marks a position once the hand has moved by kMovedCounts and rested for kRestedUs.
constexpr double kMovedCounts = 100.0;
constexpr std::int64_t kRestedUs = 300000;
// Timeouts for the hand (by the device's clock) and for the device (by the host's clock).
constexpr std::int64_t kIdleUs = 60000000;
constexpr std::int64_t kGoneUs = 60000000;

const char* StepName(Step step) {
  switch (step) {
    case Step::kRest:
      return "rest";
    case Step::kRaised:
      return "raised";
    case Step::kPushes:
      return "pushes";
    case Step::kTurns:
      return "turns";
    case Step::kJoystick:
      return "joystick";
    case Step::kDone:
      break;
  }
  return "done";
}

Reading ReadingOf(const device::Sample& sample) {
  Reading reading;
  reading.time_us = sample.device_time_us;
  reading.axial_counts = sample.axial_counts;
  reading.transverse_counts = sample.transverse_counts;
  reading.joystick_x = sample.joystick_x;
  reading.joystick_y = sample.joystick_y;
  reading.surface_quality = sample.surface_quality;
  reading.lifted =
      (sample.flags & protocol::kFlagLift) != 0 || sample.surface_quality < kPoorSurface;
  reading.faulty = (sample.flags & protocol::kFlagSensorFault) != 0;
  reading.interrupted = sample.epoch_start != device::EpochStart::kNone;
  reading.button = (sample.buttons & protocol::kButtonXray) != 0;
  return reading;
}

[[noreturn]] void ScriptTooShort(const Script& script, const ReadingSink& sink) {
  throw UserError(fmt::format("{}: the script ended in the step '{}'; add what is missing there",
                              script.path, StepName(sink.step())));
}

}  // namespace

// --- a device ------------------------------------------------------------------------------------

DeviceReadings::DeviceReadings(std::unique_ptr<device::ReportSource> source, bool ordinary_mouse,
                               bool has_joystick)
    : source_(std::move(source)) {
  facts_.ordinary_mouse = ordinary_mouse;
  facts_.has_joystick = has_joystick;
}

DeviceFacts DeviceReadings::Connect() {
  const std::int64_t start_us = bus::MonotonicUs();
  std::optional<int> cpi;
  while (!cpi) {
    source_->Wait(50, [&](const device::SourceEvent& event) {
      if (event.kind == device::SourceEvent::Kind::kConnected) {
        decoder_.OnConnected();
        CheckIdentity(event.text);
      } else if (event.kind == device::SourceEvent::Kind::kReport && !facts_.serial.empty()) {
        const auto sample = decoder_.Decode(event.report, event.host_us);
        if (!sample) return;
        early_.push_back(ReadingOf(*sample));
        if (sample->cpi > 0) cpi = sample->cpi;
      }
    });
    if (!cpi && bus::MonotonicUs() - start_us > kFirstDeviceUs) {
      throw UserError(
          fmt::format("no device: none found at {} for 5 seconds; connect the bench device or "
                      "start torquer-emulator, and check --source and --device",
                      source_->place()));
    }
  }
  facts_.cpi = *cpi;
  return facts_;
}

void DeviceReadings::CheckIdentity(const std::string& place) {
  device::DeviceIdentity identity;
  try {
    identity = device::ReadIdentity(*source_);
  } catch (const device::DeviceGone&) {
    return;  // the source reports it and retries
  } catch (const device::FeatureError& error) {
    throw UserError(fmt::format("{}: the device does not report its identity ({}); {}", place,
                                error.what(), device::kFlashRemedy));
  }
  const std::string& serial = identity.serial;
  if (serial.empty()) {
    throw UserError(
        fmt::format("{}: the device has no serial number, which a calibration needs; {}", place,
                    device::kFlashRemedy));
  }
  if (!facts_.serial.empty() && serial != facts_.serial) {
    throw UserError(fmt::format(
        "the device '{}' was replaced by '{}'; start again with the device to calibrate",
        facts_.serial, serial));
  }
  facts_.serial = serial;
  // A sensor that is still starting has no id yet.
  if (identity.sensor_product_id) facts_.sensor_product_id = identity.sensor_product_id;
}

void DeviceReadings::Wait(int timeout_ms, ReadingSink& sink) {
  for (const Reading& reading : std::exchange(early_, {})) sink.Take(reading);
  source_->Wait(timeout_ms, [&](const device::SourceEvent& event) {
    switch (event.kind) {
      case device::SourceEvent::Kind::kConnected:
        decoder_.OnConnected();
        CheckIdentity(event.text);
        sink.Inform("the device is connected again");
        return;
      case device::SourceEvent::Kind::kDisconnected:
        sink.Inform(event.text + "; waiting for it");
        return;
      case device::SourceEvent::Kind::kTrouble:
        sink.Inform(event.text + "; trying again");
        return;
      case device::SourceEvent::Kind::kReport:
        break;
    }
    const auto sample = decoder_.Decode(event.report, event.host_us);
    if (!sample) return;
    if (sample->cpi != facts_.cpi) {
      throw UserError(fmt::format(
          "the sensor's resolution changed from {} to {} cpi; stop the program that sets "
          "it, and start again",
          facts_.cpi, sample->cpi));
    }
    sink.Take(ReadingOf(*sample));
  });
}

// --- a device, and a script for its operator -----------------------------------------------------

// Forwards readings, and passes each to the script.
class PacedOperator::Watcher : public ReadingSink {
 public:
  Watcher(PacedOperator& script, ReadingSink& sink) : operator_(script), sink_(sink) {}
  void Take(const Reading& reading) override {
    sink_.Take(reading);
    operator_.Follow(reading, sink_);
  }
  void Press(Key key) override { sink_.Press(key); }
  void Quit() override { sink_.Quit(); }
  void Inform(const std::string& text) override { sink_.Inform(text); }
  Step step() const override { return sink_.step(); }

 private:
  PacedOperator& operator_;
  ReadingSink& sink_;
};

PacedOperator::PacedOperator(std::unique_ptr<ReadingSource> device, Script script)
    : device_(std::move(device)), script_(std::move(script)) {
  for (const Statement& statement : script_.statements) {
    if (statement.kind > Statement::Kind::kQuit) {
      throw UserError(
          fmt::format("{}:{}: a script cannot move the device of --source; remove this line, or "
                      "run without --source",
                      script_.path, statement.line));
    }
  }
}

void PacedOperator::Wait(int timeout_ms, ReadingSink& sink) {
  const std::int64_t now_us = bus::MonotonicUs();
  if (last_reading_us_ == 0) last_reading_us_ = now_us;
  if (now_us - last_reading_us_ > kGoneUs) {
    throw UserError("the device has sent nothing for a minute; check its cable");
  }
  Watcher watcher(*this, sink);
  device_->Wait(timeout_ms, watcher);
}

void PacedOperator::Follow(const Reading& reading, ReadingSink& sink) {
  last_reading_us_ = bus::MonotonicUs();
  const auto apart = [&](std::int64_t axial, std::int64_t transverse) {
    return std::hypot(static_cast<double>(reading.axial_counts - axial),
                      static_cast<double>(reading.transverse_counts - transverse));
  };
  const bool stick_moved = std::abs(reading.joystick_x - rest_.joystick_x) > 10.0 ||
                           std::abs(reading.joystick_y - rest_.joystick_y) > 10.0;
  constexpr double kTremble = 8.0;
  if (!any_ || reading.interrupted || reading.lifted != rest_.lifted || stick_moved ||
      apart(rest_.axial_counts, rest_.transverse_counts) > kTremble) {
    any_ = true;
    rest_ = reading;
  }
  const std::int64_t rested_us = reading.time_us - rest_.time_us;
  if (rested_us > kIdleUs) ScriptTooShort(script_, sink);
  if (next_ == script_.statements.size()) return;
  const Statement& statement = script_.statements[next_];
  switch (statement.kind) {
    case Statement::Kind::kMark: {
      const Step step = sink.step();
      const bool strokes = step == Step::kPushes || step == Step::kRaised || step == Step::kTurns;
      if (!strokes || rested_us < kRestedUs) return;
      const bool moved = apart(marked_axial_, marked_transverse_) > kMovedCounts;
      if (step == marked_step_ && !moved) return;
      marked_axial_ = reading.axial_counts;
      marked_transverse_ = reading.transverse_counts;
      marked_step_ = step;
      sink.Press(Key::kMark);
      break;
    }
    case Statement::Kind::kUndo:
      if (rested_us < 3 * kRestedUs) return;  // by then the previous mark has been taken
      sink.Press(Key::kUndo);
      marked_step_ = Step::kRest;  // the next mark is a first one
      break;
    case Statement::Kind::kSkip:
      if (statement.word != StepName(sink.step())) return;
      sink.Press(Key::kSkip);
      break;
    default:
      sink.Quit();
      break;
  }
  ++next_;
}

// --- a script alone ------------------------------------------------------------------------------

ScriptedDevice::ScriptedDevice(Script script) : script_(std::move(script)) {
  reading_.surface_quality = 120;
}

DeviceFacts ScriptedDevice::Connect() {
  if (script_.statements.empty() || script_.statements.front().kind != Statement::Kind::kDevice) {
    throw UserError(
        fmt::format("{}: without --source a script begins with the statement 'device SERIAL CPI'",
                    script_.path));
  }
  const Statement& device = script_.statements[next_++];
  return {.serial = device.word, .cpi = static_cast<int>(device.numbers[0])};
}

void ScriptedDevice::Wait(int /*timeout_ms*/, ReadingSink& sink) {
  if (next_ == script_.statements.size()) ScriptTooShort(script_, sink);
  Play(script_.statements[next_++], sink);
}

void ScriptedDevice::Play(const Statement& statement, ReadingSink& sink) {
  constexpr std::int64_t kIntervalUs = 1000;
  const auto play = [&](double seconds, const std::function<void(double)>& at) {
    const auto steps = std::llround(1e6 * seconds / kIntervalUs);
    for (std::int64_t i = 1; i <= steps && sink.step() != Step::kDone; ++i) {
      at(static_cast<double>(i) / static_cast<double>(steps));
      reading_.time_us += kIntervalUs;
      reading_.axial_counts = std::llround(axial_);
      reading_.transverse_counts = std::llround(transverse_);
      sink.Take(reading_);
      reading_.interrupted = false;
    }
  };
  const auto nothing = [](double) {};
  const std::vector<double>& numbers = statement.numbers;
  switch (statement.kind) {
    case Statement::Kind::kMark:
      return sink.Press(Key::kMark);
    case Statement::Kind::kUndo:
      return sink.Press(Key::kUndo);
    case Statement::Kind::kSkip:
      if (statement.word != StepName(sink.step())) {
        throw UserError(fmt::format("{}:{}: 'skip {}' in the step '{}'; skip each step in its turn",
                                    script_.path, statement.line, statement.word,
                                    StepName(sink.step())));
      }
      return sink.Press(Key::kSkip);
    case Statement::Kind::kQuit:
      return sink.Quit();
    case Statement::Kind::kDevice:
      throw UserError(fmt::format("{}:{}: a script has one device, named once at its beginning",
                                  script_.path, statement.line));
    case Statement::Kind::kRest:
      return play(numbers[0], nothing);
    case Statement::Kind::kMove: {
      const double axial = axial_;
      const double transverse = transverse_;
      return play(numbers[2], [&](double share) {
        axial_ = axial + share * numbers[0];
        transverse_ = transverse + share * numbers[1];
      });
    }
    case Statement::Kind::kLift:
      reading_.lifted = true;
      play(numbers[0], nothing);
      reading_.lifted = false;
      return;
    case Statement::Kind::kFault:
      reading_.faulty = true;
      play(numbers[0], nothing);
      reading_.faulty = false;
      return;
    case Statement::Kind::kJoystick:
      reading_.joystick_x = numbers[0];
      reading_.joystick_y = numbers[1];
      return play(numbers[2], nothing);
    case Statement::Kind::kReset:
      reading_.interrupted = true;
      return;
  }
}

}  // namespace torquer::tools
