#include "host/recorder/report_output.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "host/support/error.h"

namespace torquer {
namespace {

constexpr double kDegreesPerRad = 180.0 / std::numbers::pi;
constexpr double kReportsPerSecond = 1000;  // a device's
constexpr double kRealTime = 0.97;          // of them that an emulator must make to be in real time

__attribute__((format(printf, 1, 2))) std::string Print(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  char text[512];
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

Eigen::Vector3d Vector(const double (&values)[3]) { return {values[0], values[1], values[2]}; }

std::string KnownCount(std::int64_t count) { return count < 0 ? "?" : std::to_string(count); }

}  // namespace

std::string FormatReport(const SessionReport& report) {
  std::string text = Print("Session of %.1f s in %s, %s method\n", report.duration_s,
                           report.scene.c_str(), report.method.c_str());
  text += Print(
      "  reports      %s sent, %s received, %s lost\n", KnownCount(report.reports_sent).c_str(),
      KnownCount(report.reports_received).c_str(), KnownCount(report.reports_lost).c_str());
  if (report.reports_unfetched > 0) {
    text += Print(
        "               %lld of the lost were not fetched in time; their motion came with the "
        "next\n",
        static_cast<long long>(report.reports_unfetched));
  }
  text += Print(
      "  insertion    sensor %+lld counts (%+lld of them held), which is %+.3f mm; "
      "wire %+.3f mm: %.2f counts apart\n",
      static_cast<long long>(report.axial.sensor_counts),
      static_cast<long long>(report.axial.held_counts), report.axial.hand, report.axial.wire,
      report.axial.error_counts);
  text += Print(
      "  rotation     sensor %+lld counts (%+lld of them held), which is %+.2f deg; "
      "wire %+.2f deg: %.2f counts apart\n",
      static_cast<long long>(report.rotation.sensor_counts),
      static_cast<long long>(report.rotation.held_counts), report.rotation.hand * kDegreesPerRad,
      report.rotation.wire * kDegreesPerRad, report.rotation.error_counts);
  text += Print("  latency      sensor to wire state: p50 %.2f ms, p99 %.2f ms, max %.2f ms\n",
                report.latency_ms.p50, report.latency_ms.p99, report.latency_ms.max);
  const double expected = kReportsPerSecond * report.duration_s;
  if (report.reports_sent >= 0 && static_cast<double>(report.reports_sent) < kRealTime * expected) {
    text += Print(
        "               the machine was too busy for real time: the device's %.1f s took %.1f s\n",
        static_cast<double>(report.reports_sent) / kReportsPerSecond, report.duration_s);
  }
  text += Print("  relaxation   p50 %.0f us, p99 %.0f us, max %.0f us a tick; %lld states\n",
                report.solve_us.p50, report.solve_us.p99, report.solve_us.max,
                static_cast<long long>(report.states));
  text += Print("  wire         %d nodes, residual %.2g, largest penetration %.1f um\n",
                report.last_state.segment_count + 1, report.residual, report.max_penetration_um);
  for (std::size_t i = 0; i < report.readings.names.size(); ++i) {
    text += Print("  %-13s%s %.6g\n", i == 0 ? "readings" : "", report.readings.names[i].c_str(),
                  report.readings.values[i]);
  }
  if (report.states_missing > 0 || report.undecodable > 0) {
    text += Print("  log          %lld states missing, %lld messages undecodable\n",
                  static_cast<long long>(report.states_missing),
                  static_cast<long long>(report.undecodable));
  }
  return text;
}

std::string FormatReportJson(const SessionReport& report, const std::string& picture) {
  nlohmann::ordered_json readings = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < report.readings.names.size(); ++i) {
    readings[report.readings.names[i]] = report.readings.values[i];
  }
  const nlohmann::ordered_json json = {{"scene", report.scene},
                                       {"method", report.method},
                                       {"duration_s", report.duration_s},
                                       {"reports_sent", report.reports_sent},
                                       {"reports_received", report.reports_received},
                                       {"reports_lost", report.reports_lost},
                                       {"reports_unfetched", report.reports_unfetched},
                                       {"motion_error_counts", report.axial.error_counts},
                                       {"rotation_error_counts", report.rotation.error_counts},
                                       {"insertion_mm", report.axial.wire},
                                       {"rotation_rad", report.rotation.wire},
                                       {"latency_ms_p50", report.latency_ms.p50},
                                       {"latency_ms_p99", report.latency_ms.p99},
                                       {"latency_ms_max", report.latency_ms.max},
                                       {"solve_us_p50", report.solve_us.p50},
                                       {"solve_us_p99", report.solve_us.p99},
                                       {"max_penetration_um", report.max_penetration_um},
                                       {"nodes", report.last_state.segment_count + 1},
                                       {"residual", report.residual},
                                       {"status", report.status},
                                       {"states", report.states},
                                       {"states_missing", report.states_missing},
                                       {"undecodable", report.undecodable},
                                       {"readings", std::move(readings)},
                                       {"picture", picture}};
  return json.dump() + "\n";
}

std::string DrawReport(const SessionReport& report, const PictureVessel& vessel) {
  const torquer_lcm::wire_state_t& state = report.last_state;
  if (state.nodes_mm.size() < 2) {
    throw UserError("the last wire state has " + std::to_string(state.nodes_mm.size()) +
                    " nodes; a picture needs 2");
  }
  PictureWire wire;
  for (const auto& node : state.nodes_mm) wire.nodes_mm.emplace_back(node[0], node[1], node[2]);
  for (std::size_t i = 0; i < state.contact_nodes.size(); ++i) {
    const auto node = static_cast<std::size_t>(state.contact_nodes[i] / std::max(state.stride, 1));
    if (node < wire.nodes_mm.size()) {
      wire.contacts.push_back(
          {wire.nodes_mm[node], static_cast<double>(state.contact_penetrations_um[i])});
    }
  }
  const torquer_lcm::scene_description_t& scene = report.description;
  const PatientAxes axes{Vector(scene.left), Vector(scene.posterior), Vector(scene.superior)};
  PictureCaption caption;
  caption.title = report.scene;
  caption.subtitle =
      Print("%s · guidewire %.1f mm past the entry, segments of %g mm · %s method",
            scene.vessel.c_str(), state.insertion_mm, scene.segment_mm, report.method.c_str());
  caption.figures = {{"reports sent", KnownCount(report.reports_sent)},
                     {"reports lost", KnownCount(report.reports_lost)},
                     {"wire against sensor", Print("%.2f counts", report.axial.error_counts)},
                     {"sensor to wire state, p50", Print("%.2f ms", report.latency_ms.p50)},
                     {"sensor to wire state, p99", Print("%.2f ms", report.latency_ms.p99)},
                     {"largest penetration", Print("%.1f um", report.max_penetration_um)},
                     {"nodes", Print("%d", state.segment_count + 1)},
                     {"residual", Print("%.1e", report.residual)},
                     {"session", Print("%.1f s", report.duration_s)}};
  return DrawSession(vessel, axes, wire, caption);
}

}  // namespace torquer
