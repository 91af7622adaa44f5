// A virtual PMW3360 motion sensor on the SPI. It checks the timing of every access against the data
// sheet: a firmware that works here by luck alone is told so.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "host/emulator/atmega32u4.h"

namespace torquer::emulator {

/// How this sensor differs from an ideal one, glued on straight.
struct SensorImperfections {
  double misalignment_rad = 0;  ///< of its axes, right-handed as seen from outside the cylinder
  double scale = 1;             ///< counts seen over counts nominal
  double noise_counts = 0;      ///< standard deviation of what each moving reading adds, an axis
};

class VirtualPmw3360 {
 public:
  enum class Fault {
    kNone,
    kSilent,   ///< MISO stays high
    kShorted,  ///< MISO stays low
    kForeign   ///< answers with another product id
  };

  /// Surface position under the sensor.
  struct Position {
    double axial_mm = 0;       ///< positive distally
    double transverse_mm = 0;  ///< along the circumference, positive right-handed
  };

  VirtualPmw3360(const SensorImperfections& imperfections, std::uint32_t seed);

  /// Asked at the moment that the firmware latches a reading; `now_us` since power-on.
  void SetSurface(std::function<Position(double now_us)> surface) { surface_ = std::move(surface); }

  /// --- pins ----------------------------------------------------------------------------------
  void SetSelected(bool selected, double now_us);
  std::uint8_t Exchange(const SpiExchange& exchange);

  /// --- what may happen to it -----------------------------------------------------------------
  void PowerUp(double now_us);  ///< also a dip of its supply: all registers as at power-up
  void SetLifted(bool lifted) { lifted_ = lifted; }
  void SetFault(Fault fault) { fault_ = fault; }

  /// Counts handed out since the first power-up, whatever the firmware made of them.
  std::int64_t axial_counts() const { return axial_counts_; }
  std::int64_t transverse_counts() const { return transverse_counts_; }
  /// The firmware has begun to read motion since the last power-up.
  bool counting() const { return based_; }
  /// Sent to sleep by the firmware, and drawing no current to speak of.
  bool asleep() const { return asleep_; }
  int cpi() const { return (registers_[kConfig1] + 1) * 100; }

  /// Accesses outside the timing of the data sheet: how many, and the first of them in words.
  std::int64_t violation_count() const { return violation_count_; }
  const std::vector<std::string>& violations() const { return violations_; }

 private:
  static constexpr std::uint8_t kConfig1 = 0x0f;
  enum class Access { kNone, kRead, kWrite, kBurst, kSromLoad };

  void Begin(const SpiExchange& exchange);
  void Require(double actual_us, double minimum_us, const char* timing);
  void Violation(const std::string& what);
  void LatchBurst(double now_us);
  void WriteRegister(std::uint8_t address, std::uint8_t value, double now_us);

  SensorImperfections imperfections_;
  std::mt19937 random_;
  std::function<Position(double)> surface_;
  std::array<std::uint8_t, 128> registers_{};
  bool selected_ = false;
  bool lifted_ = false;
  bool asleep_ = false;
  Fault fault_ = Fault::kNone;

  // The access under way.
  Access access_ = Access::kNone;
  std::uint8_t address_ = 0;
  int byte_index_ = 0;  // 0: the address comes next
  std::array<std::uint8_t, 12> burst_{};

  // The accesses before it.
  double select_us_ = 0;
  double deselect_us_ = -1e9;
  double last_byte_end_us_ = -1e9;
  double write_end_us_ = -1e9;
  double read_end_us_ = -1e9;
  double usable_from_us_ = 0;
  bool burst_armed_ = false;
  Access last_access_ = Access::kNone;
  int srom_bytes_ = 0;

  // Motion: what has been counted, in fractions of a count along the sensor's axes.
  bool based_ = false;
  Position last_;
  double pending_x_ = 0;
  double pending_y_ = 0;
  std::int64_t axial_counts_ = 0;
  std::int64_t transverse_counts_ = 0;

  std::int64_t violation_count_ = 0;
  std::vector<std::string> violations_;
};

}  // namespace torquer::emulator
