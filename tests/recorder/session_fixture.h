// Artificial session, written as torquer-recorder would write it; every figure is known.
#pragma once

#include <string>

#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::test {

inline constexpr double kMmPerCount = 0.02;
inline constexpr double kRadPerCount = 0.004;
inline constexpr double kInsertedAtStartMm = 5;

/// Faults that a test can inject.
struct SessionFaults {
  int lost_reports = 0;           ///< sent, but not received
  int unfetched_reports = 0;      ///< made by the device, but not fetched by the daemon
  double extra_wire_mm = 0;       ///< wire motion without hand motion
  int healed_um = 0;              ///< reported by the daemon at the end
  bool foreign_clock = false;     ///< of the simulator, as if on another machine
  bool undecodable = false;       ///< one state cut short
  bool without_emulator = false;  ///< as with a real device
  int lost_states = 0;
  bool repeated_states = false;  ///< each published again, as at rest
  bool poor_surface = false;     ///< reports 200 to 299, visible in the commands only
  bool reset = false;            ///< of the device between reports 799 and 800
  bool catheter = false;         ///< around the guidewire, driven by a second box
  bool catheter_box = true;      ///< without it nothing drives the catheter
  bool beside = false;           ///< the catheter lies on another curve, along x
  bool running_counts = false;   ///< daemon and emulator report counts during the session
  bool ended = true;             ///< the daemon reports its end
  bool course = false;           ///< data for a page: see WriteSession
  int catheter_lost_reports = 0;
  double extra_catheter_mm = 0;
};

/// Writes the log of a session to `path`. The box kBox sends 1000 reports at 1 kHz with 2 counts
/// each. The clutch is held from report 500 to 599. A state follows each report, 1 ms later for
/// each of the first 990, 5 ms for the others. Readings show 1, then 4 events of the wall force;
/// the largest is 2.5 mN per event.
///
/// With faults.course the scene has X-ray, contrast and an assessment. X-ray is on with reports 200
/// to 399 and 600 to 649, contrast with 300 to 349. Readings come 20 times, every 50 ms. They have
/// a wall force of 20 mN and a peak of 80 mN between two of them. The target is reached at 0.7 s;
/// 10 ticks do not converge.
///
/// The box kCatheterBox moves the catheter by 1 count with each report; its clutch is never held.
/// Its hand is 2 ms ahead of the guidewire's hand.
void WriteSession(const std::string& path, const SessionFaults& faults);

/// With running_counts the emulator reports its counts every 10 reports. It is then 3 reports ahead
/// of the daemon. The daemon reports every 250.
inline constexpr int kReportsAhead = 3;

/// Serial numbers and figures of the session above.
inline constexpr char kBox[] = "BOX-1";
inline constexpr char kCatheterBox[] = "BOX-2";
inline constexpr double kCatheterAtStartMm = 2;
inline constexpr int kReports = 1000;
inline constexpr int kHeldCounts = 2 * 101;
inline constexpr int kSensorCounts = 2 * (kReports - 1);

}  // namespace torquer::test
