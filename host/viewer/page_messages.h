// Messages between torquer-viewer and its page: byte layouts and texts (README.md). No I/O.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <torquer_lcm/devices_t.hpp>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/picture_t.hpp>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/vital_signs_t.hpp>
#include <torquer_lcm/wire_forces_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/observers/assessment.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/triangle_mesh.h"
#include "host/viewer/vessel_motion.h"

namespace torquer::viewer {

/// First byte of a binary message.
enum class FrameKind : std::uint8_t {
  kState = 1,
  kPicture = 2,
  kVessel = 3,
  kControls = 16,
  kReplayControls = 17,
  kImaging = 18,
  kCase = 19,
  kTable = 20,
  kInjector = 21,
  kExchange = 22
};

/// Second byte of a binary message. A change of a layout needs a new version.
inline constexpr std::uint8_t kFrameVersion = 1;

/// Time between two summaries of a session.
inline constexpr std::int64_t kSummaryUs = 100'000;

/// Message with the newest state. `forces`: optional, used if they are from the same tick.
/// Latencies are NaN if `clock_id` is another clock than the clock of the state.
std::string StateFrame(const torquer_lcm::wire_state_t& state,
                       const torquer_lcm::wire_forces_t* forces, std::int64_t clock_id);

/// `lateral`: of the second plane.
std::string PictureFrame(const torquer_lcm::picture_t& picture, bool lateral = false);

/// Message with the vessel's surface and the scene's content hash. The page shows it for that scene
/// alone.
std::string VesselFrame(const vessel::TriangleMesh& mesh, std::uint64_t content_hash,
                        const Motions& motions);

/// Message with the vessel's centerlines, the trainee's target, and the motions of both. `task` may
/// be null.
std::string LinesText(const vessel::CenterlineNetwork& centerlines,
                      const effects::AssessmentTask* task, std::uint64_t content_hash,
                      const Motions& motions);

/// Each text is a JSON object with a field `kind`. Text from the bus is Printable.
std::string SceneText(const torquer_lcm::scene_description_t& scene);
std::string HealthText(const torquer_lcm::health_t& health);
std::string ReadingsText(const torquer_lcm::readings_t& readings);
/// Devices of the instruments now, and the reason why the newest order was refused.
std::string DevicesText(const torquer_lcm::devices_t& devices);
/// Devices of the library, which instruments can become.
std::string TrayText();
/// Curves and figures of the patient monitor; at most the newest kMostVitalSamples samples.
std::string PatientText(const torquer_lcm::vital_signs_t& vitals);
inline constexpr std::size_t kMostVitalSamples = 500;

/// Controls that the page's keys request now. They are rates, not positions, so that all motion
/// stops if a page stops sending.
struct Controls {
  bool xray = false;
  bool acquisition = false;  ///< pedal of the acquisition: X-ray with its display and pulses
  bool contrast = false;
  int instrument = 0;     ///< that is moved, 0 the innermost
  double push_mm_s = 0;   ///< positive distally
  double turn_rad_s = 0;  ///< positive right-handed about the distal tangent
  double lao_rad_s = 0;   ///< C-arm, positive towards LAO
  double cra_rad_s = 0;   ///< the same, towards CRA

  /// Largest rates that are taken.
  static constexpr double kMostPushMmS = 200;
  static constexpr double kMostTurnRadS = 20;
  static constexpr double kMostArmRadS = 2;
};

/// Motion of the table that the page's keys request now. Axes as in effects::Table.
struct TableMotion {
  double left_mm_s = 0;
  double head_mm_s = 0;
  double height_mm_s = 0;

  /// Largest rate that is taken.
  static constexpr double kMostMmS = 100;
};

/// Sizes of the messages from the page, bytes.
inline constexpr std::size_t kControlsBytes = 20;
inline constexpr std::size_t kImagingBytes = 28;
inline constexpr std::size_t kInjectorBytes = 40;
inline constexpr std::size_t kExchangeBytes = 64;

/// Reads controls. Nullopt if the bytes do not have that layout, or a rate is not finite or exceeds
/// its limit.
std::optional<Controls> ReadControls(std::span<const std::uint8_t> bytes);

/// Reads a motion of the table, as ReadControls.
std::optional<TableMotion> ReadTableMotion(std::span<const std::uint8_t> bytes);

/// Display and pulses while the pedal of the acquisition is down.
struct Acquisition {
  effects::Imaging::Mode mode = effects::Imaging::Mode::kCine;  ///< kCine or kSubtraction
  double pulses_per_s = 15;  ///< effects::Imaging::kLeastPulses to kMostPulses
};

/// X-ray settings that the page has chosen, and the page's number of this choice.
struct ImagingChoice {
  effects::Imaging imaging;
  std::uint32_t number = 0;
  Acquisition acquisition = {};
};

/// Reads a choice. Nullopt if the bytes do not have that layout or a value is beyond its limits.
std::optional<ImagingChoice> ReadImaging(std::span<const std::uint8_t> bytes);

/// Reads an order to the power injector, as ReadImaging.
std::optional<effects::Injector> ReadInjector(std::span<const std::uint8_t> bytes);

/// Order of the page to exchange an instrument.
struct ExchangeChoice {
  int instrument = 0;  ///< 0: the innermost
  std::string device;  ///< of the library
};

/// Reads an order to exchange an instrument. Nullopt if the bytes do not have that layout, or the
/// name is empty or too long.
std::optional<ExchangeChoice> ReadExchange(std::span<const std::uint8_t> bytes);

/// Replay controls that the page requests.
struct ReplayControls {
  bool play = false;
  double speed = 1;            ///< kLeastSpeed to kMostSpeed
  std::optional<double> at_s;  ///< new position, from the beginning of the log; not negative
  int steps = 0;               ///< states forward from that position, negative: backward

  static constexpr double kLeastSpeed = 0.1;
  static constexpr double kMostSpeed = 10;
  static constexpr int kMostSteps = 1000;
};

/// Reads controls of a replay. Nullopt if the bytes do not have that layout or a value exceeds its
/// limits.
std::optional<ReplayControls> ReadReplayControls(std::span<const std::uint8_t> bytes);

/// Case control that the page requests.
struct CaseControl {
  enum class Action : std::uint8_t { kStart = 1, kEnd = 2, kClose = 3, kExamine = 4 };
  Action action = Action::kStart;
  std::size_t number = 0;  ///< number of the case for a start or an examination
};

/// Reads a choice of a case. Nullopt if the bytes do not have that layout.
std::optional<CaseControl> ReadCaseControl(std::span<const std::uint8_t> bytes);

}  // namespace torquer::viewer
