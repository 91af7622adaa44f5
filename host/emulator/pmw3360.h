// Virtual PMW3360 motion sensor on the SPI, as strict as the real part. It checks the timing and
// the order of every access against the data sheet, and reports violations. It starts with the
// part's reset values, has rest modes, and can reset itself.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "host/emulator/atmega32u4.h"
#include "host/emulator/pmw3360_navigation.h"
#include "host/emulator/surface_picture.h"

namespace torquer::emulator {

/// The two are driven alike, except for their ids and the register of the resolution.
enum class SensorKind { kPmw3360, kPmw3389 };

class VirtualPmw3360 {
 public:
  enum class Fault {
    kNone,
    kSilent,   ///< MISO stays high
    kShorted,  ///< MISO stays low
    kForeign,  ///< answers with another product id
    kFrozen    ///< answers, but takes no frames
  };

  using Position = SurfacePosition;

  /// Longest time between two bytes of a long burst that is still no pause, us. The data sheet has
  /// no maximum; drivers that are known to work leave 15 to 25 us.
  static constexpr double kLongestBurstGap_us = 100;

  VirtualPmw3360(const SensorImperfections& imperfections, std::uint32_t seed);

  /// Sets the function that gives the position of the surface; `now_us` is the time since power-on.
  void SetSurface(std::function<Position(double now_us)> surface);
  /// Sets how the sensor sits above the surface and how clean it is.
  void SetOptics(const SurfaceOptics& optics) { optics_ = optics; }

  /// Chooses the part; holds from the next power-up on.
  void SetKind(SensorKind kind) { kind_ = kind; }

  /// --- pins ----------------------------------------------------------------------------------
  void SetSelected(bool selected, double now_us);
  bool selected() const { return selected_; }
  std::uint8_t Exchange(const SpiExchange& exchange);

  /// --- what may happen to it -----------------------------------------------------------------
  /// Sets all registers to their values at power-up. The sensor answers after 50 ms.
  void PowerUp(double now_us);
  /// Spontaneous reset: until it has booted, the sensor answers with its reset values. Motion and
  /// Observation come after `boot_us`; negative: 2 to 50 ms, random.
  void ResetItself(double now_us, double boot_us = -1);
  void SetLifted(bool lifted) { lifted_ = lifted; }
  void SetFault(Fault fault) { fault_ = fault; }
  /// The only firmware image that the sensor accepts; empty: any image of the right length.
  void ExpectSrom(std::vector<std::uint8_t> image) { expected_srom_ = std::move(image); }

  /// Counts that the firmware has read since the first power-up while the sensor was set up. Stray
  /// counts were read while it was not: after a reset, at its default resolution.
  std::int64_t axial_counts() const { return axial_counts_; }
  std::int64_t transverse_counts() const { return transverse_counts_; }
  std::int64_t stray_counts() const { return stray_counts_; }
  /// Motion that was lost while the sensor slept, mm.
  double lost_mm() const { return navigation_.lost_mm(); }
  /// True if the firmware has read motion since the last power-up.
  bool counting() const { return set_up_; }
  /// True if the firmware has sent the sensor to sleep, with negligible current.
  bool asleep() const { return asleep_; }
  int cpi() const;
  SensorNavigation::Mode mode() const { return navigation_.mode(); }
  /// Number of spontaneous resets.
  int self_resets() const { return self_resets_; }
  /// The firmware image that it runs; empty: its ROM.
  const std::vector<std::uint8_t>& srom() const { return srom_; }
  /// Longest time between two bytes of a long burst so far, us.
  double longest_burst_gap_us() const { return longest_burst_gap_us_; }

  /// Violations of the data sheet: their number, and the first ones in words.
  std::int64_t violation_count() const { return violation_count_; }
  const std::vector<std::string>& violations() const { return violations_; }

 private:
  static constexpr std::uint8_t kConfig1 = 0x0f;
  enum class Access { kNone, kRead, kWrite, kBurst, kSromLoad, kRawData };
  enum class Capture { kNone, kAsked, kTaken, kDone };  // of a raw picture
  enum class SromLoad { kNone, kPrepared, kEnabled, kLoaded };

  void Reset(double now_us);
  void Begin(const SpiExchange& exchange);
  void BeginRead(const SpiExchange& exchange);
  void BeginWrite();
  std::uint8_t ReadByte(const SpiExchange& exchange);
  void Require(double actual_us, double minimum_us, const char* timing);
  void RequireSteady(double gap_us, const char* burst);
  void Violation(const std::string& what);
  void Latch(double now_us);
  void WriteRegister(std::uint8_t address, std::uint8_t value, double now_us);
  void WriteFrameCapture(std::uint8_t value, double now_us);
  void WriteSromEnable(std::uint8_t value, double now_us);
  void FinishSrom();
  void TakePicture(double now_us);
  void FollowSelfResets(double now_us);
  bool rest_enabled() const;
  bool blind() const;
  std::uint8_t Observation(double now_us);
  void ClearObservation(double now_us);
  std::uint8_t OperationMode() const;
  SensorNavigation::Settings NavigationSettings() const;

  SensorImperfections imperfections_;
  SensorKind kind_ = SensorKind::kPmw3360;
  std::uint32_t seed_;
  std::mt19937 random_;
  SensorNavigation navigation_;
  std::function<Position(double)> surface_;
  SurfaceOptics optics_;
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

  // Resets: time of the last one, the setup since then, and its detection by the firmware.
  double reset_us_ = 0;
  double observation_cleared_us_ = 0;
  bool observed_ = false;  // a frame, since
  bool set_up_ = false;
  bool configured_ = false;  // the resolution was written
  bool unnoticed_reset_ = false;
  double next_self_reset_us_ = std::numeric_limits<double>::infinity();
  int self_resets_ = 0;

  // Firmware images and pictures.
  SromLoad srom_load_ = SromLoad::kNone;
  double srom_step_us_ = 0;
  std::vector<std::uint8_t> incoming_srom_, srom_, expected_srom_;
  Capture capture_ = Capture::kNone;
  double capture_us_ = 0;
  SurfacePicture picture_{};
  double longest_burst_gap_us_ = 0;

  std::int64_t axial_counts_ = 0;
  std::int64_t transverse_counts_ = 0;
  std::int64_t stray_counts_ = 0;
  std::int64_t violation_count_ = 0;
  std::vector<std::string> violations_;
};

}  // namespace torquer::emulator
