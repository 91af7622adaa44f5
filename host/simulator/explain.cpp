#include "host/simulator/explain.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/field_ahead.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

namespace {

struct Cost {
  double median_us = 0;
  double p99_us = 0;
};

// Measures ticks that insert the innermost instrument by 0.05 mm, starting at half its length or
// more. The field is built ahead of the tip between the ticks, as a thread does in a session.
Cost Measure(Simulation& simulation) {
  constexpr int kTicks = 400;
  constexpr int kWarmUp = 20;
  constexpr double kFeedMm = 0.05;
  constexpr int kTicksPerBuild = 50;
  std::vector<double> us;
  Command command;
  command.target = simulation.target();
  double& insertion_mm = command.target[0].insertion_mm;
  const double length_mm = simulation.scene().stack().instrument(0).max_length_mm();
  while (insertion_mm < length_mm / 2) {
    insertion_mm = std::min(length_mm / 2, insertion_mm + 1);
    CountedBudget budget(simulation.scene().budget_units());
    simulation.Tick(command, budget);
  }
  for (int k = 0; k < kTicks + kWarmUp; ++k) {
    insertion_mm = std::min(insertion_mm + kFeedMm, length_mm);
    CountedBudget budget(simulation.scene().budget_units());
    if (k % kTicksPerBuild == 0)
      BuildAround(simulation.scene().vessel(), simulation.state().Farthest().tip());
    const std::int64_t start_us = bus::MonotonicUs();
    simulation.Tick(command, budget);
    if (k >= kWarmUp) us.push_back(static_cast<double>(bus::MonotonicUs() - start_us));
  }
  std::sort(us.begin(), us.end());
  return {us[us.size() / 2], us[us.size() * 99 / 100]};
}

}  // namespace

std::string Explain(scene::Scene& scene) {
  const scene::SceneSpec& spec = scene.spec();
  std::string out = fmt::format("{}\n  vessel: {}\n", scene.name(), scene.vessel().description);
  for (const scene::InstrumentSpec& instrument : spec.instruments) {
    out += fmt::format("  {}: up to {:.4g} mm, {:.4g} mm inside at the start{}\n", instrument.name,
                       instrument.max_length_mm, instrument.inserted_at_start_mm,
                       instrument.entry ? ", beside the earlier ones" : "");
  }
  out += fmt::format("  method: {}, segments of {:.4g} mm, at most {:.4g} us a tick\n",
                     scene.method() == scene::Method::kNewton ? "newton" : "paper",
                     scene.stack().empty_rod().segment_mm(), scene.budget_us());
  out += "  simulated:";
  if (spec.effects.empty()) out += " the instruments and the wall, no effect";
  std::vector<std::string> off;
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (spec.Has(kind.name)) {
      out += fmt::format("\n    {}: {}", kind.name, kind.summary);
    } else {
      off.push_back(kind.name);
    }
  }
  out +=
      fmt::format("\n  off: {}\n", off.empty() ? "nothing" : fmt::to_string(fmt::join(off, ", ")));
  Simulation simulation(scene);
  const Cost cost = Measure(simulation);
  out += fmt::format(
      "  a tick that feeds 0.05 mm takes here, with {:.4g} mm inside, {:.4g} us (median), {:.4g} "
      "us (p99)\n",
      simulation.state().Farthest().insertion_mm(), cost.median_us, cost.p99_us);
  return out;
}

}  // namespace torquer::simulator
