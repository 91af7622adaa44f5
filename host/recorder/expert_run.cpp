#include "host/recorder/expert_run.h"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "host/api/row_run.h"
#include "host/api/script_columns.h"
#include "host/api/script_ticks.h"
#include "host/recorder/course_feed.h"
#include "host/recorder/session_judge.h"
#include "host/simulator/exchangeable_simulation.h"

namespace torquer {

std::string ExpertPath(const std::string& scene_file) {
  const std::filesystem::path scene(scene_file);
  return (scene.parent_path() / "experts" / (scene.stem().string() + ".csv")).string();
}

ExpertRun RunExpert(scene::Scene& scene, const std::string& path) {
  constexpr std::int64_t kClock = 1;
  const std::vector<ScriptRow> rows = ReadScript(path, scene.spec().path, InstrumentsOf(scene));
  simulator::ExchangeableSimulation simulation(scene);
  CourseFeed feed(simulation, kClock);
  RowRun run(simulation.now());
  feed.AddState(0);
  Command before = run.command();
  for (const auto& [place, time_s, exchanges, row] : rows) {
    for (const auto& [instrument, device] : exchanges) {
      simulation.Exchange(static_cast<int>(instrument), device);
      run.ContinueIn(simulation.now());
    }
    ScriptTicks parts(before, row, 1e-6 * kJudgeRowUs);
    for (Command part; parts.Next(part);) {
      const std::int64_t now_us = std::llround(1e6 * part.time_s);
      feed.AddPedals(now_us, part.xray, part.contrast);
      run.GoTo(part, {});
      feed.AddState(now_us);
    }
    before = row;
  }
  return {.file = path, .readings = feed.readings(), .course = feed.course()};
}

}  // namespace torquer
