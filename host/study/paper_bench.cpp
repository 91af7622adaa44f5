#include "host/study/paper_bench.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "host/study/cpu_time.h"

namespace torquer::study {
namespace {

constexpr double kTipMm = 5;

std::vector<WireSection> Sections(const PaperBench::Setup& setup) {
  const double curvature = setup.tip_angle_rad / kTipMm;
  if (curvature == 0) return {{0, setup.rigidity_N_mm2, setup.radius_mm, 0, 0}};
  return {{0, setup.rigidity_N_mm2, setup.radius_mm, curvature, 0},
          {kTipMm, setup.rigidity_N_mm2, setup.radius_mm, curvature, 0},
          {kTipMm + 1e-6, setup.rigidity_N_mm2, setup.radius_mm, 0, 0}};
}

}  // namespace

PaperBench::PaperBench(const vessel::TubeVessel& phantom, const Setup& setup)
    : phantom_(phantom),
      model_(setup.segment_mm, Sections(setup), kTipMm, kLengthMm, setup.law,
             {phantom.entry_point_mm(), phantom.entry_direction()}),
      wall_{setup.wall_N_mm2, 1},
      settings_(setup.physical),
      mechanics_(model_, *phantom.field, wall_, no_terms_),
      quadratic_(mechanics_.MakeQuadraticModel()),
      physical_(model_, *phantom.field, wall_, setup.physical),
      geometrical_(model_, *phantom.field, {}),
      state_(model_) {
  physical_.Restart(state_);
}

int PaperBench::full_segments() const {
  return static_cast<int>(std::lround(kLengthMm / model_.segment_mm()));
}

void PaperBench::SetShape(const WireState& other) {
  assert(other.segments() == full_segments());
  state_ = other;
  state_.UntwistFrames(model_);
  physical_.Restart(state_);
}

double PaperBench::InsertFast() {
  PaperSettings settings;
  settings.physical = settings_;
  settings.cycles = PaperCycles::kNone;
  PaperRelaxation relaxation(model_, *phantom_.field, wall_, settings);
  state_ = WireState(model_);
  relaxation.Restart(state_);
  const double before = ThreadCpuSeconds();
  // One segment per tick, so that the report shows the penetration of each insertion step.
  for (int k = 1; k <= full_segments(); ++k) {
    CountedBudget budget(2);
    const TickReport report = relaxation.Tick({k * model_.segment_mm(), 0}, budget, state_);
    deepest_mm_ = std::max(deepest_mm_, report.max_penetration_mm);
  }
  const double taken = ThreadCpuSeconds() - before;
  physical_.Restart(state_);
  return taken;
}

PaperCycle PaperBench::Cycle(bool with_geometrical) {
  PaperCycle cycle;
  const double start = ThreadCpuSeconds();
  physical_.ContinueCycle(std::numeric_limits<std::int64_t>::max(), state_);
  const double between = ThreadCpuSeconds();
  cycle.physical_s = between - start;
  if (with_geometrical && geometrical_.Begin(state_)) {
    geometrical_.Continue(std::numeric_limits<int>::max(), state_);
    physical_.Restart(state_);
    cycle.interval = geometrical_.interval();
  }
  if (with_geometrical) cycle.geometrical_s = ThreadCpuSeconds() - between;
  const QuadraticModel& now = Assess();
  cycle.energy_mJ = now.energy_mJ;
  cycle.residual = now.residual;
  return cycle;
}

PaperBench::Bouncing PaperBench::Observe(int cycles) {
  const int n = state_.segments();
  Bouncing seen;
  seen.contact_share.assign(static_cast<std::size_t>(n) + 1, 0.0);
  seen.mean_update.assign(static_cast<std::size_t>(n), 0.0);
  physical_.Restart(state_);
  for (int cycle = 0; cycle < cycles; ++cycle) {
    for (int k = 1; k <= n; ++k) {
      for (int i = n - 1; i >= n - k; --i) seen.mean_update[i] += physical_.Update(i, state_);
      for (int j = 1; j <= n; ++j) {
        seen.contact_share[j] +=
            phantom_.field->Clearance(state_.nodes()[j]) < model_.radius_mm(n - j);
      }
    }
  }
  for (int i = 0; i < n; ++i) seen.mean_update[i] /= cycles * (i + 1.0);
  for (double& share : seen.contact_share) share /= static_cast<double>(cycles) * n;
  return seen;
}

WireState PaperBench::Equilibrium(bool* converged) {
  NewtonSettings settings;
  settings.tolerance = 1e-9;
  NewtonRelaxation newton(model_, *phantom_.field, wall_, settings, no_terms_);
  WireState state = state_;
  newton.Restart(state);
  TickReport report;
  for (int tick = 0; tick < 20 && !report.converged; ++tick) {
    CountedBudget budget(1000);
    report = newton.Tick({state.insertion_mm(), 0}, budget, state);
  }
  if (converged != nullptr) *converged = report.converged;
  return state;
}

const QuadraticModel& PaperBench::Assess() {
  mechanics_.points().Forget();
  mechanics_.BuildGradient(state_, quadratic_);
  return quadratic_;
}

double MeanDistance(const WireState& a, const WireState& b) {
  assert(a.nodes().size() == b.nodes().size());
  double sum = 0;
  for (std::size_t i = 0; i < a.nodes().size(); ++i) sum += (a.nodes()[i] - b.nodes()[i]).norm();
  return sum / static_cast<double>(a.nodes().size());
}

}  // namespace torquer::study
