// Fuzz target for scripts: of the simulator, of the emulator's hand and of torquer-calibrate.
#include "host/api/row_run.h"
#include "host/api/script_columns.h"
#include "host/emulator/motion_script.h"
#include "host/simulator/scene/scene.h"
#include "host/tools/calibrate_script.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::scripts_target {
namespace {

// The first lines of a file.
Bytes Head(const std::string& path, int lines) {
  const std::string text = SourceText(path);
  std::size_t end = 0;
  for (int k = 0; k < lines && end < text.size(); ++k) end = text.find('\n', end) + 1;
  return ToBytes(text.substr(0, end));
}

bool AcceptsScript(std::span<const std::uint8_t> input) {
  static const scene::Scene scene(scene::ParseScene(SourceText("host/scenes/drill_tube.toml"),
                                                    "drill_tube.toml", "host/scenes"));
  return !ReadScript(FileWith(input), scene.path(), InstrumentsOf(scene)).empty();
}

bool AcceptsHand(std::span<const std::uint8_t> input) {
  const auto script = emulator::MotionScript::FromFile(FileWith(input));
  script.At(script.duration_s() / 2);
  return true;
}

bool AcceptsCalibrate(std::span<const std::uint8_t> input) {
  return !tools::ParseScript(ToText(input), "fuzz.script").statements.empty();
}

const Registration kScript(
    {.name = "script",
     .seeds = [] { return std::vector<Bytes>{Head("host/scenes/neuro_angio.script.csv", 4)}; },
     .accepts = AcceptsScript,
     .replay_inputs = 15000});
const Registration kHand(
    {.name = "motion_script",
     .seeds = [] { return std::vector<Bytes>{Head("host/scenes/drill_tube.motion.csv", 6)}; },
     .accepts = AcceptsHand,
     .replay_inputs = 15000});
const Registration kCalibrate(
    {.name = "calibrate_script",
     .seeds = [] { return std::vector<Bytes>{Head("calibration/sample.script", 40)}; },
     .accepts = AcceptsCalibrate,
     .replay_inputs = 5000});

}  // namespace
}  // namespace torquer::fuzz::scripts_target
