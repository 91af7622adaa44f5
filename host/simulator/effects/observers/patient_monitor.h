// Patient monitor: ECG, and the invasive pressure at the tip of a catheter.
//
//   heart's cycle   0        systole                  1     R wave at 0, where the systole begins
//   heartbeat       moves out ... moves back, rests         the same cycle
//   flow            ejection ..... none                     the same cycle
//
// The pressure is that of the flow at the tip, relative to a transducer at the height of the heart.
// So the weight of the blood does not count. A tip that closes the lumen has the pressure behind
// it. This pressure follows with a time constant, so that the pulse is damped.
#pragma once

#include <cstdint>
#include <optional>

#include "host/simulator/effects/blood/flow.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/observers/vital_signs.h"

namespace torquer::effects {

/// The cycle of the heart.
struct HeartCycle {
  double per_minute = 0;  ///< 0: not known
  double phase = 0;       ///< fraction of a cycle at the start
  /// Cycles since the beginning of the one that the start lies in.
  double At(double time_s) const { return time_s * per_minute / 60 + phase; }
};

/// ECG at a fraction of the cycle, [0, 1): P, Q, R, S and T as Gaussian bells. The R wave is at 0
/// and has the height 1. Places, widths and proportions: McSharry et al., IEEE Trans Biomed Eng
/// 2003;50:289.
double EcgAt(double fraction);

/// The place where the pressure is measured.
struct PressureSite {
  const Flow* flow = nullptr;       ///< null: no pressure
  std::optional<int> instrument{};  ///< whose tip it is; otherwise `place`
  vessel::CenterlinePlace place{};
  double radius_mm = 0;  ///< outer radius of the catheter at `place`; 0: it closes no lumen
};

class PatientMonitor final : public Effect, public Observer {
 public:
  /// Fraction of the lumen's area from which a tip closes it.
  static constexpr double kClosingArea = 0.95;
  /// Time constant with which the pressure behind a closed lumen is reached, s.
  static constexpr double kSettlingS = 0.5;

  /// All that `context` and `site` point to must outlive this.
  PatientMonitor(const HeartCycle& heart, const PressureSite& site,
                 const VitalSigns::Limits& limits, const EffectContext& context);

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override {
    memory_ = dynamic_cast<const PatientMonitor&>(twin).memory_;
  }
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;
  const VitalSigns* Vitals() const override { return &memory_.vitals; }

 private:
  // Sums of the beat in progress.
  struct Beat {
    std::int64_t number = 0;
    bool is_whole = false;  // from its beginning
    int samples = 0;
    double sum_mmHg = 0, highest_mmHg = 0, lowest_mmHg = 0;
  };
  struct Memory {
    VitalSigns vitals;
    Beat beat;
    double site_age_s = 0;
    bool has_site = false;
    FlowPlace site;
    ClosedPressure behind;
    int behind_version = -1;   // version of the flow for `behind`
    FlowPlace behind_site;     // and its place
    double pressure_mmHg = 0;  // the shown one
  };

  int OutermostAround(int instrument, const TickView& tick) const;
  void FindSite(const TickView& tick);
  void SetSite(const vessel::CenterlinePlace& place, double radius_mm);
  void TakeSample(double time_s);
  double PressureAt(double time_s);
  void AddToBeat(double time_s, double pressure_mmHg);
  void SetAlarms();

  const HeartCycle heart_;
  const PressureSite site_;
  const std::vector<Instrument> instruments_;
  const InstrumentStack* const stack_;
  const vessel::MovingField* const moving_;
  Memory memory_;
};

EffectKind PatientMonitorKind();

}  // namespace torquer::effects
