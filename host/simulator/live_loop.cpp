#include "host/simulator/live_loop.h"

#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>

#include "host/bus/clock.h"
#include "host/bus/health_reporter.h"
#include "host/simulator/field_ahead.h"
#include "host/simulator/live_readings.h"
#include "host/simulator/picture_thread.h"
#include "host/support/fnv1a.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

class Deadline final : public WorkBudget {
 public:
  explicit Deadline(std::int64_t end_us) : end_us_(end_us) {}
  bool Allows(int) override { return bus::MonotonicUs() < end_us_; }

 private:
  std::int64_t end_us_;
};

void Copy(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = from[axis];
}

torquer_lcm::scene_description_t Describe(const scene::Scene& scene) {
  torquer_lcm::scene_description_t out;
  out.name = scene.name();
  out.scene_file = scene.path();
  out.content_hash = Hex(scene.content_hash());
  out.vessel = scene.vessel().description;
  out.method = scene.method() == scene::Method::kPaper ? "paper" : "newton";
  out.effects = scene.effect_names();
  out.effect_count = static_cast<std::int32_t>(out.effects.size());
  out.segment_mm = scene.wire().segment_mm();
  out.wire_radius_mm = scene.wire().radius_mm(0);
  out.inserted_at_start_mm = scene.inserted_at_start_mm();
  Copy(scene.vessel().bounds_mm.min(), out.bounds_min_mm);
  Copy(scene.vessel().bounds_mm.max(), out.bounds_max_mm);
  Copy(scene.wire().sheath().point_mm, out.entry_point_mm);
  Copy(scene.wire().sheath().direction, out.entry_direction);
  Copy(scene.axes().left, out.left);
  Copy(scene.axes().posterior, out.posterior);
  Copy(scene.axes().superior, out.superior);
  return out;
}

constexpr std::size_t kMostSamples = 10'000'000;  // hours; then the statistics stop growing

}  // namespace

LiveStatistics RunLive(Session& session, bus::Bus& bus, const std::atomic<bool>& stop) {
  LiveStatistics statistics;
  Command command;
  std::int64_t origin_us = bus::MonotonicUs();
  std::int64_t sent_us = 0;  // when the command was published; 0 when that clock is another's
  bool arrived = false;
  const std::int64_t clock_id = bus::ClockId();
  const HandTarget start = session.scene().start();
  command.target = session.target();

  bus.Subscribe<torquer_lcm::instrument_command_t>(
      protocol::kInstrumentCommandChannel,
      [&](const torquer_lcm::instrument_command_t& message) {
        if (message.instrument == protocol::kCatheter) {
          // C-arm and pedals are those of the wire's box.
          command.target.catheter_insertion_mm = start.catheter_insertion_mm + message.insertion_mm;
          command.target.catheter_rotation_rad = message.rotation_rad;
          arrived = arrived || session.scene().coaxial() != nullptr;
          ++statistics.commands;
          return;
        }
        if (message.instrument != protocol::kGuidewire) return;
        command.sequence = message.sequence;
        command.target.insertion_mm = start.insertion_mm + message.insertion_mm;
        command.target.rotation_rad = message.rotation_rad;
        command.controls = {message.lao_rad, message.cra_rad, message.xray != 0,
                            message.contrast != 0};
        command.in_doubt =
            (message.flags & (protocol::kCommandLift | protocol::kCommandSensorFault |
                              protocol::kCommandNoDevice)) != 0;
        const bool same_clock = message.clock_id == clock_id;
        origin_us = same_clock ? message.origin_us : bus::MonotonicUs();
        sent_us = same_clock ? message.publish_us : 0;
        arrived = true;
        ++statistics.commands;
      },
      // All of them: a short queue would keep the oldest, and the newest is the one that counts.
      0);

  bus::HealthReporter health(bus, "simulator");
  const auto counters = [&]() -> bus::HealthCounters {
    return {{"ticks", statistics.ticks},
            {"commands", statistics.commands},
            {"unconverged", statistics.unconverged},
            {"undecodable", bus.undecodable()},
            {"publish_failures", bus.publish_failures()}};
  };
  const torquer_lcm::scene_description_t description = Describe(session.scene());
  torquer_lcm::wire_state_t state{};
  state.clock_id = clock_id;
  torquer_lcm::wire_state_t catheter{};
  const auto publish = [&](double solve_us) {
    session.Describe(state);
    state.origin_us = origin_us;
    state.solve_us = solve_us;
    state.publish_us = bus::MonotonicUs();
    bus.Publish(protocol::kWireStateChannel, state);
    if (!session.DescribeCatheter(catheter)) return;
    catheter.clock_id = clock_id;
    catheter.origin_us = origin_us;
    catheter.solve_us = solve_us;
    catheter.publish_us = bus::MonotonicUs();
    bus.Publish(protocol::kWireStateChannel, catheter);
  };
  health.Change("running", "", counters());
  bus.Publish(protocol::kSceneChannel, description);
  publish(0);

  std::unique_ptr<PictureThread> pictures;
  if (session.image() != nullptr) {
    pictures = std::make_unique<PictureThread>(*session.image(), bus);
  }
  LiveReadings readings(session, bus);
  FieldAhead ahead(session.scene().vessel());
  const std::int64_t began_us = bus::MonotonicUs();
  std::int64_t next_tick_us = 0;
  while (!stop) {
    bus.Handle(1);
    const std::int64_t start_us = bus::MonotonicUs();
    const bool at_rest =
        !session.lives() && session.report().converged && session.report().carried_mm == 0;
    if (arrived || (!at_rest && start_us >= next_tick_us)) {
      Deadline budget(start_us + static_cast<std::int64_t>(session.scene().budget_us()));
      command.time_s = 1e-6 * static_cast<double>(start_us - began_us);
      const TickReport& report = session.Tick(command, budget);
      const std::int64_t end_us = bus::MonotonicUs();
      if (session.picture_due()) pictures->Offer();
      publish(static_cast<double>(end_us - start_us));
      next_tick_us = start_us + 1000;
      ahead.Follow(session.state().nodes.back());
      ++statistics.ticks;
      statistics.unconverged += !report.converged;
      if (statistics.solve_us.size() < kMostSamples) {
        statistics.solve_us.push_back(static_cast<float>(end_us - start_us));
        if (arrived && sent_us > 0) {
          statistics.command_to_state_us.push_back(static_cast<float>(state.publish_us - sent_us));
        }
      }
      arrived = false;
    }
    readings.PublishWhenDue(start_us);
    if (health.Due(start_us)) {
      health.Repeat(counters());
      bus.Publish(protocol::kSceneChannel, description);
    }
  }
  readings.Publish();
  health.Change("stopping", "", counters());
  return statistics;
}

}  // namespace torquer::simulator
