// The bench device: chip, sensor, potentiometers, buttons and the EEPROM's contents, wired as in
// firmware/README.md. Time is virtual; the caller sets its pace.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/emulator/atmega32u4.h"
#include "host/emulator/contact.h"
#include "host/emulator/motion_script.h"
#include "host/emulator/pmw3360.h"

namespace torquer::emulator {

struct BenchOptions {
  double cylinder_radius_mm = 5.0;
  /// Height by which a hand can lift the cylinder in its bore, mm; the default is without a
  /// preload.
  double play_mm = 0.3;
  SensorImperfections sensor;
  SensorKind sensor_kind = SensorKind::kPmw3360;
  /// Position of the sensor over the cylinder, as its camera sees it.
  SurfaceOptics optics;
  std::uint32_t seed = 1;
  /// Device time at each start, us, such as just before it wraps.
  std::optional<std::uint32_t> start_time_us;
  /// Serial number to write into the EEPROM, 1 to 16 printable characters; empty: EEPROM unchanged.
  std::string serial;
  /// Insertion below which the cylinder closes the end switch, mm; none: the device has no switch.
  std::optional<double> reference_switch_mm;
  /// Longest bounce of buttons, pedal and end switch after a change.
  double contact_bounce_us = 0;
  /// Supply of the chip.
  double supply_mv = 5000;
  /// protocol::Button bits of the contacts that are closed at rest.
  std::uint8_t closed_at_rest = 0;
  /// Duration of an erase or a write of a page of the flash.
  double page_operation_us = FlashMemory::kOperationUs;
  /// The EEPROM at the first power-on; empty: blank.
  std::vector<std::uint8_t> eeprom;
};

class BenchDevice {
 public:
  static constexpr double kFrameUs = 1000;

  /// Powered on at time 0. Throws UserError for an unusable option or image.
  BenchDevice(const FirmwareImage& image, const BenchOptions& options);

  /// Sets the motion of the hand as a function of virtual time in seconds. Calls come in rising
  /// order of time, except for an occasional step back of a microsecond.
  void SetHand(std::function<HandState(double time_s)> hand) { hand_ = std::move(hand); }

  /// Virtual time since the first power-on.
  double now_us() const { return now_us_; }
  /// Lets time pass until then.
  void RunUntil(double us);

  /// Switches the supply off (flash and EEPROM keep their contents) or on.
  void PowerOff();
  void PowerOn();
  bool powered() const { return chip_ != nullptr; }
  void ResetByPin();

  /// Parts of the powered device; call only while powered.
  Atmega32u4& chip() { return *chip_; }
  UsbController& usb() { return chip_->usb(); }
  VirtualPmw3360& sensor() { return sensor_; }
  const VirtualPmw3360& sensor() const { return sensor_; }
  /// Sensor of the catheter; null on a board with one sensor.
  VirtualPmw3360* second_sensor() { return second_sensor_.get(); }
  const VirtualPmw3360* second_sensor() const { return second_sensor_.get(); }

  /// Cuts the supply during a page erase or page write. `number` counts these operations since the
  /// first power-on, from 1; 0: no cut.
  void CutPowerAtPageOperation(int number) { cut_at_page_operation_ = number; }
  int page_operations() const { return page_operations_; }
  /// Current contents of the flash.
  std::vector<std::uint8_t> Flash() const;
  /// Current contents of the EEPROM.
  std::vector<std::uint8_t> Eeprom() const;
  /// Parts that still draw current while the bus is suspended: of the chip, the sensor or the
  /// board's LEDs. Empty if all sleep. Call only while powered.
  std::vector<std::string> PartsAwake() const;
  HandState HandNow() const { return hand_(now_us_ * 1e-6); }
  double cpu_mhz() const { return cpu_mhz_; }

  /// Fraction of the CPU's cycles in which it was awake since the start, 0 .. 1.
  double CyclesUsedFraction() const;
  /// Violations of chip, USB or sensor timing, by firmware or wiring, which would be faults on real
  /// hardware.
  std::vector<std::string> Violations() const;
  std::int64_t violation_count() const;

 private:
  void ApplyHand();
  void WireSensor(VirtualPmw3360& sensor, int select_bit, bool catheter);
  std::uint8_t ExchangeSpi(const SpiExchange& exchange);

  FirmwareImage image_;
  BenchOptions options_;
  std::function<HandState(double)> hand_ = [](double) { return HandState{}; };
  VirtualPmw3360 sensor_;
  std::unique_ptr<VirtualPmw3360> second_sensor_;
  std::vector<Contact> contacts_;  // of the buttons, then the end switch
  std::unique_ptr<Atmega32u4> chip_;
  std::vector<std::uint8_t> eeprom_;  // while the power is off; the flash is in image_
  int page_operations_ = 0;
  int cut_at_page_operation_ = 0;
  bool cut_due_ = false;
  double now_us_ = 0;
  double power_on_us_ = 0;
  double cpu_mhz_ = 16;
  std::uint32_t power_ons_ = 0;
  std::uint64_t past_cycles_ = 0;  // of former power-ons
  std::uint64_t past_sleep_cycles_ = 0;
  std::vector<std::string> past_violations_;
};

}  // namespace torquer::emulator
