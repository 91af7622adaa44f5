// torquer-calibrate: a guided session at the bench device, and the file that comes of it.

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "calibration/calibration_file.h"
#include "calibration/procedure.h"
#include "host/device/evdev_source.h"
#include "host/device/socket_source.h"
#include "host/device/usb_source.h"
#include "host/support/atomic_file.h"
#include "host/support/command_line.h"
#include "host/support/error.h"
#include "host/tools/calibrate_report.h"
#include "host/tools/calibrate_session.h"
#include "host/tools/calibrate_terminal.h"

namespace {

using torquer::UserError;
using torquer::calibration::CalibrationPath;
using torquer::calibration::HandMotion;
using torquer::calibration::Key;
using torquer::calibration::Message;
using torquer::calibration::MotionKind;
using torquer::calibration::Procedure;
using torquer::calibration::ProcedureResult;
using torquer::calibration::ProcedureSettings;
using torquer::calibration::Prompt;
using torquer::calibration::Reading;
using torquer::calibration::Step;
using torquer::calibration::WriteCalibration;
using torquer::tools::Ask;
using torquer::tools::CanAsk;
using torquer::tools::DeviceFacts;
using torquer::tools::DeviceSession;
using torquer::tools::Grade;
using torquer::tools::GradeOf;
using torquer::tools::PacedSession;
using torquer::tools::ParameterTable;
using torquer::tools::ReadScript;
using torquer::tools::ResidualChart;
using torquer::tools::ResidualPicture;
using torquer::tools::Script;
using torquer::tools::ScriptedSession;
using torquer::tools::SessionSink;
using torquer::tools::SessionSource;
using torquer::tools::Terminal;
using torquer::tools::Verdict;

constexpr char kUsage[] =
    "usage: torquer-calibrate [--source usb|evdev|socket] [--device SERIAL|PATH].. [--socket "
    "PATH]\n"
    "         [--length MM] [--length-error MM] [--ruler] [--turns N] [--radius MM]\n"
    "         [--pushes N] [--turn-strokes N] [--output FILE] [--plot FILE.svg] [--script FILE]\n"
    "       torquer-calibrate --script FILE [..]\n"
    "\n"
    "Leads through pushes between two stops and whole turns, five minutes in all, and keeps what\n"
    "turns this device's counts into mm and rad. Keys: Enter marks a place (so does the X-ray\n"
    "button), u forgets the last stroke, s skips a step, q or Ctrl-C gives up and changes "
    "nothing.\n"
    "\n"
    "  --source usb       (as without) the bench device; --device picks one by serial number\n"
    "  --source evdev     a mouse and perhaps a joystick, each given by --device /dev/input/..\n"
    "  --source socket    the emulator that listens at --socket\n"
    "  --length           of a push, mm (150)\n"
    "  --length-error     by what that may be off, mm, one standard deviation (0.5)\n"
    "  --ruler            read a ruler for each push, instead of going from stop to stop\n"
    "  --turns            whole turns a stroke (2)\n"
    "  --radius           of the cylinder, mm, about (5)\n"
    "  --pushes           good pushes wanted (6)\n"
    "  --turn-strokes     good strokes of turns wanted (5)\n"
    "  --output           the calibration (SERIAL.toml in the user's torquer configuration)\n"
    "  --plot             the residuals, drawn (beside the calibration)\n"
    "  --script           a session from a file, see calibration/README.md\n"
    "\n"
    "Exit status: 0 when the calibration was kept, 1 when it was too poor to be, 2 when something\n"
    "could not be used, 130 when it was given up.\n";

constexpr int kTooPoor = 1;
constexpr int kGivenUp = 130;

volatile std::sig_atomic_t interrupted = 0;

struct Arguments {
  std::string source;
  std::vector<std::string> devices;
  std::string socket;
  std::string output;
  std::string plot;
  std::string script;
  ProcedureSettings settings;
  bool length_given = false;
  bool help = false;
};

double Number(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !std::isfinite(value)) {
    throw UserError(option + " '" + text + "': is no number");
  }
  return value;
}

int WholeNumber(const std::string& option, const std::string& text) {
  const double value = Number(option, text);
  if (value != std::floor(value) || std::abs(value) > 1e6) {
    throw UserError(option + " '" + text + "': is no whole number");
  }
  return static_cast<int>(value);
}

Arguments Parse(int argc, char** argv) {
  Arguments arguments;
  ProcedureSettings& settings = arguments.settings;
  torquer::CommandLine line;
  const auto number = [&line](const std::string& name, double& value) {
    line.Option(name, [name, &value](const std::string& text) { value = Number(name, text); });
  };
  const auto whole = [&line](const std::string& name, int& value) {
    line.Option(name, [name, &value](const std::string& text) { value = WholeNumber(name, text); });
  };
  line.Option("--source", arguments.source);
  line.Option("--device", [&](const std::string& name) { arguments.devices.push_back(name); });
  line.Option("--socket", arguments.socket);
  line.Option("--length", [&](const std::string& text) {
    settings.length_mm = Number("--length", text);
    arguments.length_given = true;
  });
  number("--length-error", settings.length_error_mm);
  line.Flag("--ruler", settings.ruler);
  whole("--turns", settings.turns);
  number("--radius", settings.cylinder_radius_mm);
  whole("--pushes", settings.pushes);
  whole("--turn-strokes", settings.turn_strokes);
  line.Option("--output", arguments.output);
  line.Option("--plot", arguments.plot);
  line.Option("--script", arguments.script);
  line.Flag("--help", arguments.help);
  line.Parse(argc, argv, kUsage);
  if (arguments.help) return arguments;
  if (arguments.source.empty() && arguments.script.empty()) arguments.source = "usb";
  return arguments;
}

std::unique_ptr<SessionSource> MakeDevice(const Arguments& arguments) {
  std::unique_ptr<torquer::device::ReportSource> source;
  const bool mouse = arguments.source == "evdev";
  if (arguments.source == "socket") {
    source = std::make_unique<torquer::device::SocketSource>(arguments.socket);
  } else if (arguments.source == "usb") {
    if (arguments.devices.size() > 1) {
      throw UserError("one device is calibrated at a time; give --device once");
    }
    source = std::make_unique<torquer::device::UsbSource>(
        arguments.devices.empty() ? "" : arguments.devices.front());
  } else if (mouse) {
    source = std::make_unique<torquer::device::EvdevSource>(arguments.devices);
  } else {
    throw UserError("--source '" + arguments.source + "' is not known\n" + kUsage);
  }
  return std::make_unique<DeviceSession>(std::move(source), mouse,
                                         !mouse || arguments.devices.size() > 1);
}

std::unique_ptr<SessionSource> MakeSession(const Arguments& arguments) {
  if (arguments.script.empty()) return MakeDevice(arguments);
  Script script = ReadScript(arguments.script);
  if (arguments.source.empty()) return std::make_unique<ScriptedSession>(std::move(script));
  return std::make_unique<PacedSession>(MakeDevice(arguments), std::move(script));
}

// What a person is asked before the session, with the given as answers in brackets.
void AskForReference(ProcedureSettings& settings) {
  const auto ask = [](const char* question, double& value) {
    for (;;) {
      char text[160];
      std::snprintf(text, sizeof text, "%s [%g]:", question, value);
      const std::string answer = Ask(text);
      if (answer.empty()) return;
      try {
        value = Number("", answer);
        return;
      } catch (const UserError&) {
        std::printf("'%s' is no number.\n", answer.c_str());
      }
    }
  };
  ask(settings.ruler ? "How far will you push along the ruler, mm"
                     : "How far is it from the near stop to the far stop, mm",
      settings.length_mm);
  ask(settings.ruler ? "By how much may one reading be off, mm" : "By how much may that be off, mm",
      settings.length_error_mm);
}

// The procedure, its source and the terminal.
class Session : public SessionSink {
 public:
  Session(const ProcedureSettings& settings, Terminal& terminal)
      : procedure_(settings), terminal_(terminal) {}

  // False when it was given up.
  bool Run(SessionSource& source) {
    while (!quit_ && interrupted == 0 && procedure_.step() != Step::kDone) {
      ShowPrompt();
      source.Wait(20, *this);
      while (const std::optional<char> key = terminal_.Key()) TakeKey(*key);
      ShowMessages();
      ShowNumbers();
    }
    terminal_.Change("");
    return procedure_.step() == Step::kDone && interrupted == 0;
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
  void Tell(const std::string& text) override { terminal_.Print("  -- " + text); }
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
    std::string text = prompt.title;
    if (prompt.wanted > 0) {
      text += " " + std::to_string(prompt.done) + "/" + std::to_string(prompt.wanted);
    }
    text += ": " + prompt.instruction + ".";
    if (text == shown_ || prompt.step == Step::kDone) return;
    shown_ = text;
    terminal_.Print(text);
  }

  void ShowNumbers() {
    const HandMotion moved = procedure_.SinceMark();
    char text[200];
    std::snprintf(text, sizeof text,
                  "     %s%+8.2f mm %+7.1f deg | counts %lld axial, %lld transverse | quality %d%s",
                  procedure_.prompt().marking ? "hold still .. " : "", moved.insertion_mm,
                  moved.rotation_rad * 180.0 / std::numbers::pi,
                  static_cast<long long>(last_.axial_counts),
                  static_cast<long long>(last_.transverse_counts), last_.surface_quality,
                  last_.faulty   ? ", no answer"
                  : last_.lifted ? ", lifted"
                                 : "");
    terminal_.Change(text);
  }

  Procedure procedure_;
  Terminal& terminal_;
  Reading last_;
  std::string shown_;
  bool quit_ = false;
};

std::string Note(const ProcedureResult& result, const ProcedureSettings& settings) {
  int pushes = 0;
  int turns = 0;
  for (std::size_t i = 0; i < result.strokes.size(); ++i) {
    if (result.rejections[i]) continue;
    ++(result.strokes[i].stroke.kind == MotionKind::kPush ? pushes : turns);
  }
  const std::time_t now = std::time(nullptr);
  std::tm date{};
  localtime_r(&now, &date);
  char text[240];
  std::snprintf(text, sizeof text,
                "%04d-%02d-%02d: %d pushes of %g mm +- %g mm %s, %d x %d turns; rest %s, lift %s, "
                "joystick %s",
                date.tm_year + 1900, date.tm_mon + 1, date.tm_mday, pushes, settings.length_mm,
                settings.length_error_mm, settings.ruler ? "by a ruler" : "between stops", turns,
                settings.turns, result.rest_checked ? "checked" : "not checked",
                result.lift_checked ? "checked" : "not checked",
                result.joystick_measured ? "measured" : "nominal");
  return text;
}

void MakeFolderOf(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw UserError(folder.string() + ": cannot be made: " + error.message());
}

int Finish(const Arguments& arguments, const ProcedureSettings& settings, const DeviceFacts& facts,
           ProcedureResult result, const std::string& path, int columns) {
  std::printf(
      "\n%s at %d cpi (95 %% intervals):\n%s\nReference less model, stroke by stroke:\n%s\n%s",
      facts.serial.c_str(), settings.cpi, ParameterTable(result).c_str(),
      ResidualChart(result, columns).c_str(), Verdict(result, settings).c_str());
  if (GradeOf(result.fit) == Grade::kPoor) return kTooPoor;
  result.calibration.device = facts.serial;
  result.calibration.note = Note(result, settings);
  MakeFolderOf(path);
  const std::string plot = arguments.plot.empty()
                               ? std::filesystem::path(path).replace_extension(".svg").string()
                               : arguments.plot;
  torquer::WriteFileAtomically(plot,
                               ResidualPicture(result, "Calibration of " + facts.serial + ", " +
                                                           result.calibration.note.substr(0, 10)));
  WriteCalibration(result.calibration, path);
  std::printf("Kept as %s, drawn in %s.\n", path.c_str(), plot.c_str());
  return 0;
}

// From here on there is a terminal to put back and a session to give up. Without SA_RESTART, so
// that waiting ends.
void HandleSignals() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = 1; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

int Run(const Arguments& arguments) {
  ProcedureSettings settings = arguments.settings;
  const std::unique_ptr<SessionSource> source = MakeSession(arguments);
  static_cast<void>(Procedure(settings));  // what cannot be used is said before anything is done
  if (!arguments.length_given && arguments.script.empty() && CanAsk()) AskForReference(settings);

  const DeviceFacts facts = source->Connect();
  HandleSignals();
  settings.cpi = facts.cpi;
  settings.cpi_known = settings.tells_lift = !facts.ordinary_mouse;
  settings.has_joystick = facts.has_joystick;
  const std::string path =
      arguments.output.empty() ? CalibrationPath(facts.serial) : arguments.output;
  std::printf("Device %s at %d cpi%s; the calibration will be %s\n", facts.serial.c_str(),
              facts.cpi, facts.ordinary_mouse ? " (a guess: it is measured now)" : "",
              path.c_str());

  if (arguments.script.empty()) {
    std::printf(
        "Keys: Enter marks a place (so does the X-ray button), u forgets the last stroke,\n"
        "s skips a step, q gives up.\n");
  }
  Terminal terminal;
  Session session(settings, terminal);
  if (!session.Run(*source)) {
    terminal.Print("Given up; nothing was written.");
    return kGivenUp;
  }
  return Finish(arguments, settings, facts, session.procedure().Result(), path, terminal.columns());
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Arguments arguments = Parse(argc, argv);
    if (arguments.help) {
      std::fputs(kUsage, stdout);
      return 0;
    }
    return Run(arguments);
  } catch (const UserError& error) {
    std::fprintf(stderr, "torquer-calibrate: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
