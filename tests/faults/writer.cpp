#include "tests/faults/writer.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"

namespace torquer::test {
namespace {

namespace fs = std::filesystem;

constexpr int kRows = 40;
constexpr char kFormer[] = "what was there before\n";

// Input files of the programs.
struct Inputs {
  Inputs() {
    std::ofstream(scene.Beside("script.csv"))
        << "time_s,guidewire.insertion_mm\n"
        << [] {
             std::string rows;
             for (int row = 0; row < kRows; ++row) {
               rows += std::to_string(0.001 * row) + "," + std::to_string(0.05 * row) + "\n";
             }
             return rows;
           }();
    std::string strokes =
        "torquer-calibrate script 1\ndevice SCRIPTED-1 1200\nrest 2\nmark\nrest 0.3\n";
    for (int k = 0; k < 3; ++k) {
      strokes += "move 7087 124 0.5\nmark\nrest 0.3\nmove -7087 -124 0.5\nmark\nrest 0.3\n";
    }
    strokes += "skip raised\nmark\nrest 0.3\n";
    for (int k = 0; k < 3; ++k) {
      strokes += "move -52 2968 0.5\nmark\nrest 0.3\nmove 52 -2968 0.5\nmark\nrest 0.3\n";
    }
    std::ofstream(scene.Beside("strokes")) << strokes << "skip joystick\n";
    std::ofstream(scene.Beside("motion.csv"))
        << "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons\n0,0,0,0,0,none\n"
           "0.02,0.1,0,0,0,none\n";
    std::ofstream(scene.Beside("states.jsonl"))
        << "{\"time_s\": 0, \"nodes_mm\": [[0, 0, 0], [1, 0, 0]]}\n";
    vessel::WriteObj(scene.Beside("tube.obj"), vessel::MakeClosedTube());
    std::ofstream(scene.Beside("surface.toml"))
        << "name = \"x\"\n[vessel]\nkind = \"surface\"\nfile = \"tube.obj\"\nmesh_unit = \"mm\"\n"
           "voxel_mm = 0.5\nwall_stiffness_N_mm2 = 1\n[entry]\npoint_mm = [2, 0, 0]\n"
           "direction = [1, 0, 0]\n[[instrument]]\nname = \"guidewire\"\nmax_length_mm = 200\n"
           "radius_mm = 0.2\nrigidity_N_mm2 = 6e-3\n";
    WriteLog();
  }

  // Writes the log of a session that a page steered.
  void WriteLog() const {
    scene::Scene read(scene.path());
    simulator::Simulation simulation(read);
    EventLogWriter log(scene.Beside("session.lcmlog"));
    const auto write = [&log](std::int64_t at_us, const char* channel, const auto& message) {
      std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
      message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
      log.Write(1'700'000'000'000'000 + at_us, channel, bytes);
    };
    torquer_lcm::scene_description_t description{};
    description.name = "small";
    description.scene_file = scene.path();
    description.left[0] = description.posterior[1] = description.superior[2] = 1;
    description.instrument_count = 1;
    description.instruments = {"guidewire"};
    description.radius_mm = description.inner_radius_mm = description.max_length_mm =
        description.inserted_at_start_mm = {120};
    write(0, protocol::kSceneChannel, description);
    for (int tick = 0; tick <= 20; ++tick) {
      if (tick > 0) {
        simulator::Command command;
        command.target = read.start();
        command.target[0].insertion_mm += 0.1 * tick;
        command.time_s = 0.001 * tick;
        CountedBudget budget(30);
        simulation.Tick(command, budget);
      }
      torquer_lcm::instrument_command_t command{};
      command.instrument = "guidewire";
      command.sequence = tick;
      write(1000 * tick, protocol::kInstrumentCommandChannel, command);
      torquer_lcm::wire_state_t state{};
      simulation.Describe(state);
      state.publish_us = 1000 * tick;
      write(1000 * tick, protocol::kWireStateChannel, state);
    }
    log.Finish();
  }

  SceneFile scene{"[effects.wall_force]\nthreshold_mN = 20\n"};
};

const Inputs& SharedInputs() {
  static const Inputs inputs;
  return inputs;
}

std::string In(const std::string& name) { return SharedInputs().scene.Beside(name); }

// True if the archive begins and ends as a ZIP without a comment.
bool IsWholeZip(const std::string& text) {
  constexpr std::size_t kEndBytes = 22;
  return text.size() > kEndBytes && text.starts_with("PK\x03\x04") &&
         text.compare(text.size() - kEndBytes, 4, "PK\x05\x06") == 0;
}

bool IsTemporary(const std::string& name) {
  const std::string file = fs::path(name).filename();
  const std::string of_folder = *fs::path(name).begin();
  return file.starts_with(".torquer-") || of_folder.starts_with(".torquer-") ||
         (file.size() > 6 && file.find(".field.") != std::string::npos);
}

}  // namespace

const std::vector<Writer>& Writers() {
  static const std::vector<Writer> writers{
      {.name = "torquer-checksum-image",
       .words = {ProgramPath("torquer-checksum-image"), FirmwarePath("torquer-firmware.bare.bin"),
                 "@/trailer"},
       .former = {"trailer"}},
      {.name = "torquer-simulator with states and a record",
       .words = {ProgramPath("torquer-simulator"), "--scene", In("small.toml"), "--script",
                 In("script.csv"), "--states", "@/states", "--record", "@/record"},
       .former = {"states", "record"},
       .outputs = 2,
       .whole =
           [](const std::string& text) {
             const auto rows = std::count(text.begin(), text.end(), '\n');
             return text.ends_with("}\n") &&
                    (rows == kRows || text.starts_with("{\n  \"record_version"));
           },
       .whole_so_far =
           [](const std::string& text) { return text.empty() || text.ends_with("}\n"); }},
      {.name = "torquer-simulator with a cache of fields",
       .words = {"/usr/bin/env", "XDG_CACHE_HOME=@/cache", ProgramPath("torquer-simulator"),
                 "--scene", In("surface.toml"), "--script", In("script.csv"), "--states",
                 In("ignored")},
       .does_without = true,
       // The part of the field that a run builds ahead depends on its threads.
       .whole =
           [](const std::string& text) {
             constexpr std::size_t kFileBytesAt = 32;
             std::uint64_t bytes = 0;
             if (text.size() < kFileBytesAt + sizeof bytes) return false;
             std::memcpy(&bytes, text.data() + kFileBytesAt, sizeof bytes);
             return bytes == text.size();
           }},
      {.name = "torquer-simulator with a picture of a surface",
       .words = {ProgramPath("torquer-simulator"), "--check-mesh", In("tube.obj"), "--picture",
                 "@/tube.svg"},
       .former = {"tube.svg"}},
      {.name = "torquer-report with a picture",
       .words = {ProgramPath("torquer-report"), In("session.lcmlog"), "--json", "--picture",
                 "@/wire.svg"},
       .former = {"wire.svg"}},
      {.name = "torquer-report with a page",
       .words = {ProgramPath("torquer-report"), In("session.lcmlog"), "--page", "@/report.html"},
       .former = {"report.html"},
       .outputs = 2},
      {.name = "torquer-calibrate",
       .words = {ProgramPath("torquer-calibrate"), "--script", In("strokes"), "--pushes", "3",
                 "--turn-strokes", "3", "--play", "0.05", "--output", "@/calibration.toml"},
       .former = {"calibration.toml", "calibration.svg"},
       .outputs = 2},
      {.name = "torquer-study",
       .words = {ProgramPath("torquer-study"), "trace", In("small.toml"), In("script.csv"), "--out",
                 "@/results"},
       .outputs = 4,
       .whole = [](const std::string& text) { return !text.empty(); }},
      {.name = "torquer-emulator with an EEPROM",
       .words = {ProgramPath("torquer-emulator"), "--lcm-url", "none", "--fast", "--motion",
                 In("motion.csv"), "--socket", In("box"), "--eeprom", "@/eeprom"},
       .whole = [](const std::string& text) { return text.size() == 1024; }},
      {.name = "torquer-viewer with a token",
       .words = {ProgramPath("torquer-viewer"), "--token-file", "@/token"},
       .stays = true,
       .ready = "http://",
       .whole = [](const std::string& text) { return text.size() == 32; }},
      {.name = "torquer train",
       .words = {"/usr/bin/env", "PYTHONPATH=" + ProgramPath("../lib/python"), "/usr/bin/python3",
                 "-B", SourcePath("/tests/faults/short_training.py"), "@/policy.npz"},
       .refuses_existing = true,
       .whole = IsWholeZip},
      {.name = "torquer convert",
       .words = {"/usr/bin/env", "PYTHONPATH=" + ProgramPath("../lib/python"), "/usr/bin/python3",
                 "-B", "-m", "torquer", "convert", In("states.jsonl"), "@/wire.pvd"},
       .former = {"wire.pvd"},
       .outputs = 2,
       .refuses_existing = true},
      // The next run judges its claims: it must be able to use the existing file.
      {.name = "torquer-daemon with its last position",
       .words = {"/usr/bin/env", "XDG_RUNTIME_DIR=@", ProgramPath("torquer-daemon"), "--source",
                 "socket", "--socket", "/nowhere", "--uncalibrated"},
       .stays = true,
       .ready = "waiting for device",
       .whole = [](const std::string&) { return true; }},
  };
  return writers;
}

WriterBench::WriterBench(const Writer& writer) : writer_(writer) {
  for (const std::string& name : writer.former) std::ofstream(folder_.Path(name)) << kFormer;
}

Words WriterBench::Command() const {
  Words words = writer_.words;
  for (std::string& word : words) {
    if (const auto at = word.find('@'); at != std::string::npos) {
      word.replace(at, 1, folder_.Path());
    }
  }
  return words;
}

// Number of files under their final names; they may be renamed or removed meanwhile.
std::size_t WriterBench::WrittenFiles() const {
  std::size_t count = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator at(folder_.Path(), error), end; !error && at != end;
       at.increment(error)) {
    std::error_code gone;
    count += at->is_regular_file(gone) && !IsTemporary(at->path());
  }
  return count;
}

// A program that stays is ready when it has printed its text. If it printed an error, it ends by
// itself. Without such a text, any line will do. A program that prints no line at its start is
// ready some time after its files exist.
void WriterBench::EndOnceReady(ChildProcess& process) const {
  constexpr int kMostPauses = 1000;
  constexpr int kPausesWithFiles = 20;
  int with_files = 0;
  for (int k = 0; k < kMostPauses && with_files < kPausesWithFiles; ++k) {
    if (process.Ended()) return;
    const std::string printed = process.Output() + process.Error();
    if (!printed.empty() && printed.find(writer_.ready) != std::string::npos) break;
    with_files += writer_.outputs > 0 && WrittenFiles() >= writer_.outputs;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  process.Signal(SIGTERM);
}

WriterRun WriterBench::With(const Fault& fault) const {
  ChildProcess process(WithFault(fault, Command()));
  if (writer_.stays) EndOnceReady(process);
  const int status = process.Wait();
  return {status, process.Error()};
}

FilesByName WriterBench::Files() const {
  FilesByName files;
  for (const auto& entry : fs::recursive_directory_iterator(folder_.Path())) {
    if (!entry.is_regular_file()) continue;
    files[fs::relative(entry.path(), folder_.Path())] = Contents(entry.path());
  }
  return files;
}

void CheckFiles(const Writer& writer, const FilesByName& files, const FilesByName& reference,
                bool may_leave, const WriterRun& run) {
  const auto& oracle = run.status == 1 && writer.whole_so_far ? writer.whole_so_far : writer.whole;
  for (const auto& [name, text] : files) {
    CAPTURE(name);
    if (IsTemporary(name)) {
      CHECK(may_leave);
      continue;
    }
    // A .partial file holds the data that was complete when the disk failed; the message names it.
    if (name.ends_with(".partial")) {
      CHECK_THAT(run.said, Catch::Contains(name));
      continue;
    }
    const auto known = reference.find(name);
    REQUIRE(known != reference.end());
    const bool whole = oracle ? oracle(text) : text == known->second;
    CHECK((text == kFormer || whole));
  }
}

bool AllWhole(const Writer& writer, const FilesByName& files, const FilesByName& reference) {
  return std::all_of(reference.begin(), reference.end(), [&](const auto& one) {
    const auto found = files.find(one.first);
    if (found == files.end() || found->second == kFormer) return false;
    return writer.whole ? writer.whole(found->second) : found->second == one.second;
  });
}

}  // namespace torquer::test
