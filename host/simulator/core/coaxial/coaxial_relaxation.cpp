#include "host/simulator/core/coaxial/coaxial_relaxation.h"

#include <algorithm>
#include <cmath>

namespace torquer {

namespace {

// What is left of a budget.
class Remainder final : public WorkBudget {
 public:
  Remainder(WorkBudget& whole, int done) : whole_(whole), done_(done) {}
  bool Allows(int done) override { return whole_.Allows(done_ + done); }

 private:
  WorkBudget& whole_;
  int done_;
};

double Part(double step, double most) { return std::clamp(step, -most, most); }

}  // namespace

CoaxialRelaxation::CoaxialRelaxation(CoaxialPair& pair, const InstrumentPlace& wire,
                                     const InstrumentPlace& catheter, const ClearanceField& field,
                                     const WallModel& wall, const NewtonSettings& settings,
                                     const std::vector<EnergyTerm*>& terms)
    : pair_(pair),
      wire_start_(wire),
      catheter_start_(catheter),
      settings_(settings),
      terms_(terms),
      rod_(pair.rod(), field, wall, settings, terms) {
  pair_.Place(wire, catheter);
}

void CoaxialRelaxation::Restart(WireState& state) {
  pair_.Place(wire_start_, catheter_start_);
  rod_.Restart(state);
}

HandTarget CoaxialRelaxation::Bounded(const HandTarget& target) const {
  HandTarget bounded = target;
  bounded.insertion_mm = std::clamp(target.insertion_mm, 0.0, pair_.wire().max_length_mm());
  bounded.catheter_insertion_mm =
      std::clamp(target.catheter_insertion_mm, 0.0, pair_.catheter().max_length_mm());
  return bounded;
}

bool CoaxialRelaxation::Arrived(const HandTarget& target) const {
  return pair_.wire_place().insertion_mm == target.insertion_mm &&
         pair_.wire_place().rotation_rad == target.rotation_rad &&
         pair_.catheter_place().insertion_mm == target.catheter_insertion_mm &&
         pair_.catheter_place().rotation_rad == target.catheter_rotation_rad;
}

// Moves both by a part of what is left.
void CoaxialRelaxation::MoveTowards(const HandTarget& target, const WireState& state) {
  InstrumentPlace wire = pair_.wire_place();
  InstrumentPlace catheter = pair_.catheter_place();
  const double wire_left = target.insertion_mm - wire.insertion_mm;
  const double catheter_left = target.catheter_insertion_mm - catheter.insertion_mm;
  const double most_mm = std::min(settings_.max_feed_mm, pair_.rod().segment_mm() / 2);
  const double longest = std::max(std::abs(wire_left), std::abs(catheter_left));
  double part = longest > most_mm ? most_mm / longest : 1;
  // Where the tips pass each other one part ends, so that they coincide when the lead changes.
  const double lead = wire.insertion_mm - catheter.insertion_mm;
  const double lead_step = part * (wire_left - catheter_left);
  const bool meet = lead != 0 && (lead + lead_step) * lead < 0;
  if (meet) part *= lead / -lead_step;
  const double reach_before = pair_.reach_mm();
  const double catheter_before = catheter.insertion_mm;
  // Exactly, at the end.
  wire.insertion_mm = part == 1 ? target.insertion_mm : wire.insertion_mm + part * wire_left;
  catheter.insertion_mm =
      part == 1 ? target.catheter_insertion_mm : catheter.insertion_mm + part * catheter_left;
  if (meet) catheter.insertion_mm = wire.insertion_mm;
  const auto turn = [this](double to_rad, InstrumentPlace& place) {
    const double left = to_rad - place.rotation_rad;
    const double most = settings_.max_turn_rad;
    place.rotation_rad = std::abs(left) <= most ? to_rad : place.rotation_rad + Part(left, most);
  };
  turn(target.rotation_rad, wire);
  turn(target.catheter_rotation_rad, catheter);
  pair_.Place(wire, catheter);
  rod_.ModelChanged();

  // Inside the catheter it is its surface that touches the wall, and that goes its own way.
  const double slide =
      (catheter.insertion_mm - catheter_before) - (pair_.reach_mm() - reach_before);
  const PointSet& points = rod_.Current().points;
  if (slide == 0 || points.size() == 0) return;
  const double bare_mm = std::max(0.0, state.ArcLength(pair_.rod()) - catheter_before);
  const int bare =
      static_cast<int>(std::ceil(bare_mm / pair_.rod().segment_mm() * points.per_segment));
  for (EnergyTerm* term : terms_) term->SlideSurface(points, points.size() - 1 - bare, slide);
}

TickReport CoaxialRelaxation::Tick(const HandTarget& target, WorkBudget& budget, WireState& state) {
  const HandTarget to = Bounded(target);
  TickReport report;
  while (true) {
    // A rod that the budget left behind catches up first.
    if (state.insertion_mm == pair_.reach_mm() &&
        state.rotation_rad == pair_.wire_place().rotation_rad && !Arrived(to)) {
      MoveTowards(to, state);
    }
    Remainder remainder(budget, report.work);
    TickReport part =
        rod_.Tick({pair_.reach_mm(), pair_.wire_place().rotation_rad}, remainder, state);
    part.actions += report.actions;
    part.work += report.work;
    part.iterations += report.iterations;
    part.updates += report.updates;
    part.snapped |= report.snapped;
    report = part;
    if (report.budget_spent || Arrived(to)) break;
  }
  report.budget_spent |= !Arrived(to);
  report.carried_mm += to.insertion_mm - pair_.wire_place().insertion_mm;
  return report;
}

}  // namespace torquer
