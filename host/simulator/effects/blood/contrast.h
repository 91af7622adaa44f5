// Contrast agent in the blood. It is injected while the button is held or by the power injector,
// and carried along the centerlines. It disperses, mixes at joints, and leaves at the ends.
//
//   node --[ cell | cell | cell | cell ]--> node     one mean concentration a cell
//            F -> F -> F ->  limited second order upwind + dispersion, conservative
//
// The injection adds to the flow. An injection larger than the incoming blood flow flows backwards.
#pragma once

#include <optional>
#include <vector>

#include "host/simulator/effects/blood/flow.h"
#include "host/simulator/effects/blood/power_injector.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

struct ContrastSettings {
  enum class Site { kEntry, kTip, kPlace };
  Site site = Site::kEntry;
  int instrument = 0;              ///< for kTip
  vessel::CenterlinePlace place;   ///< for kPlace
  double rate_mL_s = 0;            ///< while the button is held
  double concentration_mg_mL = 0;  ///< of iodine
  double dispersion_mm2_s = 0;
  double cell_mm = 2;  ///< longest length of a cell
  /// Largest total volume that the patient tolerates.
  std::optional<double> patient_limit_mL = std::nullopt;
  std::optional<InjectorSetUp> injector = std::nullopt;  ///< nullopt: there is no power injector
};

class Contrast final : public Effect, public Evolution, public Observer {
 public:
  /// `flow` and `wire` must outlive this. `wire`: the empty rod of the innermost curve. kEntry
  /// injects at its entry.
  Contrast(const Flow& flow, const ContrastSettings& settings, const WireModel& wire);

  Evolution* evolution() override { return this; }
  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Advance(const TickView& tick) override;
  void Observe(const TickView&) override {}
  std::vector<Reading> Readings() const override;

  /// Advances the dye by step_s up to time_s; injects at `tip_mm` or at the site in the settings.
  /// `injecting`: by hand.
  void Advance(double time_s, double step_s, bool injecting, const Eigen::Vector3d& tip_mm);

  /// Cells of one edge of flow().graph(), of equal length, from its node a to its node b.
  struct Cells {
    std::size_t first = 0;
    std::size_t count = 0;
    double length_mm = 0;  ///< of one cell
  };
  const std::vector<Cells>& cells() const { return cells_; }
  /// Iodine, mg/mL, of all cells of all edges.
  const std::vector<double>& concentration_mg_mL() const { return concentration_; }
  const Flow& flow() const { return flow_; }

  double injected_mg() const { return injected_mg_; }      ///< since the start
  double washed_out_mg() const { return washed_out_mg_; }  ///< since the start
  double inside_mg() const;
  /// True while no dye is in the vessels.
  bool clear() const { return clear_; }

 private:
  // Injection site.
  struct Source {
    int edge = -1;
    std::size_t cell = 0;  // of that edge
    double beyond = 0;     // fraction of the edge's resistance from its node a to the site
  };
  // Flow at the two ends of an edge, mm^3/s, positive from a to b.
  struct EndFlows {
    double at_a = 0, at_b = 0;
  };

  void PlaceSource(const vessel::CenterlinePlace& place);
  void Step(double time_s, double step_s, bool injecting);
  void FindFlows(double time_s, double injected_mL_s);
  void TakeResponses();
  void OrderEdges();
  void CarryAlong(std::size_t edge, double step_s, double inflow_mg_mL, double injected_mL_s);
  int UpstreamNode(std::size_t edge) const;
  void PourInto(int node, double mass_mg);

  const Flow& flow_;
  const ContrastSettings settings_;
  const WireModel& wire_;
  std::vector<Cells> cells_;
  std::vector<double> concentration_;    // of each cell, mg/mL
  std::vector<double> volume_;           // of each cell, mm^3
  std::vector<double> spread_mm3_s_;     // dispersion through a cell's face towards a
  std::vector<double> edge_least_mm3_;   // smallest cell
  std::vector<double> edge_spread_1_s_;  // largest dispersion rate of a cell
  std::vector<double> edge_mass_mg_;
  std::vector<std::vector<double>> per_inflow_;  // [node][edge] flow for a unit of inflow there
  int responses_version_ = -1;                   // version of the flow for per_inflow_
  std::vector<double> edge_mL_s_;
  Source source_;
  double source_age_s_ = 0;
  std::vector<EndFlows> flows_;
  std::vector<std::size_t> order_;  // of edges, in upstream-to-downstream order
  std::vector<signed char> signs_;  // flow signs for which order_ is valid
  std::vector<double> node_mass_mg_;
  std::vector<double> node_out_mm3_s_;
  std::vector<double> slope_;  // of the edge being processed
  std::vector<double> flux_;
  std::optional<PowerInjector> injector_;
  double injected_mg_ = 0;
  double washed_out_mg_ = 0;
  bool clear_ = true;
};

/// Keys of [effects.contrast], and the effect that they make (contrast_keys.cpp).
EffectKind ContrastKind();

}  // namespace torquer::effects
