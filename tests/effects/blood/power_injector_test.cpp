#include "host/simulator/effects/blood/power_injector.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "host/simulator/effects/blood/contrast.h"
#include "tests/effects/vascular_scene.h"

using Catch::Contains;
using torquer::effects::Contrast;
using torquer::effects::Injector;
using torquer::effects::InjectorSetUp;
using torquer::effects::PowerInjector;
using torquer::test::kFork;
using torquer::test::Reading;
using torquer::test::Refusal;
using torquer::test::SceneOf;
using Order = Injector::Order;
using Phase = PowerInjector::Phase;

namespace {

constexpr InjectorSetUp kSetUp = {.volume_mL = 5, .rate_mL_s = 4, .delay_s = 0.3, .rise_s = 0.5};

double ReadingOf(const PowerInjector& injector, const std::string& name) {
  for (const auto& reading : injector.Readings()) {
    if (reading.name == name) return reading.value;
  }
  return std::nan("");
}

PowerInjector Armed(const InjectorSetUp& set_up) {
  PowerInjector injector(set_up);
  injector.Take({.order = Order::kArm}, 1);
  return injector;
}

// Runs an injection with an order in each step; returns the volume after `time_s`.
double Run(PowerInjector& injector, double time_s, double step_s) {
  double sum_mL = 0;
  for (int k = 0; k < std::lround(time_s / step_s); ++k) {
    injector.Take({.order = Order::kInject}, 1 + k * step_s);
    sum_mL += injector.Deliver(step_s);
  }
  return sum_mL;
}

// Rate of the set-up at a time after the order, before its volume is delivered.
double RateAt(const InjectorSetUp& set_up, double time_s) {
  if (time_s < set_up.delay_s) return 0;
  if (time_s > set_up.delay_s + set_up.rise_s) return set_up.rate_mL_s;
  return set_up.rate_mL_s * (time_s - set_up.delay_s) / set_up.rise_s;
}

const std::string kFlow = "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\n";
const std::string kContrast = "[effects.contrast]\nrate_mL_s = 3\n";
const std::string kKeys =
    "injector_volume_mL = 2\ninjector_rate_mL_s = 4\ninjector_delay_s = 0.1\n"
    "injector_rise_s = 0.2\n";

// A session of the fork with an injector, in ticks of 5 ms.
class Session {
 public:
  Session() : scene_(kFork + kFlow + kContrast + kKeys), simulation_(*scene_) {}
  torquer::simulator::Simulation& simulation() { return simulation_; }
  Contrast& contrast() { return scene_.Get<Contrast>(); }
  double Now(const std::string& name) const { return Reading(simulation_, name); }

  void Run(const Injector& ordered, int ticks, bool by_hand = false) {
    torquer::simulator::Command command;
    command.target = scene_->start();
    command.controls.injector = ordered;
    command.controls.contrast = by_hand;
    for (int k = 0; k < ticks; ++k) {
      command.time_s = 0.005 * ++tick_;
      torquer::CountedBudget budget(1000);
      simulation_.Tick(command, budget);
    }
  }

  void CopyFrom(Session& other) {
    simulation_.CopyFrom(other.simulation_);
    tick_ = other.tick_;
  }

 private:
  SceneOf scene_;
  torquer::simulator::Simulation simulation_;
  int tick_ = 0;
};

}  // namespace

TEST_CASE("The delivered volume is the integral of the rate with delay and rise", "[effects]") {
  for (const double step_s : {1e-3, 7e-3, 0.05}) {
    INFO(step_s);
    PowerInjector injector = Armed(kSetUp);
    CHECK(ReadingOf(injector, "injector_left_mL") == 5);
    double integral_mL = 0;
    double delivered_mL = 0;
    // Volume over rate plus half of the rise, after the delay.
    constexpr double kEndS = 0.3 + 5.0 / 4 + 0.25;
    for (int k = 0; (k + 1) * step_s < kEndS - 1e-9; ++k) {
      injector.Take({.order = Order::kInject}, 1 + k * step_s);
      delivered_mL += injector.Deliver(step_s);
      for (int part = 0; part < 50; ++part) {
        integral_mL += RateAt(kSetUp, (k + (part + 0.5) / 50) * step_s) * step_s / 50;
      }
      CHECK(delivered_mL == Approx(integral_mL).margin(1e-4));
      CHECK((delivered_mL < 1e-9) == ((k + 1) * step_s < 0.3 + 1e-9));
      CHECK(injector.phase() == Phase::kInjecting);
      CHECK(ReadingOf(injector, "injector_left_mL") == Approx(5 - delivered_mL).margin(1e-12));
    }
    delivered_mL += injector.Deliver(step_s);
    delivered_mL += injector.Deliver(step_s);
    CHECK(injector.phase() == Phase::kComplete);
    CHECK(delivered_mL == Approx(5).epsilon(1e-12));
    CHECK(ReadingOf(injector, "injection_mL") == 5);
    CHECK(ReadingOf(injector, "injection_start_s") == 1);
    CHECK(ReadingOf(injector, "injection_aborted") == 0);
    CHECK(injector.Deliver(step_s) == 0);
  }
}

TEST_CASE("A small volume ends while the rate still rises", "[effects]") {
  InjectorSetUp small = kSetUp;
  small.volume_mL = 0.25;
  // 4 mL/s over 0.5 s rises by 8 mL/s^2: 0.25 mL after sqrt(2 * 0.25 / 8) s.
  const double end_s = 0.3 + std::sqrt(2 * 0.25 / 8);
  PowerInjector injector = Armed(small);
  CHECK(Run(injector, end_s - 0.01, 1e-3) < 0.25);
  CHECK(injector.phase() == Phase::kInjecting);
  injector = Armed(small);
  CHECK(Run(injector, end_s + 0.01, 1e-3) == Approx(0.25).epsilon(1e-12));
  CHECK(injector.phase() == Phase::kComplete);
}

TEST_CASE("Each injection needs its own arming", "[effects]") {
  PowerInjector injector(kSetUp);
  CHECK(Run(injector, 1, 0.01) == 0);
  CHECK(injector.phase() == Phase::kOff);
  injector.Take({.order = Order::kArm}, 2);
  injector.Take({.order = Order::kOff}, 2);
  CHECK(injector.phase() == Phase::kOff);
  CHECK(Run(injector, 1, 0.01) == 0);

  injector.Take({.order = Order::kArm}, 3);
  CHECK(Run(injector, 3, 0.01) == Approx(5));
  CHECK(Run(injector, 3, 0.01) == 0);
  injector.Take({.order = Order::kOff}, 9);
  CHECK(Run(injector, 3, 0.01) == 0);
  CHECK(injector.phase() == Phase::kComplete);
  injector.Take({.order = Order::kArm}, 15);
  CHECK(injector.phase() == Phase::kArmed);
  CHECK(ReadingOf(injector, "injections") == 1);
  CHECK(Run(injector, 3, 0.01) == Approx(5));
  CHECK(ReadingOf(injector, "injections") == 2);
}

TEST_CASE("An aborted injection stops at once, with its part of the volume", "[effects]") {
  for (const Order order : {Order::kOff, Order::kArm}) {
    PowerInjector injector = Armed(kSetUp);
    CHECK(Run(injector, 1, 0.01) == Approx(4 * (1 - 0.3 - 0.25)));
    injector.Take({.order = order}, 2);
    CHECK(injector.phase() == Phase::kAborted);
    CHECK(injector.Deliver(1) == 0);
    CHECK(ReadingOf(injector, "injection_mL") == Approx(1.8));
    CHECK(ReadingOf(injector, "injector_left_mL") == Approx(3.2));
    CHECK(ReadingOf(injector, "injection_aborted") == 1);
    // The order that stands is no new order to arm it.
    injector.Take({.order = order}, 2);
    CHECK(Run(injector, 3, 0.01) == 0);
    CHECK(injector.phase() == Phase::kAborted);
    injector.Take({.order = Order::kArm}, 6);
    CHECK(Run(injector, 3, 0.01) == Approx(5));
    CHECK(ReadingOf(injector, "injection_aborted") == 0);
  }
}

TEST_CASE("Another set-up disarms, and does not change an injection", "[effects]") {
  PowerInjector injector = Armed(kSetUp);
  injector.Take({.order = Order::kArm, .volume_mL = 7}, 2);
  CHECK(injector.phase() == Phase::kOff);
  CHECK(ReadingOf(injector, "injector_volume_mL") == 7);
  CHECK(ReadingOf(injector, "injector_rate_mL_s") == 4);
  CHECK(Run(injector, 3, 0.01) == 0);

  const Injector::Order arm = Order::kArm;
  injector.Take({.order = arm, .volume_mL = 7, .rate_mL_s = 10, .delay_s = 0, .rise_s = 0}, 5);
  CHECK(injector.phase() == Phase::kArmed);
  const Injector other{Order::kInject, 7, 10, 0, 0};
  injector.Take(other, 5);
  double sum_mL = injector.Deliver(0.1);
  CHECK(sum_mL == Approx(1));
  for (int k = 0; k < 8; ++k) {
    injector.Take({.order = Order::kInject, .volume_mL = 1, .rate_mL_s = 1}, 5);
    sum_mL += injector.Deliver(0.1);
  }
  CHECK(sum_mL == Approx(7));
  CHECK(ReadingOf(injector, "injection_set_mL") == 7);
  CHECK(ReadingOf(injector, "injection_rate_mL_s") == 10);
}

TEST_CASE("The injector's dye flows out of the vessels, and counts with that by hand",
          "[effects]") {
  Session session;
  session.Run({.order = Order::kArm}, 20);
  for (const char* name : {"injection_start_s", "injection_mL", "injection_set_mL",
                           "injection_rate_mL_s", "injection_aborted"}) {
    INFO(name);
    CHECK(std::isnan(session.Now(name)));
  }
  CHECK(session.Now("contrast_injected_mL") == 0);
  CHECK(session.Now("injector_phase") == 1);
  session.Run({.order = Order::kInject}, 20);
  CHECK(session.Now("contrast_inside_mg") == 0);  // the delay
  CHECK(session.Now("injection_start_s") == Approx(0.1));
  session.Run({.order = Order::kInject}, 60);  // 0.3 s with a rise of 0.2 s, and by hand
  CHECK(session.Now("contrast_injected_mL") == Approx(4 * (0.3 - 0.1)));
  session.Run({.order = Order::kInject}, 20, true);
  CHECK(session.Now("contrast_injected_mL") == Approx(4 * (0.4 - 0.1) + 3 * 0.1));
  session.Run({.order = Order::kInject}, 100);
  CHECK(session.Now("injector_phase") == 3);
  CHECK(session.Now("contrast_injected_mL") == Approx(2 + 0.3));
  Contrast& contrast = session.contrast();
  double time_s = 10;
  while (!contrast.clear() && time_s < 100) {
    contrast.Advance(time_s += 5e-3, 5e-3, false, Eigen::Vector3d::Zero());
  }
  CHECK(session.Now("contrast_washed_out_mg") == Approx(320 * 2.3).epsilon(1e-9));
}

TEST_CASE("An injection at the rate of the hand puts the dye where the hand would", "[effects]") {
  Session by_hand, by_power;
  // 3 mL/s for 0.5 s into a stem with 5 mL/s, so that the injection changes the flow much.
  const Injector set_up{.volume_mL = 1.5, .rate_mL_s = 3, .delay_s = 0, .rise_s = 0};
  Injector order = set_up;
  order.order = Order::kArm;
  by_power.Run(order, 1);
  order.order = Order::kInject;
  by_power.Run(order, 140);
  by_hand.Run({}, 1);
  by_hand.Run({}, 100, true);
  by_hand.Run({}, 40);
  const std::vector<double>& one = by_hand.contrast().concentration_mg_mL();
  const std::vector<double>& other = by_power.contrast().concentration_mg_mL();
  REQUIRE(one.size() == other.size());
  double dye = 0;
  for (std::size_t cell = 0; cell < one.size(); ++cell) {
    CHECK(other[cell] == Approx(one[cell]).epsilon(1e-9).margin(1e-9));
    dye += one[cell];
  }
  CHECK(dye > 1);
}

TEST_CASE("A copy continues an injection to the bit, and a restart forgets it", "[effects]") {
  Session session;
  session.Run({.order = Order::kArm, .volume_mL = 1.5}, 7);
  session.Run({.order = Order::kInject, .volume_mL = 1.5}, 40);
  Session copy;
  copy.CopyFrom(session);
  for (Session* one : {&session, &copy}) one->Run({.order = Order::kInject, .volume_mL = 1.5}, 40);
  for (const char* name : {"injector_phase", "injection_mL", "injection_start_s", "injections",
                           "contrast_inside_mg", "contrast_washed_out_mg"}) {
    INFO(name);
    CHECK(session.Now(name) == copy.Now(name));
  }
  CHECK(copy.Now("injection_mL") == Approx(4 * (0.4 - 0.1 - 0.1)));
  copy.simulation().Restart();
  CHECK(copy.Now("injector_phase") == 0);
  CHECK(copy.Now("injections") == 0);
  CHECK(std::isnan(copy.Now("injection_start_s")));
  CHECK(copy.Now("injector_volume_mL") == 2);
}

TEST_CASE("An injector that cannot be is refused with key, value and remedy", "[effects]") {
  const auto refusal = [](const std::string& keys) {
    return Refusal(kFork + kFlow + kContrast + keys);
  };
  CHECK(refusal(kKeys).empty());
  CHECK_THAT(refusal("injector_volume_mL = 2\n"), Contains("test.toml:") &&
                                                      Contains("injector_rate_mL_s: is missing") &&
                                                      Contains("give 0.1 to 45 mL/s"));
  for (const std::string key : {"injector_rate_mL_s", "injector_delay_s", "injector_rise_s"}) {
    CHECK_THAT(refusal(key + " = 2\n"), Contains(key) && Contains("set that, or remove this key"));
  }
  CHECK_THAT(refusal("injector_volume_mL = 151\ninjector_rate_mL_s = 2\n"),
             Contains("injector_volume_mL = 151") && Contains("150"));
  CHECK_THAT(refusal("injector_volume_mL = 2\ninjector_rate_mL_s = 46\n"),
             Contains("injector_rate_mL_s = 46"));
  CHECK_THAT(refusal(kKeys.substr(0, kKeys.find("injector_rise_s")) + "injector_rise_s = 10\n"),
             Contains("injector_rise_s = 10"));
  // Without the keys there is no injector.
  SceneOf scene(kFork + kFlow + kContrast);
  for (const auto& reading : scene.Get<Contrast>().Readings()) {
    CHECK(reading.name.find("inject") != 0);
  }
}
