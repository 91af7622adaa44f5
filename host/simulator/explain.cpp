#include "host/simulator/explain.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/session.h"

namespace torquer::simulator {

namespace {

std::string Number(double value, const char* unit) {
  char text[64];
  std::snprintf(text, sizeof text, "%.4g%s", value, unit);
  return text;
}

struct Cost {
  double median_us = 0;
  double p99_us = 0;
};

// Ticks of a hand that feeds by 0.05 mm, with at least half of the wire inside.
Cost Measure(Session& session) {
  constexpr int kTicks = 400;
  constexpr int kWarmUp = 20;
  constexpr double kFeedMm = 0.05;
  std::vector<double> us;
  Command command;
  command.target = session.target();
  const double half_mm = session.scene().wire().max_length_mm() / 2;
  while (command.target.insertion_mm < half_mm) {
    command.target.insertion_mm = std::min(half_mm, command.target.insertion_mm + 1);
    CountedBudget budget(session.scene().budget_units());
    session.Tick(command, budget);
  }
  for (int k = 0; k < kTicks + kWarmUp; ++k) {
    command.target.insertion_mm =
        std::min(command.target.insertion_mm + kFeedMm, session.scene().wire().max_length_mm());
    CountedBudget budget(session.scene().budget_units());
    const std::int64_t start_us = bus::MonotonicUs();
    session.Tick(command, budget);
    if (k >= kWarmUp) us.push_back(static_cast<double>(bus::MonotonicUs() - start_us));
  }
  std::sort(us.begin(), us.end());
  return {us[us.size() / 2], us[us.size() * 99 / 100]};
}

}  // namespace

std::string Explain(scene::Scene& scene) {
  const WireModel& wire = scene.wire();
  const bool newton = scene.method() == scene::Method::kNewton;
  std::string out = scene.name() + "\n";
  out += "  vessel: " + scene.vessel().description + "\n";
  out += "  wire: up to " + Number(wire.max_length_mm(), " mm") + " in segments of " +
         Number(wire.segment_mm(), " mm") + ", " +
         Number(scene.inserted_at_start_mm(), " mm inside at the start") + "\n";
  out += std::string("  method: ") + (newton ? "newton" : "paper") + ", at most " +
         Number(scene.budget_us(), " us a tick") + "\n";
  out += "  simulated:";
  if (scene.effect_names().empty()) out += " the wire and the wall, no effect";
  for (const std::string& name : scene.effect_names()) {
    out += "\n    " + name + ": " + effects::FindEffect(name, scene.path()).summary;
  }
  out += "\n  off:";
  bool any = false;
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    const std::vector<std::string>& on = scene.effect_names();
    if (std::find(on.begin(), on.end(), kind.name) != on.end()) continue;
    out += std::string(any ? ", " : " ") + kind.name;
    any = true;
  }
  if (!any) out += " nothing";
  Session session(scene);
  const Cost cost = Measure(session);
  out += "\n  a tick that feeds 0.05 mm takes here, with " +
         Number(session.state().insertion_mm, " mm inside, ") + Number(cost.median_us, " us") +
         " (median), " + Number(cost.p99_us, " us") + " (p99)\n";
  return out;
}

}  // namespace torquer::simulator
