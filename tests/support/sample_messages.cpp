#include "tests/support/sample_messages.h"

#include <sys/mman.h>

#include <algorithm>
#include <span>
#include <stdexcept>
#include <torquer_lcm/device_sample_t.hpp>
#include <torquer_lcm/devices_t.hpp>
#include <torquer_lcm/exchange_command_t.hpp>
#include <torquer_lcm/hand_motion_t.hpp>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/imaging_command_t.hpp>
#include <torquer_lcm/injector_command_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/picture_t.hpp>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/table_command_t.hpp>
#include <torquer_lcm/vital_signs_t.hpp>
#include <torquer_lcm/wedge_command_t.hpp>
#include <torquer_lcm/wire_forces_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/bus/message_check.h"

namespace torquer::test {
namespace {

template <class Message>
Bytes Encode(const Message& message) {
  Bytes bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

// Copy that ends at the end of mapped memory: a read past it is a fault in every build.
class BytesAtEdge {
 public:
  explicit BytesAtEdge(const Bytes& bytes) {
    constexpr std::size_t kRoom = 1 << 16;
    static char* const room = [] {
      void* mapped = mmap(nullptr, 2 * kRoom, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
      if (mapped == MAP_FAILED || mprotect(mapped, kRoom, PROT_READ | PROT_WRITE) != 0) {
        throw std::runtime_error("no memory with an edge");
      }
      return static_cast<char*>(mapped);
    }();
    auto* data = reinterpret_cast<std::uint8_t*>(room + kRoom - bytes.size());
    std::copy(bytes.begin(), bytes.end(), data);
    view_ = {data, bytes.size()};
  }
  std::span<const std::uint8_t> view() const { return view_; }

 private:
  std::span<const std::uint8_t> view_;
};

template <class Message>
SampleMessage Sample(const Message& message) {
  return {Message::getTypeName(), Encode(message), [](const Bytes& bytes) {
            // Bytes that pass the check must also decode.
            const BytesAtEdge edge(bytes);
            if (!bus::IsMessage(Message::getTypeName(), Message::getHash(), edge.view())) {
              return false;
            }
            Message decoded;
            if (!bus::DecodeMessage(edge.view().data(), bytes.size(), decoded)) {
              throw std::logic_error("passes the check and does not decode");
            }
            if (Encode(decoded) != bytes) throw std::logic_error("decoded to another message");
            return true;
          }};
}

torquer_lcm::wire_state_t WireState() {
  torquer_lcm::wire_state_t state{};
  for (const char* name : {"guidewire", "catheter"}) {
    torquer_lcm::instrument_state_t instrument{};
    instrument.name = name;
    instrument.insertion_mm = 17.5;
    state.instruments.push_back(instrument);
  }
  state.instruments[1].nodes_mm = {{1, 2, 4}, {4, 5, 7}};
  state.instruments[1].node_count = 2;
  state.instrument_count = 2;
  state.nodes_mm = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  state.node_count = 3;
  state.contact_nodes = {2};
  state.contact_penetrations_um = {0.5};
  state.contact_count = 1;
  state.past_time_s = {1, 2};
  state.past_work = {3, 4};
  state.past_insertion_mm = {{1, 2}, {3, 4}};
  state.past_rotation_rad = {{5, 6}, {7, 8}};
  state.past_count = 2;
  return state;
}

torquer_lcm::scene_description_t Scene() {
  torquer_lcm::scene_description_t scene{};
  scene.name = "arch";
  scene.effects = {"friction", "twist"};
  scene.effect_count = 2;
  scene.instruments = {"guidewire"};
  scene.radius_mm = scene.inner_radius_mm = scene.max_length_mm = scene.inserted_at_start_mm = {1};
  scene.instrument_count = 1;
  return scene;
}

}  // namespace

std::vector<SampleMessage> SampleMessages() {
  torquer_lcm::device_sample_t sample{};
  sample.device = "BOX-1";
  torquer_lcm::hand_motion_t motion{};
  motion.device = "BOX-1";
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.names = {"lost", "received"};
  health.values = {1, 2};
  health.count = 2;
  torquer_lcm::instrument_command_t command{};
  command.instrument = "guidewire";
  torquer_lcm::imaging_command_t imaging{};
  imaging.magnification = 1.5;
  imaging.shutters[2] = 0.2;
  torquer_lcm::table_command_t table{};
  table.instrument = "guidewire";
  table.height_mm = 2.5;
  torquer_lcm::wedge_command_t wedges{};
  wedges.share[1] = 0.25;
  torquer_lcm::injector_command_t injector{};
  injector.order = 1;
  injector.volume_mL = 12.5;
  torquer_lcm::exchange_command_t exchange{};
  exchange.order = 3;
  exchange.instrument = "guidewire";
  exchange.device = "sion";
  torquer_lcm::devices_t devices{};
  devices.instruments = {"guidewire"};
  devices.devices = {"sion"};
  devices.instrument_count = 1;
  devices.exchange_tick = {12};
  devices.exchange_time_s = {0.5};
  devices.exchange_instrument = {0};
  devices.exchange_device = {"sion"};
  devices.exchange_hash = {"0123456789abcdef"};
  devices.exchange_count = 1;
  torquer_lcm::picture_t picture{};
  picture.encoding = "jpeg";
  picture.data = {1, 2, 3, 4, 5};
  picture.byte_count = 5;
  torquer_lcm::readings_t readings{};
  readings.names = {"wall_force_mN"};
  readings.values = {2.5};
  readings.count = 1;
  torquer_lcm::wire_forces_t forces{};
  forces.instrument_count = 1;
  forces.names = {"guidewire"};
  forces.hand_force_mN = {1.5};
  forces.hand_torque_mN_mm = {0.5};
  forces.stride = 1;
  forces.node_count = 2;
  forces.contact_force_mN = {{0, 0, 0}, {1, 2, 3}};
  forces.line_load_mN_mm = forces.tension_mN = forces.bending_mN_mm = {1, 2};
  forces.twisting_mN_mm = {0, 1};
  torquer_lcm::vital_signs_t vitals{};
  vitals.systolic_mmHg = 121.5;
  vitals.sample_count = 2;
  vitals.ecg = {0.25, 1};
  vitals.pressure_mmHg = {80, 120.5};
  return {Sample(forces),  Sample(sample),      Sample(motion),   Sample(health),
          Sample(command), Sample(imaging),     Sample(picture),  Sample(readings),
          Sample(Scene()), Sample(WireState()), Sample(table),    Sample(vitals),
          Sample(wedges),  Sample(injector),    Sample(exchange), Sample(devices)};
}

}  // namespace torquer::test
