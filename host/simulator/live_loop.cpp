#include "host/simulator/live_loop.h"

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/clock.h"
#include "host/bus/health_reporter.h"
#include "host/simulator/field_ahead.h"
#include "host/simulator/forces_message.h"
#include "host/simulator/live_commands.h"
#include "host/simulator/live_exchange.h"
#include "host/simulator/live_readings.h"
#include "host/simulator/live_vital_signs.h"
#include "host/simulator/picture_thread.h"
#include "host/simulator/scene_message.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

constexpr std::int64_t kTickUs = 1000;
// Within this time a daemon or screen that starts while the wire rests receives the state.
constexpr std::int64_t kRepeatUs = 200'000;

class Deadline final : public WorkBudget {
 public:
  explicit Deadline(std::int64_t end_us) : end_us_(end_us) {}
  // Always allows one unit, so that the wire moves, though late, on a machine that is too slow.
  bool Allows(int done) override { return done == 0 || bus::MonotonicUs() < end_us_; }

 private:
  std::int64_t end_us_;
};

// Connects the parts of the loop.
class LiveLoop {
 public:
  LiveLoop(ExchangeableSimulation& simulation, bus::Bus& bus)
      : simulation_(simulation),
        bus_(bus),
        commands_(simulation.scene_at_start()),
        health_(bus, "simulator"),
        description_(Describe(simulation.now())),
        readings_(simulation, bus),
        vital_signs_(simulation, bus),
        ahead_(simulation.scene_at_start().vessel()),
        exchange_(simulation, pictures_, bus),
        began_us_(bus::MonotonicUs()) {
    state_.clock_id = bus::ClockId();
    for (std::size_t k = 0; k < simulation.now().image_count(); ++k) {
      pictures_.push_back(std::make_unique<PictureThread>(
          *simulation.now().image(k), bus,
          k == 0 ? protocol::kPictureChannel : protocol::kLateralPictureChannel));
    }
    TakeCommands<torquer_lcm::instrument_command_t>(protocol::kInstrumentCommandChannel);
    TakeCommands<torquer_lcm::imaging_command_t>(protocol::kImagingCommandChannel);
    TakeCommands<torquer_lcm::wedge_command_t>(protocol::kWedgeCommandChannel);
    TakeCommands<torquer_lcm::injector_command_t>(protocol::kInjectorCommandChannel);
    TakeCommands<torquer_lcm::table_command_t>(protocol::kTableCommandChannel);
    TakeCommands<torquer_lcm::exchange_command_t>(protocol::kExchangeCommandChannel);
  }

  LiveStatistics Run(const std::atomic<bool>& stop) {
    health_.Change("running", "", Counters());
    bus_.Publish(protocol::kSceneChannel, description_);
    exchange_.Publish();
    PublishState(0);
    std::int64_t next_tick_us = 0;
    while (!stop) {
      bus_.Handle(1);
      const std::int64_t now_us = bus::MonotonicUs();
      commands_.Age(now_us);
      SayNews(now_us);
      const bool exchanged = ExchangeWhenOrdered();
      const bool goes_on = simulation_.now().is_time_dependent() || !simulation_.now().at_rest();
      if (exchanged || commands_.fresh() || (goes_on && now_us >= next_tick_us)) {
        Tick(now_us);
        next_tick_us = now_us + kTickUs;
      }
      if (now_us - state_.publish_us >= kRepeatUs) RepeatState();
      readings_.PublishWhenDue(now_us);
      vital_signs_.PublishWhenDue(now_us);
      if (health_.Due(now_us)) {
        health_.Repeat(Counters());
        bus_.Publish(protocol::kSceneChannel, description_);
        exchange_.Publish();
      }
    }
    readings_.Publish();
    health_.Change("stopping", "", Counters());
    statistics_.commands = commands_.taken();
    return statistics_;
  }

 private:
  template <class Message>
  void TakeCommands(const char* channel) {
    bus_.SubscribeWithArrival<Message>(
        channel,
        [this](const Message& message, const bus::Arrival& arrival) {
          commands_.Take(message, arrival.sender, arrival.received_us);
        },
        // 0: no limit. A short queue would keep the oldest commands, but the newest one is valid.
        0);
  }

  // True if an instrument was exchanged. Its first tick follows at once, so that a replay finds the
  // exchange before it.
  bool ExchangeWhenOrdered() {
    const std::optional<ExchangeOrder> order = commands_.TakeExchange();
    if (!order) return false;
    const std::size_t before = simulation_.now().exchanges().size();
    const std::string result = exchange_.Execute(*order);
    health_.Change(commands_.State(), result, Counters());
    if (simulation_.now().exchanges().size() == before) return false;
    description_ = Describe(simulation_.now());
    bus_.Publish(protocol::kSceneChannel, description_);
    return true;
  }

  void Tick(std::int64_t now_us) {
    Deadline budget(now_us + static_cast<std::int64_t>(simulation_.now().scene().budget_us()));
    Command command = commands_.command();
    command.time_s = 1e-6 * static_cast<double>(now_us - began_us_);
    const TickReport& report = simulation_.now().Tick(command, budget);
    const std::int64_t end_us = bus::MonotonicUs();
    for (std::size_t k = 0; k < pictures_.size(); ++k) {
      if (simulation_.now().picture_due(k)) pictures_[k]->Offer();
    }
    const auto solve_us = static_cast<double>(end_us - now_us);
    PublishState(solve_us);
    ahead_.Follow(simulation_.now().state().Farthest().tip());
    Count(report, solve_us);
    commands_.Settle();
  }

  void SayNews(std::int64_t now_us) {
    for (const std::string& news : {commands_.TakeNews(), bus_.TakeNotice(now_us)}) {
      if (!news.empty()) health_.Change(commands_.State(), news, Counters());
    }
  }

  void PublishState(double solve_us) {
    simulation_.now().Describe(state_);
    commands_.Describe(state_);
    state_.solve_us = solve_us;
    RepeatState();
  }

  void RepeatState() {
    state_.publish_us = bus::MonotonicUs();
    bus_.Publish(protocol::kWireStateChannel, state_);
    if (simulation_.now().forces() == nullptr) return;
    DescribeForces(simulation_.now(), forces_);
    forces_.publish_us = state_.publish_us;
    bus_.Publish(protocol::kWireForcesChannel, forces_);
  }

  void Count(const TickReport& report, double solve_us) {
    ++statistics_.ticks;
    statistics_.unconverged += !report.converged;
    statistics_.solve.Add(solve_us);
    if (!commands_.fresh() || commands_.sent_us() == 0) return;
    statistics_.command_to_state.Add(static_cast<double>(state_.publish_us - commands_.sent_us()));
  }

  bus::HealthCounters Counters() {
    bus::HealthCounters counters = commands_.Counters();
    counters.insert(counters.end(), {{"ticks", statistics_.ticks},
                                     {"unconverged", statistics_.unconverged},
                                     {"undecodable", bus_.undecodable()},
                                     {"dropped", bus_.dropped()},
                                     {"publish_failures", bus_.publish_failures()}});
    if (EffectPrices* const prices = simulation_.now().prices()) {
      for (const auto& [effect, us] : prices->Take()) {
        counters.emplace_back("price_" + effect + "_ns", std::llround(1e3 * us));
      }
    }
    for (std::size_t k = 0; k < pictures_.size(); ++k) {
      counters.emplace_back(k == 0 ? "picture_us" : "picture_lateral_us", pictures_[k]->last_us());
    }
    return counters;
  }

  ExchangeableSimulation& simulation_;
  bus::Bus& bus_;
  LiveCommands commands_;
  bus::HealthReporter health_;
  torquer_lcm::scene_description_t description_;
  LiveReadings readings_;
  LiveVitalSigns vital_signs_;
  FieldAhead ahead_;
  std::vector<std::unique_ptr<PictureThread>> pictures_;
  LiveExchange exchange_;
  const std::int64_t began_us_;
  torquer_lcm::wire_state_t state_{};
  torquer_lcm::wire_forces_t forces_{};
  LiveStatistics statistics_;
};

}  // namespace

LiveStatistics RunLive(ExchangeableSimulation& simulation, bus::Bus& bus,
                       const std::atomic<bool>& stop) {
  return LiveLoop(simulation, bus).Run(stop);
}

}  // namespace torquer::simulator
