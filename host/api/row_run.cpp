#include "host/api/row_run.h"

#include <algorithm>

#include "host/api/script_ticks.h"
#include "host/support/angles.h"

namespace torquer {

namespace {

simulator::Command ToTick(const Command& row) {
  simulator::Command tick;
  tick.target = InstrumentPoses(static_cast<int>(row.hands.size()));
  for (int k = 0; k < tick.target.size(); ++k) {
    const Hand& hand = row.hands[static_cast<std::size_t>(k)];
    tick.target[k] = {hand.insertion_mm, hand.rotation_rad};
  }
  tick.time_s = row.time_s;
  tick.controls = ToControls(row);
  return tick;
}

}  // namespace

effects::Imaging ToEffects(const Imaging& imaging) {
  using Mode = effects::Imaging::Mode;
  static_assert(static_cast<int>(Mode::kPlain) == static_cast<int>(Imaging::Mode::kPlain));
  static_assert(static_cast<int>(Mode::kCine) == static_cast<int>(Imaging::Mode::kCine));
  return {.mode = static_cast<Mode>(imaging.mode),
          .pulses_per_s = imaging.pulses_per_s,
          .magnification = imaging.magnification,
          .left = imaging.left,
          .right = imaging.right,
          .top = imaging.top,
          .bottom = imaging.bottom,
          .wedges = {{{imaging.wedge_left.share, imaging.wedge_left.rotation_deg},
                      {imaging.wedge_right.share, imaging.wedge_right.rotation_deg}}}};
}

Imaging FromEffects(const effects::Imaging& imaging) {
  return {.mode = static_cast<Imaging::Mode>(imaging.mode),
          .pulses_per_s = imaging.pulses_per_s,
          .magnification = imaging.magnification,
          .left = imaging.left,
          .right = imaging.right,
          .top = imaging.top,
          .bottom = imaging.bottom,
          .wedge_left = {imaging.wedges[0].share, imaging.wedges[0].rotation_deg},
          .wedge_right = {imaging.wedges[1].share, imaging.wedges[1].rotation_deg}};
}

effects::Injector ToEffects(const Injector& injector) {
  using Order = effects::Injector::Order;
  static_assert(static_cast<int>(Order::kArm) == static_cast<int>(Injector::Order::kArm));
  static_assert(static_cast<int>(Order::kInject) == static_cast<int>(Injector::Order::kInject));
  return {.order = static_cast<Order>(injector.order),
          .volume_mL = injector.volume_mL,
          .rate_mL_s = injector.rate_mL_s,
          .delay_s = injector.delay_s,
          .rise_s = injector.rise_s};
}

Injector FromEffects(const effects::Injector& injector) {
  return {.order = static_cast<Injector::Order>(injector.order),
          .volume_mL = injector.volume_mL,
          .rate_mL_s = injector.rate_mL_s,
          .delay_s = injector.delay_s,
          .rise_s = injector.rise_s};
}

effects::Table ToEffects(const Table& table) {
  return {.left_mm = table.left_mm, .head_mm = table.head_mm, .height_mm = table.height_mm};
}

Table FromEffects(const effects::Table& table) {
  return {.left_mm = table.left_mm, .head_mm = table.head_mm, .height_mm = table.height_mm};
}

effects::Controls ToControls(const Command& row) {
  return {.lao_rad = kRadPerDeg * row.lao_deg,
          .cra_rad = kRadPerDeg * row.cra_deg,
          .xray = row.xray,
          .contrast = row.contrast,
          .imaging = ToEffects(row.imaging),
          .table = ToEffects(row.table),
          .injector = ToEffects(row.injector)};
}

std::vector<InstrumentInfo> InstrumentsOf(const scene::Scene& scene) {
  const InstrumentPoses start = scene.start();
  std::vector<InstrumentInfo> all;
  for (const effects::Instrument& instrument : scene.instruments()) {
    const std::size_t k = all.size();
    const InstrumentPose& pose = start[static_cast<int>(k)];
    all.push_back({.name = instrument.name,
                   .max_length_mm = instrument.model->max_length_mm(),
                   .tip_radius_mm = instrument.model->radius_mm(0),
                   .inner_radius_mm = instrument.inner_radius_mm,
                   .start = {pose.insertion_mm, pose.rotation_rad},
                   .is_beside = scene.stack().clearance().is_beside[k]});
  }
  return all;
}

RowRun::RowRun(simulator::Simulation& simulation) : simulation_(&simulation) { Restart(); }

void RowRun::Restart() {
  command_ = {};
  for (const InstrumentInfo& instrument : InstrumentsOf(simulation_->scene())) {
    command_.hands.push_back(instrument.start);
  }
  begun_ = false;
}

void RowRun::CopyFrom(const RowRun& twin) {
  command_ = twin.command_;
  begun_ = twin.begun_;
}

double RowRun::LongestTickTo(const Command& row) const {
  // Observers sample a tick, so a tick of years would take minutes, in which nothing can end it.
  constexpr double kLongestS = 3600;
  const double longest_s = simulation_->longest_tick_s();
  return row.time_s - command_.time_s > kLongestS ? std::min(longest_s, kLongestS) : longest_s;
}

StepReport RowRun::GoTo(const Command& row,
                        const std::function<bool(const StepReport& tick)>& after_tick) {
  const Command before = command_;
  ScriptTicks ticks(before, row, LongestTickTo(row));
  StepReport step;
  for (Command tick; step.finished && ticks.Next(tick);) {
    CountedBudget budget(simulation_->scene().budget_units());
    const TickReport& report = simulation_->Tick(ToTick(tick), budget);
    command_ = tick;
    begun_ = true;
    const StepReport one = {.ticks = 1,
                            .iterations = report.iterations,
                            .work = report.work,
                            .converged = report.converged,
                            .budget_spent = report.budget_spent,
                            .stalled = report.stalled,
                            .snapped = report.snapped};
    step = {.ticks = step.ticks + one.ticks,
            .iterations = step.iterations + one.iterations,
            .work = step.work + one.work,
            .converged = one.converged,
            .budget_spent = one.budget_spent,
            .stalled = one.stalled,
            .snapped = step.snapped || one.snapped};
    if (after_tick && !after_tick(one)) step.finished = ticks.done();
  }
  return step;
}

}  // namespace torquer
