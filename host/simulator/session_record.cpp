#include "host/simulator/session_record.h"

#include <nlohmann/json.hpp>

#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::simulator {

namespace {

const std::string& NeedObserver(const std::string& path, const Session& session) {
  if (session.Readings().empty()) {
    throw UserError(session.scene().path() +
                    ": has nothing to record; add [effects.assessment] or [effects.wall_force]");
  }
  return path;
}

}  // namespace

std::string FormatRecord(const Session& session) {
  const scene::Scene& scene = session.scene();
  nlohmann::ordered_json readings;
  for (const effects::Reading& reading : session.Readings()) {
    readings[reading.name] = reading.value;
  }
  const nlohmann::ordered_json record = {
      {"record_version", kRecordVersion},
      {"scene", scene.name()},
      {"scene_file", scene.path()},
      {"content_hash", Hex(scene.content_hash())},
      {"method", scene.method() == scene::Method::kPaper ? "paper" : "newton"},
      {"effects", scene.effect_names()},
      {"ticks", session.tick()},
      {"simulated_s", session.time_s()},
      {"insertion_mm", session.state().insertion_mm},
      {"rotation_rad", session.state().rotation_rad},
      {"state_hash", Hex(session.state_hash())},
      {"readings", std::move(readings)}};
  return record.dump(2) + "\n";
}

SessionRecord::SessionRecord(const std::string& path, const Session& session)
    : file_(NeedObserver(path, session)) {}

void SessionRecord::Finish(const Session& session) {
  file_.out() << FormatRecord(session);
  file_.Finish();
}

}  // namespace torquer::simulator
