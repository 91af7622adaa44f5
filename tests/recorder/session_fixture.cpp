#include "tests/recorder/session_fixture.h"

#include <cmath>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer::test {
namespace {

constexpr std::int64_t kClock = 77;
constexpr std::int64_t kStartUs = 5'000'000;
constexpr double kCarriedMm = 0.25;
constexpr double kCarriedRad = 0.5;

class LogWriter {
 public:
  explicit LogWriter(const std::string& path) : log_(path, "w") {}

  template <class Message>
  void Write(const char* channel, std::int64_t time_us, const Message& message, int cut = 0) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event{};
    event.timestamp = time_us;
    event.channel = channel;
    event.data = bytes.data();
    event.datalen = static_cast<int>(bytes.size()) - cut;
    log_.writeEvent(&event);
  }

 private:
  lcm::LogFile log_;
};

torquer_lcm::scene_description_t Scene(const SessionFaults& faults) {
  torquer_lcm::scene_description_t scene{};
  scene.name = "made_up";
  scene.scene_file = "made_up.toml";
  scene.method = "paper";
  scene.vessel = "tube <r 3>";
  scene.segment_mm = 1;
  if (faults.course) scene.effects = {"wall_force", "assessment", "contrast", "fluoroscopy"};
  scene.effect_count = static_cast<std::int32_t>(scene.effects.size());
  scene.instruments = {protocol::kGuidewire};
  scene.inserted_at_start_mm = {kInsertedAtStartMm};
  if (faults.catheter) {
    scene.instruments.emplace_back("catheter");
    scene.inserted_at_start_mm.push_back(kCatheterAtStartMm);
  }
  scene.instrument_count = static_cast<std::int32_t>(scene.instruments.size());
  scene.radius_mm.resize(scene.instruments.size());
  scene.inner_radius_mm.resize(scene.instruments.size());
  scene.max_length_mm.resize(scene.instruments.size());
  scene.left[0] = 1;
  scene.posterior[1] = 1;
  scene.superior[2] = 1;
  return scene;
}

// Instrument on a straight line towards the patient's head and left. Its tip lies at `length_mm`
// minus the carried length.
torquer_lcm::instrument_state_t Instrument(const std::string& name, double length_mm) {
  torquer_lcm::instrument_state_t instrument{};
  instrument.name = name;
  instrument.carried_mm = kCarriedMm;
  instrument.insertion_mm = length_mm - kCarriedMm;
  instrument.tip_mm[0] = 0.6 * instrument.insertion_mm;
  instrument.tip_mm[2] = 0.8 * instrument.insertion_mm;
  return instrument;
}

// Lays an instrument along x, on a curve of two segments.
void LayBeside(torquer_lcm::instrument_state_t& instrument) {
  instrument.tip_mm[0] = instrument.insertion_mm;
  instrument.tip_mm[1] = instrument.tip_mm[2] = 0;
  const auto end_mm = static_cast<float>(instrument.insertion_mm);
  instrument.nodes_mm = {{0, 0, 0}, {end_mm / 2, 0, 0}, {end_mm, 0, 0}};
  instrument.node_count = 3;
}

// State with the curve as far as the guidewire reaches.
torquer_lcm::wire_state_t State(double length_mm) {
  torquer_lcm::wire_state_t state{};
  state.instruments = {Instrument(protocol::kGuidewire, length_mm)};
  state.segment_count = 3;
  state.stride = 1;
  const double fed_mm = state.instruments[0].insertion_mm;
  for (int i = 0; i <= state.segment_count; ++i) {
    const double along = fed_mm * i / state.segment_count;
    state.nodes_mm.push_back(
        {static_cast<float>(0.6 * along), 0.0F, static_cast<float>(0.8 * along)});
  }
  state.node_count = static_cast<std::int32_t>(state.nodes_mm.size());
  state.contact_nodes = {2};
  state.contact_penetrations_um = {7.0F};
  state.contact_count = 1;
  return state;
}

// Writes the messages of the catheter's box at report `i`.
void WriteCatheterBox(LogWriter& log, const SessionFaults& faults, int i) {
  const std::int64_t now_us = kStartUs + 1000 * i;
  torquer_lcm::instrument_command_t command{};
  command.instrument = "catheter";
  command.sequence = 7000 + i;
  command.clock_id = kClock;
  command.origin_us = now_us;
  log.Write(protocol::kInstrumentCommandChannel, now_us, command);
  torquer_lcm::device_sample_t sample{};
  sample.device = kCatheterBox;
  sample.instrument = "catheter";
  sample.clock_id = kClock;
  sample.receive_us = sample.origin_us = now_us;
  sample.report_number = i + (i > 300 ? faults.catheter_lost_reports : 0);
  sample.boot_id = 9;
  sample.axial_counts = i;
  log.Write(protocol::kDeviceSampleChannel, now_us, sample);
}

// Writes the final counts of daemon and emulator for a box.
void WriteCounts(LogWriter& log, const SessionFaults& faults, const std::string& device,
                 const std::string& instrument, int lost_reports, int unfetched_reports,
                 std::int64_t axial_counts, std::int64_t transverse_counts) {
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.device = device;
  health.instrument = instrument;
  health.names = {"reports_received", "reports_lost", "healed_um"};
  health.values = {kReports, lost_reports + unfetched_reports, faults.healed_um};
  health.count = 3;
  health.publish_us = kStartUs + 1000 * kReports;
  if (faults.ended) health.state = "stopping";
  log.Write(protocol::kHealthChannel, kStartUs, health);
  if (faults.without_emulator) return;
  torquer_lcm::hand_motion_t truth{};
  truth.device = device;
  truth.publish_us = health.publish_us;
  truth.time_s = 1e-3 * kReports;
  truth.reports_sent = kReports + lost_reports;
  truth.axial_counts = axial_counts;
  truth.transverse_counts = transverse_counts;
  log.Write(protocol::kEmulatorTruthChannel, kStartUs, truth);
}

// Writes the running counts of daemon and emulator after report `i`.
void WriteRunningCounts(LogWriter& log, int i, const torquer_lcm::device_sample_t& sample) {
  if (i % 10 == 0) {
    torquer_lcm::hand_motion_t truth{};
    truth.device = kBox;
    truth.publish_us = sample.receive_us;
    truth.time_s = 1e-3 * i;
    truth.reports_sent = i + 1 + kReportsAhead;
    truth.axial_counts = sample.axial_counts + 2 * kReportsAhead;
    truth.transverse_counts = sample.transverse_counts - kReportsAhead;
    log.Write(protocol::kEmulatorTruthChannel, sample.receive_us, truth);
  }
  if (i % 250 == 249) {
    torquer_lcm::health_t health{};
    health.process = "daemon";
    health.device = kBox;
    health.instrument = protocol::kGuidewire;
    health.state = "running";
    health.publish_us = sample.receive_us;
    health.names = {"reports_received", "reports_lost"};
    health.values = {i + 1, 0};
    health.count = 2;
    log.Write(protocol::kHealthChannel, sample.receive_us, health);
  }
}

void WriteEvents(LogWriter& log) {
  torquer_lcm::readings_t readings{};
  readings.names = {"wall_force_events", "wall_force_largest_ever_mN"};
  readings.count = 2;
  for (const double events : {1.0, 4.0}) {
    readings.values = {events, 2.5 * events};
    readings.publish_us = kStartUs + static_cast<std::int64_t>(1000 * events);
    log.Write(protocol::kReadingsChannel, kStartUs, readings);
  }
}

// Readings of an assessment at a time of the session.
torquer_lcm::readings_t CourseReadings(double time_s) {
  const bool peaked = time_s > 0.42;
  const bool reached = time_s >= 0.7;
  torquer_lcm::readings_t readings{};
  readings.time_s = time_s;
  readings.publish_us = kStartUs + static_cast<std::int64_t>(1e6 * time_s);
  readings.names = {"wall_force_largest_mN",
                    "wall_force_largest_ever_mN",
                    "wall_force_events",
                    "wall_force_above_s",
                    "wall_tip_pressure_ever_kPa",
                    "procedure_s",
                    "fluoroscopy_s",
                    "kerma_area_Gy_cm2",
                    "contrast_injected_mL",
                    "tip_path_mm",
                    "retractions",
                    "retracted_mm",
                    "wrong_vessel_entries",
                    "log_dimensionless_jerk",
                    "target_reached",
                    "target_reached_s",
                    "safe_success"};
  readings.values = {20,
                     peaked ? 80.0 : 20.0,
                     3,
                     0.4,
                     12.25,
                     time_s,
                     0.25,
                     0.875,
                     1.5,
                     36,
                     2,
                     7.5,
                     1,
                     -9.5,
                     reached ? 1.0 : 0.0,
                     reached ? 0.7 : std::nan(""),
                     reached ? 1.0 : 0.0};
  readings.count = static_cast<std::int32_t>(readings.names.size());
  return readings;
}

}  // namespace

void WriteSession(const std::string& path, const SessionFaults& faults) {
  LogWriter log(path);
  log.Write(protocol::kSceneChannel, kStartUs, Scene(faults));
  std::int64_t moved_counts = 0;
  bool was_held = false;
  for (int i = 0; i < kReports; ++i) {
    const std::int64_t now_us = kStartUs + 1000 * i;
    torquer_lcm::device_sample_t sample{};
    sample.device = kBox;
    sample.instrument = protocol::kGuidewire;
    sample.clock_id = kClock;
    sample.receive_us = now_us;
    sample.report_number = i + (i > 300 ? faults.lost_reports + faults.unfetched_reports : 0);
    sample.origin_us = now_us;
    const bool restarted = faults.reset && i >= 800;
    sample.boot_id = restarted ? 2 : 1;
    sample.axial_counts = 100 + 2 * (restarted ? i - 800 : i);
    sample.transverse_counts = -(restarted ? i - 800 : i);
    const bool clutch = i >= 500 && i < 600;
    sample.buttons = clutch ? protocol::kButtonClutch : 0;
    const bool poor_surface = faults.poor_surface && i >= 200 && i < 300;
    const bool held = clutch || poor_surface;
    if (i > 0 && !held && !was_held && !(restarted && i == 800)) moved_counts += 2;
    was_held = held;

    torquer_lcm::instrument_command_t command{};
    command.instrument = protocol::kGuidewire;
    command.sequence = i;
    command.clock_id = kClock;
    command.origin_us = now_us;
    command.publish_us = now_us;
    command.xray = faults.course && ((i >= 200 && i < 400) || (i >= 600 && i < 650));
    command.contrast = faults.course && i >= 300 && i < 350;
    command.flags = poor_surface ? protocol::kCommandLift : 0;
    log.Write(protocol::kInstrumentCommandChannel, now_us, command);
    log.Write(protocol::kDeviceSampleChannel, now_us, sample);
    if (faults.catheter && faults.catheter_box) WriteCatheterBox(log, faults, i);
    if (faults.running_counts) WriteRunningCounts(log, i, sample);

    torquer_lcm::wire_state_t state =
        State(kInsertedAtStartMm + kMmPerCount * static_cast<double>(moved_counts) +
              faults.extra_wire_mm);
    state.tick = i + (i > 700 ? faults.lost_states : 0);
    state.clock_id = faults.foreign_clock ? kClock + 1 : kClock;
    state.publish_us = now_us + (i < 990 ? 1000 : 5000);
    state.instruments[0].command_sequence = i;
    state.instruments[0].origin_us = now_us;
    state.instruments[0].rotation_rad =
        -kRadPerCount * static_cast<double>(moved_counts) / 2 - kCarriedRad;
    state.instruments[0].carried_rad = kCarriedRad;
    if (faults.catheter) {
      // Without a box the catheter does not move.
      const int counts = faults.catheter_box ? i : 0;
      state.instruments.push_back(Instrument(
          "catheter", kCatheterAtStartMm + kMmPerCount * counts + faults.extra_catheter_mm));
      state.instruments[1].command_sequence = faults.catheter_box ? 7000 + i : -1;
      state.instruments[1].origin_us = now_us - 2000;
      if (faults.beside) LayBeside(state.instruments[1]);
    }
    state.instrument_count = static_cast<std::int32_t>(state.instruments.size());
    state.max_penetration_um = i == 400 ? 12.5 : 3;
    state.solve_us = 100;
    state.time_s = 1e-3 * i;
    state.status = i >= 100 && i < 110 ? protocol::kWireBudgetSpent : protocol::kWireConverged;
    state.residual = i == 500 ? 3e-7 : 1e-7;
    const bool cut = faults.undecodable && i == 42;
    log.Write(protocol::kWireStateChannel, now_us, state, cut ? 9 : 0);
    if (faults.course && i % 50 == 0) {
      torquer_lcm::readings_t readings = CourseReadings(state.time_s);
      readings.tick = state.tick;
      log.Write(protocol::kReadingsChannel, now_us, readings);
    }
    if (faults.repeated_states) {
      state.publish_us += 200'000;
      log.Write(protocol::kWireStateChannel, now_us, state);
    }
  }
  if (!faults.course) WriteEvents(log);
  WriteCounts(log, faults, kBox, protocol::kGuidewire, faults.lost_reports,
              faults.unfetched_reports, 100 + kSensorCounts, -(kReports - 1));
  if (faults.catheter && faults.catheter_box) {
    WriteCounts(log, faults, kCatheterBox, "catheter", faults.catheter_lost_reports, 0,
                kReports - 1, 0);
  }
}

}  // namespace torquer::test
