// A session as torquer-recorder would have written it, made up so that every figure is known.
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

/// What may be made to go wrong.
struct SessionFaults {
  int lost_reports = 0;           ///< sent, but not received
  int unfetched_reports = 0;      ///< made by the device, but not fetched by the daemon
  double extra_wire_mm = 0;       ///< that the hand did not move
  int healed_um = 0;              ///< as the daemon says, at the end
  bool foreign_clock = false;     ///< of the simulator, as if on another machine
  bool undecodable = false;       ///< one state cut short
  bool without_emulator = false;  ///< as with a real device
  int lost_states = 0;
  bool repeated_states = false;  ///< each published again, as at rest
  bool poor_surface = false;     ///< for reports 200 to 299, as the commands alone say
  bool reset = false;            ///< of the device between reports 799 and 800
  bool catheter = false;         ///< around the guidewire, driven by a second box
  bool catheter_box = true;      ///< without it nothing drives the catheter
  bool running_counts = false;   ///< daemon and emulator say their counts as the session goes
  bool ended = true;             ///< the daemon says at the end that it stops
  bool course = false;           ///< what a page shows: see WriteSession
  int catheter_lost_reports = 0;
  double extra_catheter_mm = 0;
};

/// 1000 reports of the box kBox at 1 kHz: 2 counts each; the clutch is held from report 500 to 599.
/// A state after each report, 1 ms later for each of the first 990, 5 ms for the others. Readings
/// of 1, then 4 events of the wall force, the largest 2.5 mN an event. With faults.course the scene
/// has X-ray, contrast and an assessment: X-ray is on with reports 200 to 399 and 600 to 649,
/// contrast with 300 to 349; readings come 20 times, every 50 ms, with a wall force of 20 mN and a
/// peak of 80 mN between two of them; the target is reached at 0.7 s; 10 ticks do not converge. The
/// box kCatheterBox moves the catheter by 1 count with each report, its clutch never held. Its hand
/// was there 2 ms before the guidewire's. Writes the log to `path`.
void WriteSession(const std::string& path, const SessionFaults& faults);

/// With running_counts the emulator says its own every 10 reports, when it has made 3 more than the
/// daemon has received, and the daemon every 250.
inline constexpr int kReportsAhead = 3;

/// Of the above.
inline constexpr char kBox[] = "BOX-1";
inline constexpr char kCatheterBox[] = "BOX-2";
inline constexpr double kCatheterAtStartMm = 2;
inline constexpr int kReports = 1000;
inline constexpr int kHeldCounts = 2 * 101;
inline constexpr int kSensorCounts = 2 * (kReports - 1);

}  // namespace torquer::test
