// torquer-calibrate: guides a person through the calibration of a bench device, and saves the
// result.

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "calibration/calibration_file.h"
#include "calibration/procedure.h"
#include "host/device/source_choice.h"
#include "host/support/angle.h"
#include "host/support/atomic_file.h"
#include "host/support/number.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/tools/calibrate_report.h"
#include "host/tools/calibrate_source.h"
#include "host/tools/calibrate_terminal.h"
#include "host/tools/focus_view.h"

namespace {

using torquer::UserError;
using torquer::calibration::CalibrationPath;
using torquer::calibration::HandMotion;
using torquer::calibration::Key;
using torquer::calibration::Message;
using torquer::calibration::Procedure;
using torquer::calibration::ProcedureResult;
using torquer::calibration::ProcedureSettings;
using torquer::calibration::Prompt;
using torquer::calibration::Reading;
using torquer::calibration::Step;
using torquer::tools::DeviceFacts;
using torquer::tools::DeviceReadings;
using torquer::tools::PacedOperator;
using torquer::tools::ReadingSink;
using torquer::tools::ReadingSource;
using torquer::tools::Script;
using torquer::tools::ScriptedDevice;
using torquer::tools::Terminal;

struct Arguments {
  torquer::device::SourceChoice source;
  std::string output;
  std::string plot;
  std::string script;
  ProcedureSettings settings;
  std::optional<double> length_mm;
  bool focus = false;
  std::string picture;
  std::optional<double> shims_mm;
  std::string heights;
};

void Declare(torquer::Options& options, Arguments& arguments) {
  ProcedureSettings& settings = arguments.settings;
  torquer::device::AddSourceOptions(options, arguments.source);
  options.Group("Assembly");
  options.Flag("--focus", arguments.focus,
               "show the picture of the sensor's camera, judge dirt, shading and sharpness, and "
               "calibrate nothing");
  options.Text("--picture", "FILE.png", arguments.picture,
               "output file for the last picture of --focus", torquer::ValueKind::kFile);
  options.Number("--shims", "MM", arguments.shims_mm, 0, 10,
                 "height of the shims now below the carrier, for --heights");
  options.Text("--heights", "FILE.csv", arguments.heights,
               "file to which --focus adds the sharpness with these --shims; it then seeks the "
               "sharpest height of all in the file",
               torquer::ValueKind::kFile);
  options.Group("Strokes");
  options.Number("--length", "MM", arguments.length_mm, 10, 1000,
                 fmt::format("length of a push; without it the program asks, or uses {:g}",
                             settings.length_mm));
  options.Number("--length-error", "MM", settings.length_error_mm, 0.001, 100,
                 "standard deviation of the error in the length");
  options.Flag("--ruler", settings.ruler,
               "enter a ruler reading for each push, instead of pushing from stop to stop");
  options.Integer("--turns", "N", settings.turns, 1, 50,
                  "number of whole turns in a turning stroke");
  options.Number("--radius", "MM", settings.cylinder_radius_mm, 0.2, 100,
                 "approximate radius of the cylinder");
  options.Number(
      "--play", "MM", settings.play_mm, 0, 2,
      "height by which the cylinder can rise in its bore; it counts if the raised pushes "
      "are skipped");
  options.Integer("--pushes", "N", settings.pushes, 3, 100, "number of good pushes required");
  options.Integer("--turn-strokes", "N", settings.turn_strokes, 3, 100,
                  "number of good turning strokes required");
  options.Group("Files");
  options.Text("--output", "FILE", arguments.output,
               "calibration file to write; without it SERIAL.toml in the user's Torquer "
               "configuration folder",
               torquer::ValueKind::kFile);
  options.Text("--plot", "FILE.svg", arguments.plot,
               "picture of the residuals to write; without it a file beside the calibration",
               torquer::ValueKind::kFile);
  options.Text("--script", "FILE", arguments.script,
               "script file that acts as the operator (see calibration/README.md); without "
               "--source it moves a simulated device",
               torquer::ValueKind::kFile);
}

std::unique_ptr<ReadingSource> OpenDevice(const Arguments& arguments) {
  torquer::device::SourceChoice choice = arguments.source;
  if (choice.source.empty()) choice.source = "usb";
  const bool has_joystick = !choice.is_mouse() || choice.devices.size() > 1;
  return std::make_unique<DeviceReadings>(torquer::device::OpenSource(choice), choice.is_mouse(),
                                          has_joystick);
}

std::unique_ptr<ReadingSource> OpenReadings(const Arguments& arguments) {
  if (arguments.script.empty()) return OpenDevice(arguments);
  Script script = torquer::tools::ReadScript(arguments.script);
  if (arguments.source.source.empty()) return std::make_unique<ScriptedDevice>(std::move(script));
  return std::make_unique<PacedOperator>(OpenDevice(arguments), std::move(script));
}

// Asks the user; Enter alone keeps the value in brackets.
void AskForReference(ProcedureSettings& settings) {
  const auto ask = [](const char* question, double& value) {
    for (;;) {
      const std::string answer = torquer::tools::Ask(fmt::format("{} [{:g}]:", question, value));
      if (answer.empty()) return;
      if (const std::optional<double> number = torquer::ParseNumber(answer)) {
        value = *number;
        return;
      }
      fmt::print("'{}' is not a number.\n", answer);
    }
  };
  ask(settings.ruler ? "Length of a push along the ruler, mm"
                     : "Distance from the near stop to the far stop, mm",
      settings.length_mm);
  ask(settings.ruler ? "Standard deviation of one reading, mm"
                     : "Standard deviation of that distance, mm",
      settings.length_error_mm);
}

// Guided calibration: connects the procedure, its source and the terminal.
class GuidedRun : public ReadingSink {
 public:
  GuidedRun(const ProcedureSettings& settings, Terminal& terminal, const std::atomic<bool>& stop)
      : procedure_(settings), terminal_(terminal), stop_(stop) {}

  // Returns false if the calibration was aborted.
  bool Run(ReadingSource& source) {
    while (!quit_ && !stop_ && procedure_.step() != Step::kDone) {
      ShowPrompt();
      source.Wait(20, *this);
      while (const std::optional<char> key = terminal_.Key()) TakeKey(*key);
      ShowMessages();
      ShowNumbers();
    }
    terminal_.Change("");
    return procedure_.step() == Step::kDone && !stop_;
  }

  void Take(const Reading& reading) override {
    if (procedure_.step() == Step::kDone) return;
    procedure_.Take(reading);
    last_ = reading;
    ShowMessages();
    ShowPrompt();
  }
  void Press(Key key) override { procedure_.Press(key); }
  void Quit() override { quit_ = true; }
  void Inform(const std::string& text) override { terminal_.Print("  -- " + text); }
  Step step() const override { return procedure_.step(); }
  const Procedure& procedure() const { return procedure_; }

 private:
  void TakeKey(char key) {
    if (key == '\n' || key == ' ') procedure_.Press(Key::kMark);
    if (key == 'u') procedure_.Press(Key::kUndo);
    if (key == 's') procedure_.Press(Key::kSkip);
    if (key == 'q') quit_ = true;
  }

  void ShowMessages() {
    for (const Message& message : procedure_.TakeMessages()) {
      const char* sign = message.kind == Message::Kind::kAccepted   ? "  ok "
                         : message.kind == Message::Kind::kRejected ? "  !! "
                                                                    : "  -- ";
      terminal_.Print(sign + message.text);
    }
  }

  void ShowPrompt() {
    const Prompt prompt = procedure_.prompt();
    const std::string count =
        prompt.wanted > 0 ? fmt::format(" {}/{}", prompt.done, prompt.wanted) : "";
    const std::string text = fmt::format("{}{}: {}.", prompt.title, count, prompt.instruction);
    if (text == shown_ || prompt.step == Step::kDone) return;
    shown_ = text;
    terminal_.Print(text);
  }

  void ShowNumbers() {
    const HandMotion moved = procedure_.SinceMark();
    const char* trouble = last_.faulty ? ", no answer" : last_.lifted ? ", lifted" : "";
    terminal_.Change(fmt::format(
        "     {}{:+8.2f} mm {:+7.1f} deg | counts {} axial, {} transverse | quality {}{}",
        procedure_.prompt().marking ? "hold still .. " : "", moved.insertion_mm,
        moved.rotation_rad * torquer::kDegreesPerRad, last_.axial_counts, last_.transverse_counts,
        last_.surface_quality, trouble));
  }

  Procedure procedure_;
  Terminal& terminal_;
  const std::atomic<bool>& stop_;
  Reading last_;
  std::string shown_;
  bool quit_ = false;
};

std::string Note(const ProcedureResult& result, const ProcedureSettings& settings) {
  std::array<int, 3> strokes{};  // by MotionKind
  for (std::size_t i = 0; i < result.strokes.size(); ++i) {
    if (result.rejections[i]) continue;
    ++strokes[static_cast<std::size_t>(result.strokes[i].stroke.kind)];
  }
  const auto word = [](bool good, const char* yes, const char* no) { return good ? yes : no; };
  return fmt::format(
      "{:%Y-%m-%d}: {} pushes of {:g} mm +- {:g} mm {}, {} x {} turns; rest {}, height {}, "
      "joystick {}",
      fmt::localtime(std::time(nullptr)), strokes[0], settings.length_mm, settings.length_error_mm,
      word(settings.ruler, "by a ruler", "between stops"), strokes[1], settings.turns,
      word(result.rest_checked, "checked", "not checked"),
      word(result.fit.height_measured, "measured", "not measured"),
      word(result.joystick_measured, "measured", "nominal"));
}

void MakeFolderOf(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw UserError(
        fmt::format("{}: the folder cannot be created: {}", folder.string(), error.message()));
  }
}

// Path of the plot: --plot, or beside the calibration file without --plot.
std::string PlotPath(const Arguments& arguments, const std::string& calibration) {
  if (!arguments.plot.empty()) return arguments.plot;
  return std::filesystem::path(calibration).replace_extension(".svg").string();
}

// Rejects paths that cannot be written, before the calibration, so that no work is lost. The folder
// of the calibration may be created at the end.
void CheckPaths(const Arguments& arguments, const std::string& path) {
  for (const std::string& file : {path, PlotPath(arguments, path)}) {
    const std::filesystem::path folder = std::filesystem::path(file).parent_path();
    std::error_code error;
    if (folder.empty() || std::filesystem::exists(folder, error)) torquer::AtomicFile{file};
  }
}

int Finish(const Arguments& arguments, const ProcedureSettings& settings, const DeviceFacts& facts,
           ProcedureResult result, const std::string& path, int columns) {
  fmt::print(
      "\n{} at {} cpi (95 % intervals):\n{}\nReference minus model, stroke by stroke:\n{}\n{}",
      facts.serial, settings.cpi, torquer::tools::ParameterTable(result),
      torquer::tools::ResidualChart(result, columns), torquer::tools::Verdict(result, settings));
  if (torquer::tools::GradeOf(result.fit) == torquer::tools::Grade::kPoor) {
    return torquer::kExitFailure;
  }
  result.calibration.device = facts.serial;
  result.calibration.sensor_product_id = facts.sensor_product_id;
  result.calibration.note = Note(result, settings);
  MakeFolderOf(path);
  const std::string plot = PlotPath(arguments, path);
  const std::string date = result.calibration.note.substr(0, 10);
  torquer::WriteFileAtomically(
      plot, torquer::tools::ResidualPicture(
                result, fmt::format("Calibration of {}, {}", facts.serial, date)));
  torquer::calibration::WriteCalibration(result.calibration, path);
  fmt::print("Saved as {}, with a plot in {}.\n", path, plot);
  return torquer::kExitSuccess;
}

int RunFocus(const Arguments& arguments) {
  torquer::device::SourceChoice choice = arguments.source;
  if (choice.source.empty()) choice.source = "usb";
  if (choice.is_mouse()) {
    throw torquer::UsageError("--focus: an ordinary mouse shows no picture; use the bench device");
  }
  if (!arguments.script.empty()) throw torquer::UsageError("--focus: leave out --script");
  if (choice.sensor != 1) {
    throw torquer::UsageError(
        "--focus: only the first sensor sends pictures; exchange the chip selects of the two to "
        "see "
        "the other one's, and leave out --sensor 2");
  }
  std::optional<torquer::tools::FocusSeries> series;
  if (arguments.shims_mm.has_value() == arguments.heights.empty()) {
    throw torquer::UsageError("--shims and --heights go together: give both, or neither");
  }
  if (arguments.shims_mm) series = {arguments.heights, *arguments.shims_mm};
  const auto source = torquer::device::OpenSource(choice);
  const bool good =
      torquer::tools::ShowFocus(*source, arguments.picture, series, torquer::StopOnSignal());
  return good ? torquer::kExitSuccess : torquer::kExitFailure;
}

int Run(const Arguments& arguments) {
  if (arguments.focus) return RunFocus(arguments);
  if (!arguments.picture.empty()) throw torquer::UsageError("--picture goes with --focus alone");
  if (arguments.shims_mm || !arguments.heights.empty()) {
    throw torquer::UsageError("--shims and --heights go with --focus alone");
  }
  ProcedureSettings settings = arguments.settings;
  settings.length_mm = arguments.length_mm.value_or(settings.length_mm);
  const std::unique_ptr<ReadingSource> source = OpenReadings(arguments);
  static_cast<void>(Procedure(settings));  // rejects invalid settings before anything is done
  if (!arguments.length_mm && arguments.script.empty() && torquer::tools::CanAsk()) {
    AskForReference(settings);
  }

  const DeviceFacts facts = source->Connect();
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  settings.cpi = facts.cpi;
  settings.cpi_known = !facts.ordinary_mouse;
  settings.has_joystick = facts.has_joystick;
  const std::string path =
      arguments.output.empty() ? CalibrationPath(facts.serial) : arguments.output;
  CheckPaths(arguments, path);
  fmt::print("Device {} at {} cpi{}; the calibration will be {}\n", facts.serial, facts.cpi,
             facts.ordinary_mouse ? " (assumed until it is measured)" : "", path);
  if (arguments.script.empty()) {
    fmt::print(
        "Keys: Enter or the X-ray button marks a position, u undoes the last stroke,\ns skips a "
        "step, q quits without a change.\n");
  }
  Terminal terminal;
  GuidedRun run(settings, terminal, stop);
  if (!run.Run(*source)) {
    terminal.Print("Stopped; nothing was written.");
    return torquer::kExitGivenUp;
  }
  return Finish(arguments, settings, facts, run.procedure().Result(), path, terminal.columns());
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-calibrate",
      "Guides the operator through pushes between two stops and through whole turns, in about six "
      "minutes. It keeps the factors that convert this device's counts to mm and rad. Without "
      "--source it calibrates the bench device on USB.");
  program.Note(
      "Keys: Enter or the X-ray button marks a position; u undoes the last stroke; s skips a step; "
      "q or Ctrl-C quits without a change.");
  program.Note(
      "Exit status: 0 when the calibration was saved; 1 when it was too inaccurate to save; 2 when "
      "an option, a file or a device cannot be used; 130 when the operator quit. With --focus: 0 "
      "when the sensor's position is good; 1 when it is not.");
  Arguments arguments;
  Declare(program.options(), arguments);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
