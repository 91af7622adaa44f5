#include "host/viewer/page_messages.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "host/simulator/command_limits.h"
#include "host/simulator/scene/device_library.h"
#include "host/simulator/simulation.h"
#include "host/support/fnv1a.h"
#include "host/support/printable_text.h"

namespace torquer::viewer {
namespace {

static_assert(std::endian::native == std::endian::little, "layouts are little-endian");

constexpr std::size_t kLongestName = 60;

class Writer {
 public:
  Writer(FrameKind kind, std::size_t bytes) {
    bytes_.reserve(bytes);
    Add(static_cast<std::uint8_t>(kind));
    Add(kFrameVersion);
  }
  template <class Value>
  void Add(Value value) {
    Add(&value, sizeof value);
  }
  void Add(const void* data, std::size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

std::string Name(const std::string& text) { return Printable(text, kLongestName); }

// Forces belong to the curve that reaches farthest, nodes of a state to the innermost curve. Two
// different curves may have the same number of nodes.
bool ReachesFarthest(const torquer_lcm::wire_state_t& state) {
  double innermost_mm = 0;
  double other_mm = 0;
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    double& reach_mm = instrument.nodes_mm.empty() ? innermost_mm : other_mm;
    reach_mm = std::max(reach_mm, instrument.insertion_mm);
  }
  return innermost_mm >= other_mm;
}

// Forces in mN at each node of the state; NaN if the scene does not measure them.
std::vector<float> ContactForces(const torquer_lcm::wire_state_t& state,
                                 const torquer_lcm::wire_forces_t* forces) {
  std::vector<float> magnitudes(state.nodes_mm.size(), std::numeric_limits<float>::quiet_NaN());
  if (forces == nullptr || forces->tick != state.tick || forces->stride != state.stride ||
      forces->contact_force_mN.size() != state.nodes_mm.size() || !ReachesFarthest(state)) {
    return magnitudes;
  }
  for (std::size_t i = 0; i < magnitudes.size(); ++i) {
    const auto& force = forces->contact_force_mN[i];
    magnitudes[i] = std::hypot(force[0], force[1], force[2]);
  }
  return magnitudes;
}

// Penetrations in um at each node of the state; 0 without contact.
std::vector<float> Penetrations(const torquer_lcm::wire_state_t& state) {
  std::vector<float> depths(state.nodes_mm.size(), 0.0F);
  if (state.stride < 1) return depths;
  for (std::size_t i = 0; i < state.contact_nodes.size(); ++i) {
    const std::int32_t node = state.contact_nodes[i] / state.stride;
    if (node < 0 || static_cast<std::size_t>(node) >= depths.size()) continue;
    float& depth = depths[static_cast<std::size_t>(node)];
    depth = std::max(depth, state.contact_penetrations_um[i]);
  }
  return depths;
}

void AddNodes(const std::vector<std::vector<float>>& nodes_mm, Writer& out) {
  for (const auto& node : nodes_mm) out.Add(node.data(), 3 * sizeof(float));
}

// x, y, z of each point in order, rounded to 0.01 mm.
nlohmann::json Points(const vessel::Centerline& curve) {
  nlohmann::json coordinates = nlohmann::json::array();
  for (const Eigen::Vector3d& point : curve.points_mm()) {
    for (const double value : point) coordinates.push_back(std::round(100 * value) / 100);
  }
  return coordinates;
}

constexpr int kPulseSamples = 256;

nlohmann::json RoundedShares(const vessel::Centerline& curve, const Motions& motions) {
  nlohmann::json all = nlohmann::json::array();
  for (const Shares& shares : SharesOf(motions, curve.points_mm())) {
    nlohmann::json& rounded = all.emplace_back(nlohmann::json::array());
    for (const float share : shares) {
      rounded.push_back(std::round(1e4 * static_cast<double>(share)) / 1e4);
    }
  }
  return all;
}

}  // namespace

std::string StateFrame(const torquer_lcm::wire_state_t& state,
                       const torquer_lcm::wire_forces_t* forces, std::int64_t clock_id) {
  std::size_t bytes = 64 + 68 * state.instruments.size() + 20 * state.nodes_mm.size();
  for (const auto& instrument : state.instruments) bytes += 12 * instrument.nodes_mm.size();
  Writer out(FrameKind::kState, bytes);
  out.Add(static_cast<std::uint16_t>(state.instruments.size()));
  out.Add(static_cast<std::uint32_t>(state.nodes_mm.size()));
  out.Add(state.time_s);
  out.Add(static_cast<double>(state.tick));
  out.Add(state.residual);
  out.Add(state.max_penetration_um);
  out.Add(state.solve_us);
  out.Add(state.energy_mJ);
  out.Add(static_cast<std::uint32_t>(state.status));
  out.Add(static_cast<std::uint32_t>(state.contact_nodes.size()));
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    const bool comparable = state.clock_id == clock_id && instrument.command_sequence >= 0;
    out.Add(instrument.insertion_mm);
    out.Add(instrument.rotation_rad);
    out.Add(instrument.carried_mm);
    out.Add(instrument.carried_rad);
    out.Add(comparable ? 1e-3 * (static_cast<double>(state.publish_us) -
                                 static_cast<double>(instrument.origin_us))
                       : std::numeric_limits<double>::quiet_NaN());
    out.Add(instrument.tip_mm, sizeof instrument.tip_mm);
  }
  AddNodes(state.nodes_mm, out);
  const std::vector<float> contact_mN = ContactForces(state, forces);
  out.Add(contact_mN.data(), contact_mN.size() * sizeof(float));
  const std::vector<float> depth_um = Penetrations(state);
  out.Add(depth_um.data(), depth_um.size() * sizeof(float));
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    out.Add(static_cast<std::uint32_t>(instrument.nodes_mm.size()));
    AddNodes(instrument.nodes_mm, out);
  }
  return out.Take();
}

std::string PictureFrame(const torquer_lcm::picture_t& picture, bool lateral) {
  Writer out(FrameKind::kPicture, 40 + picture.data.size());
  out.Add(static_cast<std::uint16_t>((picture.held != 0 ? 1 : 0) | (lateral ? 2 : 0)));
  out.Add(static_cast<std::uint32_t>(picture.data.size()));
  out.Add(static_cast<double>(picture.number));
  out.Add(picture.time_s);
  out.Add(static_cast<float>(picture.lao_rad));
  out.Add(static_cast<float>(picture.cra_rad));
  out.Add(static_cast<std::uint32_t>(picture.width));
  out.Add(static_cast<std::uint32_t>(picture.height));
  out.Add(picture.data.data(), picture.data.size());
  return out.Take();
}

std::string VesselFrame(const vessel::TriangleMesh& mesh, std::uint64_t content_hash,
                        const Motions& motions) {
  const std::vector<Shares> all_shares = SharesOf(motions, mesh.vertices_mm);
  std::size_t share_count = 0;
  for (const Shares& shares : all_shares) share_count += shares.size();
  Writer out(FrameKind::kVessel,
             32 + 12 * (mesh.vertices_mm.size() + mesh.triangles.size()) + 4 * share_count);
  out.Add(static_cast<std::uint16_t>(motions.size()));
  out.Add(static_cast<std::uint32_t>(mesh.vertices_mm.size()));
  out.Add(static_cast<std::uint32_t>(mesh.triangles.size()));
  out.Add(std::uint32_t{0});
  const std::string hash = Hex(content_hash);
  out.Add(hash.data(), hash.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices_mm) {
    const Eigen::Vector3f rounded = vertex.cast<float>();
    out.Add(rounded.data(), 3 * sizeof(float));
  }
  for (const auto& triangle : mesh.triangles) out.Add(triangle.data(), 3 * sizeof(std::int32_t));
  for (const Shares& shares : all_shares) out.Add(shares.data(), shares.size() * sizeof(float));
  return out.Take();
}

std::string LinesText(const vessel::CenterlineNetwork& centerlines,
                      const effects::AssessmentTask* task, std::uint64_t content_hash,
                      const Motions& motions) {
  nlohmann::json curves = nlohmann::json::array();
  for (const vessel::Centerline& curve : centerlines.curves()) {
    curves.push_back({{"name", Name(curve.name())},
                      {"points_mm", Points(curve)},
                      {"shares", RoundedShares(curve, motions)}});
  }
  nlohmann::json text = {{"kind", "lines"},
                         {"hash", Hex(content_hash)},
                         {"curves", curves},
                         {"target", nullptr},
                         {"motions", nlohmann::json::array()}};
  if (task != nullptr) {
    const Eigen::Vector3d end = task->route.At(task->route.length_mm()).position_mm;
    text["target"] = {{"at_mm", {end.x(), end.y(), end.z()}},
                      {"radius_mm", task->target_radius_mm},
                      {"force_limit_mN", task->force_limit_mN},
                      {"instrument", task->instrument},
                      {"route_mm", Points(task->route)},
                      {"route_shares", RoundedShares(task->route, motions)}};
  }
  for (const effects::PeriodicMotion* motion : motions) {
    const effects::PeriodicMotion::Settings& settings = motion->settings();
    nlohmann::json pulse = nlohmann::json::array();
    for (int i = 0; i < kPulseSamples; ++i) {
      pulse.push_back(motion->PulseAt(static_cast<double>(i) / kPulseSamples));
    }
    text["motions"].push_back({{"way_mm", settings.way_mm},
                               {"period_s", settings.period_s},
                               {"phase", settings.phase},
                               {"pulse", std::move(pulse)}});
  }
  return text.dump();
}

std::string SceneText(const torquer_lcm::scene_description_t& scene) {
  nlohmann::json instruments = nlohmann::json::array();
  for (std::size_t k = 0; k < scene.instruments.size(); ++k) {
    instruments.push_back({{"name", Name(scene.instruments[k])},
                           {"radius_mm", scene.radius_mm[k]},
                           {"hollow", scene.inner_radius_mm[k] > 0},
                           {"max_length_mm", scene.max_length_mm[k]}});
  }
  nlohmann::json effects = nlohmann::json::array();
  for (const std::string& effect : scene.effects) effects.push_back(Name(effect));
  nlohmann::json off = nlohmann::json::array();
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    const bool on =
        std::find(scene.effects.begin(), scene.effects.end(), kind.name) != scene.effects.end();
    if (!on) off.push_back(kind.name);
  }
  return nlohmann::json({{"kind", "scene"},
                         {"name", Name(scene.name)},
                         {"hash", Name(scene.content_hash)},
                         {"vessel", Printable(scene.vessel, 200)},
                         {"method", Name(scene.method)},
                         {"effects", effects},
                         {"off", off},
                         {"instruments", instruments},
                         {"min_mm", scene.bounds_min_mm},
                         {"max_mm", scene.bounds_max_mm},
                         {"left", scene.left},
                         {"posterior", scene.posterior},
                         {"superior", scene.superior}})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string HealthText(const torquer_lcm::health_t& health) {
  nlohmann::json counters = nlohmann::json::object();
  for (std::size_t i = 0; i < health.names.size(); ++i) {
    counters[Name(health.names[i])] = health.values[i];
  }
  return nlohmann::json({{"kind", "health"},
                         {"process", Name(health.process)},
                         {"instrument", Name(health.instrument)},
                         {"device", Name(health.device)},
                         {"state", Name(health.state)},
                         {"message", Printable(health.message, 300)},
                         {"counters", std::move(counters)}})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string ReadingsText(const torquer_lcm::readings_t& readings) {
  nlohmann::json values = nlohmann::json::object();
  for (std::size_t i = 0; i < readings.names.size(); ++i) {
    values[Name(readings.names[i])] = readings.values[i];
  }
  return nlohmann::json({{"kind", "readings"}, {"time_s", readings.time_s}, {"values", values}})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string DevicesText(const torquer_lcm::devices_t& devices) {
  nlohmann::json names = nlohmann::json::array();
  for (const std::string& device : devices.devices) names.push_back(Name(device));
  return nlohmann::json({{"kind", "devices"},
                         {"devices", names},
                         {"exchanges", devices.exchange_count},
                         {"refusal", Printable(devices.refusal, 300)}})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string TrayText() {
  nlohmann::json devices = nlohmann::json::array();
  for (const std::string& name : scene::DeviceNames()) {
    const scene::DeviceSpec device = scene::ReadDevice(name);
    devices.push_back({{"name", name},
                       {"product", device.product},
                       {"hollow", device.instrument.inner_radius_mm > 0}});
  }
  return nlohmann::json({{"kind", "tray"}, {"devices", devices}})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string PatientText(const torquer_lcm::vital_signs_t& vitals) {
  const std::size_t count = vitals.ecg.size();
  const std::size_t left_out = count > kMostVitalSamples ? count - kMostVitalSamples : 0;
  // A thousandth of the R wave, and of a mmHg, is finer than the screen. Of a number that is not
  // finite, JSON makes null.
  const auto newest = [left_out](const std::vector<float>& all) {
    std::vector<double> shown;
    for (std::size_t k = left_out; k < all.size(); ++k) {
      shown.push_back(std::round(1e3 * static_cast<double>(all[k])) / 1e3);
    }
    return shown;
  };
  return nlohmann::json(
             {{"kind", "patient"},
              {"time_s", vitals.time_s},
              {"heart_rate_per_min", vitals.heart_rate_per_min},
              {"beat_s", vitals.beat_s},
              {"systolic_mmHg", vitals.systolic_mmHg},
              {"diastolic_mmHg", vitals.diastolic_mmHg},
              {"mean_mmHg", vitals.mean_mmHg},
              {"wedged", vitals.wedged != 0},
              {"alarms", vitals.alarms},
              {"rate_limits_per_min", vitals.rate_limits_per_min},
              {"systolic_limits_mmHg", vitals.systolic_limits_mmHg},
              {"sample_s", vitals.sample_s},
              {"first_sample", vitals.first_sample + static_cast<std::int64_t>(left_out)},
              {"ecg", newest(vitals.ecg)},
              {"pressure_mmHg", newest(vitals.pressure_mmHg)}})
      .dump();
}

}  // namespace torquer::viewer
