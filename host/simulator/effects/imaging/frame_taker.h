// Contents of an X-ray picture, copied from the scene on the tick thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_settings.h"
#include "host/simulator/effects/imaging/lumen_painter.h"

namespace torquer::effects {

/// Points along the vessels in which the dye is painted. They stay for the life of a scene.
struct DyePoints {
  /// Points of one edge of the flow.
  struct Branch {
    std::size_t first = 0;
    std::size_t count = 0;
  };
  /// Position of a point among the cells of the contrast agent.
  struct CellPlace {
    std::size_t cell = 0;  ///< index; the next cell is used too
    float weight = 0;      ///< weight of the next cell
  };
  std::vector<LumenPoint> points;
  std::vector<CellPlace> cells;  ///< one for each point
  std::vector<Branch> branches;
};

/// Distributes points along every edge; thin lumens get dense points. None without `contrast`.
DyePoints LayDyePoints(const Contrast* contrast);

/// Contents of a picture.
struct XrayFrame {
  std::int64_t session = 0;  ///< number of restarts before it
  std::int64_t number = 0;   ///< since the start
  std::int64_t pedal = 0;    ///< number of pedal presses before it
  std::int64_t still = 0;    ///< number of pictures just before it with the same view
  double time_s = 0;
  Controls controls;
  Eigen::Vector3d organs_mm = Eigen::Vector3d::Zero();  ///< displacement of the organs
  /// Each instrument, the outermost first; a hollow one is followed by its lumen, to be
  /// subtracted.
  std::vector<std::vector<WirePoint>> shadows;
  bool has_dye = false;
  std::vector<float> dye_1_mm;           ///< at each of DyePoints
  std::vector<Eigen::Vector3f> offsets;  ///< of each of DyePoints, if the vessel moves
};

/// Things in the open part of a picture, between the shutters, that a mask should not have.
struct PictureContents {
  bool instrument = false;
  bool contrast = false;  ///< contrast agent that takes 1 % of the intensity or more
};
PictureContents ContentsOf(const XrayFrame& frame, const DyePoints& dye,
                           const FluoroscopySettings& settings);

/// Decides when a picture is due, and fills its frame.
class FrameTaker {
 public:
  /// As for Fluoroscopy. Keeps references to all but the lists.
  FrameTaker(const FluoroscopySettings& settings, const WireModel& wire, const Contrast* contrast,
             const DyePoints& dye, std::vector<const vessel::FieldMotion*> motions,
             std::vector<Instrument> instruments);

  /// Fills `frame`, which holds an old one. Returns false, and leaves it, if no picture is due.
  bool Take(const TickView& tick, XrayFrame& frame);
  /// Begins another session.
  void Restart();
  /// Continues like `twin`, the taker of the same scene.
  void CopyFrom(const FrameTaker& twin) { memory_ = twin.memory_; }

 private:
  struct Memory {
    double next_s = 0;
    bool was_down = false;
    std::int64_t pedal = 0;
    std::int64_t session = 0;
    std::int64_t number = 0;
    std::int64_t still = 0;
    View view;                             // of the last picture
    std::vector<Eigen::Vector3f> offsets;  // as in XrayFrame
  };

  bool IsDue(const TickView& tick);
  void CountStill(const Controls& controls);
  Eigen::Vector3d OrgansNow() const;
  void TakeBody(const Instrument& instrument, std::vector<WirePoint>& body) const;
  void TakeInstruments(const WireState& state, XrayFrame& frame);
  void TakeDye(XrayFrame& frame);

  const FluoroscopySettings& settings_;
  const WireModel& wire_;
  const Contrast* const contrast_;
  const DyePoints& dye_;
  const std::vector<const vessel::FieldMotion*> motions_;
  const std::vector<Instrument> instruments_;
  Memory memory_;
  std::vector<Eigen::Vector3d> nodes_;  // work space
};

}  // namespace torquer::effects
