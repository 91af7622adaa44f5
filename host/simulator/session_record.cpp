#include "host/simulator/session_record.h"

#include <cstdint>
#include <nlohmann/json.hpp>

#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::simulator {

namespace {

constexpr std::int64_t kRoomBytes = 65536;  // several times the size of a record

std::string NeedObserver(const std::string& path, const std::string& scene, bool observed) {
  if (observed) return path;
  throw UserError(scene +
                  ": has nothing to record; add [effects.assessment] or [effects.wall_force]");
}

}  // namespace

std::string FormatRecord(const Simulation& simulation, bool examination) {
  const scene::Scene& scene = simulation.scene();
  nlohmann::ordered_json instruments = nlohmann::ordered_json::object();
  for (std::size_t k = 0; k < scene.instruments().size(); ++k) {
    const InstrumentPose& pose = simulation.state().poses()[static_cast<int>(k)];
    instruments[scene.instruments()[k].name] = {{"insertion_mm", pose.insertion_mm},
                                                {"rotation_rad", pose.rotation_rad}};
  }
  nlohmann::ordered_json exchanges = nlohmann::ordered_json::array();
  for (const DeviceExchange& exchange : simulation.exchanges()) {
    const auto k = static_cast<std::size_t>(exchange.instrument);
    exchanges.push_back({{"time_s", exchange.time_s},
                         {"instrument", scene.instruments()[k].name},
                         {"device", exchange.device}});
  }
  nlohmann::ordered_json readings = nlohmann::ordered_json::object();
  for (const effects::Reading& reading : simulation.Readings()) {
    readings[reading.name] = reading.value;
  }
  const nlohmann::ordered_json record = {
      {"record_version", kRecordVersion},
      {"examination", examination},
      {"scene", scene.name()},
      {"scene_file", scene.path()},
      {"content_hash", Hex(simulation.content_hash_at_start())},
      {"method", scene.method() == scene::Method::kPaper ? "paper" : "newton"},
      {"effects", scene.effect_names()},
      {"ticks", simulation.tick()},
      {"simulated_s", simulation.time_s()},
      {"instruments", std::move(instruments)},
      {"exchanges", std::move(exchanges)},
      {"state_hash", Hex(simulation.state_hash())},
      {"readings", std::move(readings)}};
  // The name of a file need not be UTF-8.
  return record.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

SessionRecord::SessionRecord(const std::string& path, const std::string& scene, bool observed)
    : file_(NeedObserver(path, scene, observed)) {
  file_.Reserve(kRoomBytes);
}

void SessionRecord::Finish(const std::string& record) {
  file_.out() << record;
  file_.Finish();
}

}  // namespace torquer::simulator
