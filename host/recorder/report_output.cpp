#include "host/recorder/report_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "host/bus/event_times.h"
#include "host/recorder/json_values.h"
#include "host/recorder/page_text.h"
#include "host/recorder/session_summary.h"
#include "host/support/angle.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

constexpr double kReportsPerSecond = 1000;  // report rate of a device, Hz
constexpr double kRealTime = 0.97;          // least share of this rate for real time

Eigen::Vector3d Vector(const double (&values)[3]) { return {values[0], values[1], values[2]}; }

std::vector<Eigen::Vector3d> Points(const std::vector<std::vector<float>>& nodes_mm) {
  std::vector<Eigen::Vector3d> points;
  for (const auto& node : nodes_mm) points.emplace_back(node[0], node[1], node[2]);
  return points;
}

std::string KnownCount(const std::optional<std::int64_t>& count) {
  return count ? std::to_string(*count) : "?";
}

std::string MsText(double value) {
  return std::isnan(value) ? "not known" : ValueText(value) + " ms";
}

// Differences below a thousandth are rounding.
double Rounded(double value) { return std::round(1e3 * value) / 1e3; }

// A motion that is printed as zero gets a plus sign.
std::string Signed(double value) {
  const double rounded = Rounded(value);
  return (rounded < 0 ? "-" : "+") + ValueText(std::abs(rounded));
}

std::string CountsText(double counts) { return ValueText(Rounded(counts)) + " counts"; }

std::string LatencyText(const Distribution& latency_ms) {
  if (latency_ms.count == 0) return "not known";
  return fmt::format("p50 {} ms, p99 {} ms, p99.9 {} ms, max {} ms", ValueText(latency_ms.p50),
                     ValueText(latency_ms.p99), ValueText(latency_ms.p999),
                     ValueText(latency_ms.max));
}

std::string FormatInstrument(const InstrumentReport& report) {
  std::string text =
      fmt::format("  {}, driven by device {}\n", Printable(report.name), Printable(report.device));
  text +=
      fmt::format("    reports    {} sent, {} received, {} lost\n", KnownCount(report.reports_sent),
                  KnownCount(report.reports_received), KnownCount(report.reports_lost));
  if (report.reports_unfetched.value_or(0) > 0) {
    text += fmt::format(
        "               {} of the lost were not fetched in time; the next report contained their "
        "motion\n",
        *report.reports_unfetched);
  }
  text += fmt::format(
      "    insertion  sensor {:+} counts ({:+} of them held), which is {} mm; {} {} mm: "
      "{} apart\n",
      report.axial.sensor_counts, report.axial.held_counts, Signed(report.axial.hand),
      Printable(report.name), Signed(report.axial.wire), CountsText(report.axial.error_counts));
  if (report.healed_mm.value_or(0) != 0) {
    text += fmt::format("               {} mm were lost, and corrected at the end switch\n",
                        Signed(*report.healed_mm));
  }
  text += fmt::format(
      "    rotation   sensor {:+} counts ({:+} of them held), which is {} deg; {} {} deg: "
      "{} apart\n",
      report.rotation.sensor_counts, report.rotation.held_counts,
      Signed(report.rotation.hand * kDegreesPerRad), Printable(report.name),
      Signed(report.rotation.wire * kDegreesPerRad), CountsText(report.rotation.error_counts));
  text += "    latency    sensor to wire state: " + LatencyText(report.latency_ms) + "\n";
  const double expected = kReportsPerSecond * report.duration_s;
  if (report.resets > 0) {
    // Its counts began again, so they do not show the speed of the machine.
    text += fmt::format("               the device restarted {} during the session\n",
                        TimesText(static_cast<double>(report.resets)));
  } else if (report.reports_sent &&
             static_cast<double>(*report.reports_sent) < kRealTime * expected) {
    text += fmt::format(
        "               the machine was too busy for real time: the device's {} took {}\n",
        SecondsText(static_cast<double>(*report.reports_sent) / kReportsPerSecond),
        SecondsText(report.duration_s));
  }
  return text;
}

nlohmann::ordered_json InstrumentJson(const InstrumentReport& report) {
  // Without a device the log does not have the motion of the hand.
  const auto of_device = [&report](double value) {
    return report.driven() ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
  };
  return {{"name", report.name},
          {"device", report.device},
          {"reports_sent", OrNull(report.reports_sent)},
          {"reports_received", OrNull(report.reports_received)},
          {"reports_lost", OrNull(report.reports_lost)},
          {"reports_unfetched", OrNull(report.reports_unfetched)},
          {"healed_mm", OrNull(report.healed_mm)},
          {"motion_error_counts", of_device(report.axial.error_counts)},
          {"rotation_error_counts", of_device(report.rotation.error_counts)},
          {"insertion_mm", of_device(report.axial.wire)},
          {"rotation_rad", of_device(report.rotation.wire)},
          {"latency_ms_p50", report.latency_ms.p50},
          {"latency_ms_p99", report.latency_ms.p99},
          {"latency_ms_p999", report.latency_ms.p999},
          {"latency_ms_max", report.latency_ms.max}};
}

nlohmann::ordered_json MarksJson(const MarkSheet& sheet) {
  nlohmann::ordered_json marks = nlohmann::ordered_json::array();
  for (const Mark& mark : sheet.marks) {
    marks.push_back({{"name", mark.name},
                     {"at_most", OrNull(mark.most)},
                     {"value", OrNull(mark.value)},
                     {"passed", OrNull(mark.passed)}});
  }
  return marks;
}

std::string FormatMarks(const MarkSheet& sheet) {
  std::string text =
      fmt::format("  pass marks   {}, by {}\n", PassedText(sheet.Passed()), Printable(sheet.file));
  for (const Mark& mark : sheet.marks) {
    text += fmt::format("               {}: {}; {}: {}\n", mark.label, mark.found, mark.limit,
                        PassedText(mark.passed));
  }
  return text;
}

std::string TextOf(const torquer_lcm::readings_t& readings, const std::string& name, double value) {
  return bus::NeverHappened(readings, name) ? kNever : ReadingText(name, value);
}

// "; expert run VALUE"; "" without an expert run that knows the reading.
std::string ExpertText(const SessionReport& report, const std::string& name) {
  if (!report.expert) return "";
  if (bus::NeverHappened(report.expert->readings, name))
    return std::string("; expert run ") + kNever;
  const std::optional<double> value = FindReading(report.expert->readings, name);
  return value ? "; expert run " + ReadingText(name, *value) : "";
}

nlohmann::ordered_json ReadingsJson(const torquer_lcm::readings_t& readings) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < readings.names.size(); ++i) {
    json[readings.names[i]] = readings.values[i];
  }
  return json;
}

nlohmann::ordered_json ExpertJson(const SessionReport& report) {
  if (!report.expert) return nullptr;
  return {{"script", report.expert->file}, {"readings", ReadingsJson(report.expert->readings)}};
}

// Time per phase, motion without X-ray, and the rate of the dose.
std::string FormatPhases(const SessionSummary& summary) {
  std::string text;
  const auto add = [&text](const char* name, const std::optional<double>& value) {
    if (!value) return;
    text += fmt::format("  {:<13}{} {}\n", text.empty() ? "phases" : "", name,
                        ReadingText(name, *value));
  };
  add("before_motion_s", summary.before_motion_s);
  add("on_the_way_s", summary.on_the_way_s);
  add("after_target_s", summary.after_target_s);
  add("blind_s", summary.blind_s);
  add("blind_mm", summary.blind_mm);
  add("air_kerma_mGy_min", summary.air_kerma_mGy_min);
  return text;
}

nlohmann::ordered_json PhasesJson(const SessionSummary& summary) {
  return {{"before_motion_s", OrNull(summary.before_motion_s)},
          {"on_the_way_s", OrNull(summary.on_the_way_s)},
          {"after_target_s", OrNull(summary.after_target_s)}};
}

nlohmann::ordered_json InjectionsJson(const SessionCourse& course) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const PowerInjection& injection : course.injections()) {
    all.push_back({{"start_s", injection.start_s},
                   {"volume_mL", injection.volume_mL},
                   {"rate_mL_s", injection.rate_mL_s},
                   {"delivered_mL", injection.delivered_mL},
                   {"complete", injection.complete()},
                   {"aborted", injection.aborted}});
  }
  return all;
}

nlohmann::ordered_json ExchangesJson(const SessionReport& report) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const ReportExchange& exchange : report.exchanges) {
    all.push_back({{"time_s", exchange.time_s},
                   {"instrument", Printable(exchange.instrument)},
                   {"device", Printable(exchange.device)}});
  }
  return all;
}

// Adds all figures of a single wire, but only the decisive ones for each of several instruments.
void AddFigures(const InstrumentReport& report, bool lone, PictureCaption& caption) {
  const std::string apart = CountsText(report.axial.error_counts);
  if (!lone) {
    caption.figures.emplace_back(fmt::format("{} against sensor, {} lost", Printable(report.name),
                                             KnownCount(report.reports_lost)),
                                 apart);
    return;
  }
  caption.figures.insert(caption.figures.end(),
                         {{"reports sent", KnownCount(report.reports_sent)},
                          {"reports lost", KnownCount(report.reports_lost)},
                          {"wire against sensor", apart},
                          {"sensor to wire state, p50", MsText(report.latency_ms.p50)},
                          {"sensor to wire state, p99", MsText(report.latency_ms.p99)}});
}

}  // namespace

std::string FormatReport(const SessionReport& report) {
  std::string text = fmt::format(
      "{} of {} in {}, {} method\n", report.examination ? "Examination" : "Session",
      SecondsText(report.duration_s), Printable(report.scene), Printable(report.method));
  for (const InstrumentReport& instrument : report.instruments) {
    text += instrument.driven() ? FormatInstrument(instrument)
                                : fmt::format("  {}, driven by no device; {} commands\n",
                                              Printable(instrument.name), instrument.commands);
  }
  text += fmt::format("  relaxation   p50 {} us, p99 {} us, max {} us a tick; {} states\n",
                      ValueText(report.solve_us.p50), ValueText(report.solve_us.p99),
                      ValueText(report.solve_us.max), report.states);
  text += fmt::format("  wire         {} nodes, residual {}, largest penetration {} um\n",
                      report.last_state.segment_count + 1, ValueText(report.residual),
                      ValueText(report.max_penetration_um));
  if (report.shapes < report.states) {
    text += fmt::format(
        "  shapes       of {} of the states; hashes, positions and tips of all states\n",
        report.shapes);
  }
  for (std::size_t i = 0; i < report.readings.names.size(); ++i) {
    const std::string& name = report.readings.names[i];
    text += fmt::format("  {:<13}{} {}{}\n", i == 0 ? "readings" : "", Printable(name),
                        TextOf(report.readings, name, report.readings.values[i]),
                        ExpertText(report, name));
  }
  text += FormatPhases(Summarize(report));
  for (const ReportExchange& exchange : report.exchanges) {
    text += fmt::format("  exchange     {} for {}, at {}\n", Printable(exchange.instrument),
                        Printable(exchange.device), SecondsText(exchange.time_s));
  }
  if (report.judged) {
    text += "               from a replay of the commands at full accuracy\n";
  }
  if (!report.not_gradable.empty()) {
    text += fmt::format("  marks        none, not gradable: {}\n", Printable(report.not_gradable));
  }
  if (report.marks) text += FormatMarks(*report.marks);
  if (report.states_missing > 0 || report.undecodable > 0) {
    text += fmt::format("  log          {} states missing, {} messages undecodable\n",
                        report.states_missing, report.undecodable);
  }
  for (const auto* const lines : {&report.gaps, &report.silences}) {
    for (const std::string& line : *lines) text += fmt::format("  log          {}\n", line);
  }
  for (const auto& [channel, count] : report.unknown) {
    text += fmt::format("  log          {} messages of an unknown channel, {}\n", count,
                        Printable(channel));
  }
  if (report.first_tick > 0) {
    text += fmt::format("  log          begins with tick {}; motion is judged from there\n",
                        report.first_tick);
  }
  if (!report.ended) {
    text += "  log          ends before the session; judged up to its last state\n";
  }
  if (report.ticks_after_shape > 0) {
    text += fmt::format(
        "  log          ends {} ticks after its last shape, by which motion is judged\n",
        report.ticks_after_shape);
  }
  if (report.damage.any())
    text += fmt::format("  log          damaged: {}\n", report.damage.Describe());
  return text;
}

std::string FormatReportJson(const SessionReport& report, const std::string& picture,
                             const std::string& page) {
  nlohmann::ordered_json instruments = nlohmann::ordered_json::array();
  for (const InstrumentReport& instrument : report.instruments) {
    instruments.push_back(InstrumentJson(instrument));
  }
  nlohmann::ordered_json not_gradable;
  if (!report.not_gradable.empty()) not_gradable = report.not_gradable;
  nlohmann::ordered_json passed;
  nlohmann::ordered_json marks = nlohmann::ordered_json::array();
  if (report.marks) {
    passed = OrNull(report.marks->Passed());
    marks = MarksJson(*report.marks);
  }
  const SessionSummary summary = Summarize(report);
  const nlohmann::ordered_json json = {{"scene", report.scene},
                                       {"trainee", report.trainee},
                                       {"group", report.group},
                                       {"examination", report.examination},
                                       {"method", report.method},
                                       {"duration_s", report.duration_s},
                                       {"instruments", std::move(instruments)},
                                       {"solve_us_p50", report.solve_us.p50},
                                       {"solve_us_p99", report.solve_us.p99},
                                       {"max_penetration_um", report.max_penetration_um},
                                       {"nodes", report.last_state.segment_count + 1},
                                       {"residual", report.residual},
                                       {"status", report.status},
                                       {"states", report.states},
                                       {"states_with_shape", report.shapes},
                                       {"states_missing", report.states_missing},
                                       {"undecodable", report.undecodable},
                                       {"gaps", report.gaps},
                                       {"silences", report.silences},
                                       {"unknown_channels", report.unknown},
                                       {"log_ended", report.ended},
                                       {"log_damage", report.damage.Describe()},
                                       {"readings", ReadingsJson(report.readings)},
                                       {"injections", InjectionsJson(report.course)},
                                       {"exchanges", ExchangesJson(report)},
                                       {"phases", PhasesJson(summary)},
                                       {"blind_s", OrNull(summary.blind_s)},
                                       {"blind_mm", OrNull(summary.blind_mm)},
                                       {"air_kerma_mGy_min", OrNull(summary.air_kerma_mGy_min)},
                                       {"judged", report.judged},
                                       {"not_gradable", std::move(not_gradable)},
                                       {"passed", std::move(passed)},
                                       {"marks", std::move(marks)},
                                       {"expert", ExpertJson(report)},
                                       {"picture", picture},
                                       {"page", page}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string DrawReport(const SessionReport& report, const PictureVessel& vessel, bool tip_way) {
  const torquer_lcm::wire_state_t& state = report.last_state;
  if (state.nodes_mm.size() < 2 || state.instruments.empty()) {
    throw UserError("the last wire state has " + std::to_string(state.nodes_mm.size()) +
                    " nodes and " + std::to_string(state.instruments.size()) +
                    " instruments; a picture needs 2 and 1");
  }
  PictureWire wire;
  wire.nodes_mm = Points(state.nodes_mm);
  for (std::size_t i = 0; i < state.contact_nodes.size(); ++i) {
    const auto node = static_cast<std::size_t>(state.contact_nodes[i] / std::max(state.stride, 1));
    if (node < wire.nodes_mm.size()) {
      wire.contacts.push_back(
          {wire.nodes_mm[node], static_cast<double>(state.contact_penetrations_um[i])});
    }
  }
  if (tip_way) wire.tip_way_mm = report.course.tip_way_mm();
  const torquer_lcm::scene_description_t& scene = report.description;
  const PatientAxes axes{Vector(scene.left), Vector(scene.posterior), Vector(scene.superior)};
  PictureCaption caption;
  caption.title = Printable(report.scene);
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    wire.instruments.push_back(
        {Printable(instrument.name), instrument.insertion_mm, Points(instrument.nodes_mm)});
  }
  const std::string reach =
      wire.instruments.size() > 1
          ? ""
          : " · " + ValueText(state.instruments[0].insertion_mm) + " mm past the entry";
  caption.subtitle = fmt::format("{}{} · segments of {:g} mm · {} method", Printable(scene.vessel),
                                 reach, scene.segment_mm, Printable(report.method));
  for (const InstrumentReport& instrument : report.instruments) {
    if (instrument.driven()) AddFigures(instrument, wire.instruments.size() == 1, caption);
  }
  caption.figures.insert(caption.figures.end(),
                         {{"largest penetration", ValueText(report.max_penetration_um) + " um"},
                          {"nodes", std::to_string(state.segment_count + 1)},
                          {"residual", ValueText(report.residual)},
                          {"session", SecondsText(report.duration_s)}});
  return DrawSession(vessel, axes, wire, caption);
}

}  // namespace torquer
