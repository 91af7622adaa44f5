// Patient monitor compared with circuits and cycles solved by hand.
#include "host/simulator/effects/observers/patient_monitor.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/motion/heartbeat.h"
#include "host/simulator/simulation.h"
#include "host/simulator/vessel/moving_field.h"
#include "tests/effects/vascular_scene.h"

using Catch::Contains;
using torquer::effects::EcgAt;
using torquer::effects::VitalSigns;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kFork;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::Refusal;
using torquer::test::SceneOf;

namespace {

// Resistance of a tube, mmHg s/mL: 8 mu L/(pi r^4) in SI units.
double TubeMmHgSPerML(double length_mm, double radius_mm) {
  const double pa_s_m3 =
      8 * 3.5e-3 * 1e-3 * length_mm / (std::numbers::pi * std::pow(1e-3 * radius_mm, 4));
  return pa_s_m3 * 1e-6 / 133.322387415;
}

const double kForkBranchMm = std::hypot(80, 40);
constexpr double kTickS = 5e-3;
constexpr double kEjectionShare = 0.35;

// Ticks with resting hands up to a time; `push_mm` is the whole insertion of the first instrument.
void Run(Simulation& simulation, double until_s, double push_mm = 0) {
  while (simulation.time_s() < until_s - 1e-9) {
    Command command;
    command.target = simulation.scene().start();
    command.target[0].insertion_mm += push_mm;
    command.time_s = simulation.time_s() + kTickS;
    torquer::CountedBudget budget(1000);
    simulation.Tick(command, budget);
  }
}

// Curve of the samples that are kept: time and value.
std::pair<double, float> LargestEcg(const VitalSigns& vitals) {
  std::pair<double, float> largest{0, -1};
  for (std::int64_t n = vitals.first(); n < vitals.samples; ++n) {
    if (vitals.at(n).ecg <= largest.second) continue;
    largest = {static_cast<double>(n) * VitalSigns::kSampleS, vitals.at(n).ecg};
  }
  return largest;
}

// Source of 5 mL/s into the tube; the outlet holds 60 mmHg.
const std::string kTubeFlow =
    "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\n"
    "[[effects.flow.outlet]]\ncenterline = \"tube\"\npressure_mmHg = 60\n";

// Instrument of kStraight with another radius, and a lumen.
std::string WithCatheter(double radius_mm) {
  std::string text = kStraight;
  const std::string old = "radius_mm = 0.3\n";
  text.replace(text.find(old), old.size(),
               "radius_mm = " + std::to_string(radius_mm) + "\ninner_radius_mm = 0.1\n");
  return text;
}

// Fork whose outlets have 30 and 10 mmHg s/mL, and 7 and 25 mmHg behind them.
std::string ForkFlow(const std::string& keys) {
  return kFork + "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\n" + keys +
         "[[effects.flow.outlet]]\ncenterline = \"left\"\nresistance_mmHg_s_mL = 30\n"
         "pressure_mmHg = 7\n"
         "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 10\n"
         "pressure_mmHg = 25\n";
}

std::string MonitorAt(const std::string& curve, double at_mm, const std::string& keys = "") {
  return "[effects.patient_monitor]\nat = \"place\"\ncenterline = \"" + curve +
         "\"\nat_mm = " + std::to_string(at_mm) + "\n" + keys;
}

}  // namespace

TEST_CASE("A steady pressure falls along a tube as Poiseuille's", "[effects]") {
  for (const double at_mm : {50.0, 150.0}) {
    SceneOf scene(kStraight + kTubeFlow + MonitorAt("tube", at_mm));
    Simulation simulation(*scene);
    Run(simulation, 1.1);
    const double expected = 60 + 5 * TubeMmHgSPerML(200 - at_mm, 2);
    CHECK(Reading(simulation, "pressure_mmHg") == Approx(expected).epsilon(1e-6));
    CHECK(Reading(simulation, "pressure_mean_mmHg") == Approx(expected).epsilon(1e-6));
    CHECK(Reading(simulation, "pressure_systolic_mmHg") == Approx(expected).epsilon(1e-6));
    CHECK(Reading(simulation, "pressure_wedged") == 0);
    CHECK(std::isnan(Reading(simulation, "heart_rate_per_min")));
    CHECK(std::isnan(simulation.vitals()->at(3).ecg));
  }
}

TEST_CASE("The pressure is that at the tip, beyond what obstructs the flow", "[effects]") {
  const bool obstruction = GENERATE(false, true);
  std::string flow = kTubeFlow;
  if (obstruction) flow.replace(flow.find("inlet_mL_s"), 0, "obstruction = true\n");
  SceneOf scene(WithCatheter(1) + flow + "[effects.patient_monitor]\n");
  Simulation simulation(*scene);
  Run(simulation, 0.2);
  // The entry is at 1 mm. Between the tip and the outlet nothing obstructs.
  CHECK(Reading(simulation, "pressure_mmHg") ==
        Approx(60 + 5 * TubeMmHgSPerML(200 - 41, 2)).epsilon(2e-4));
  Run(simulation, 0.4, 30);
  CHECK(Reading(simulation, "pressure_mmHg") ==
        Approx(60 + 5 * TubeMmHgSPerML(200 - 71, 2)).epsilon(2e-4));
}

TEST_CASE("A pressure behind a stenosis lacks its loss", "[effects]") {
  std::string text = kStraight;
  const std::string old = "points_mm = [[0, 0, 0], [200, 0, 0]]\nradii_mm = [2]";
  text.replace(text.find(old), old.size(),
               "points_mm = [[0, 0, 0], [80, 0, 0], [90, 0, 0], [110, 0, 0], [120, 0, 0], "
               "[200, 0, 0]]\nradii_mm = [2, 2, 1, 1, 2, 2]");
  const std::string stenosis =
      "[[effects.flow.stenosis]]\ncenterline = \"tube\"\nfrom_mm = 70\nto_mm = 130\n";
  SceneOf behind(text + kTubeFlow + stenosis + MonitorAt("tube", 150));
  Simulation simulation(*behind);
  Run(simulation, 0.2);
  CHECK(Reading(simulation, "pressure_mmHg") ==
        Approx(60 + 5 * TubeMmHgSPerML(50, 2)).epsilon(1e-4));
  // Before it: Young and Tsai, with 1 mL/s through 1 mm^2 = 1 m/s, besides Poiseuille.
  SceneOf before(text + kTubeFlow + stenosis + MonitorAt("tube", 50));
  SceneOf without(text + kTubeFlow + MonitorAt("tube", 50));
  Simulation with(*before);
  Simulation plain(*without);
  Run(with, 0.2);
  Run(plain, 0.2);
  const double area = std::numbers::pi * 4;
  const double loss_mmHg =
      1.52 * 1060 / 2 * 9 * std::pow(5 / area, 2) / 133.322387415;  // area over throat: 4
  CHECK(Reading(with, "pressure_mmHg") - Reading(plain, "pressure_mmHg") ==
        Approx(loss_mmHg).epsilon(0.01));
}

TEST_CASE("Systole, diastole and mean of a beat are those of the network", "[effects]") {
  SceneOf scene(ForkFlow("rate_per_min = 60\npulsatility = 0.8\n") + MonitorAt("left", 40));
  Simulation simulation(*scene);
  Run(simulation, 1.1);
  // Pressure p at the fork: (p - 7)/left + (p - 25)/right = flow.
  const double left = TubeMmHgSPerML(kForkBranchMm, 3) + 30;
  const double right = TubeMmHgSPerML(kForkBranchMm, 3) + 10;
  const auto at = [&](double flow) {
    const double p = (flow + 7 / left + 25 / right) / (1 / left + 1 / right);
    return p - (p - 7) / left * TubeMmHgSPerML(40, 3);
  };
  CHECK(Reading(simulation, "pressure_mean_mmHg") == Approx(at(5)).epsilon(1e-4));
  CHECK(Reading(simulation, "pressure_diastolic_mmHg") == Approx(at(0.2 * 5)).epsilon(1e-4));
  CHECK(Reading(simulation, "pressure_systolic_mmHg") ==
        Approx(at(5 * (0.2 + 0.8 * 2 / kEjectionShare))).epsilon(1e-3));
  CHECK(Reading(simulation, "heart_rate_per_min") == 60);
}

TEST_CASE("The mean pressure of a Windkessel is that of its resistances", "[effects]") {
  SceneOf scene(kStraight +
                "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 80\nrate_per_min = 70\n"
                "pulsatility = 1\n[[effects.flow.outlet]]\ncenterline = \"tube\"\n"
                "resistance_mmHg_s_mL = 1.1\ncompliance_mL_mmHg = 1.4\n" +
                MonitorAt("tube", 0));
  Simulation simulation(*scene);
  Run(simulation, 12 * 60 / 70.0);
  const double tube = TubeMmHgSPerML(200, 2);
  CHECK(Reading(simulation, "pressure_mean_mmHg") == Approx(80 * (1.1 + tube)).epsilon(0.003));
  // From the end of the ejection the compliance alone drives the flow: no loss in the tube.
  const VitalSigns& vitals = *simulation.vitals();
  const auto pressure = [&](double time_s) {
    const auto number = std::llround(time_s / VitalSigns::kSampleS);
    return static_cast<double>(vitals.at(number).pressure_mmHg);
  };
  const double beat_s = 11 * 60 / 70.0;
  CHECK(pressure(beat_s + 0.84) / pressure(beat_s + 0.34) ==
        Approx(std::exp(-0.5 / (1.1 * 1.4))).epsilon(0.005));
}

TEST_CASE("From 95 % of the lumen's area on, a tip has the pressure behind it", "[effects]") {
  const bool closes = GENERATE(false, true);
  // The tube narrows to a radius of 3 mm, of which the tip fills 94.97 % or 95.06 % of the area.
  std::string tube = WithCatheter(closes ? 2.925 : 2.9236);
  const std::string points = "points_mm = [[0, 0, 0], [200, 0, 0]]\nradii_mm = [2]";
  tube.replace(tube.find(points), points.size(),
               "points_mm = [[0, 0, 0], [120, 0, 0], [200, 0, 0]]\n"
               "radii_mm = [3.9, 3, 3]");
  tube.replace(tube.find("at_start_mm = 40"), 16, "at_start_mm = 139");
  tube.replace(tube.find("wall_stiffness_N_mm2 = 1"), 24, "wall_stiffness_N_mm2 = 0.01");
  SceneOf scene(tube +
                "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\nrate_per_min = 60\n"
                "pulsatility = 1\n[[effects.flow.outlet]]\ncenterline = \"tube\"\n"
                "resistance_mmHg_s_mL = 16\npressure_mmHg = 8\n"
                "[effects.patient_monitor]\n");
  Simulation simulation(*scene);
  // No flow source reaches the bed behind the tip: the pressure is that behind the outlet.
  Run(simulation, 6.1);
  const VitalSigns& vitals = *simulation.vitals();
  const double systolic = Reading(simulation, "pressure_systolic_mmHg");
  CHECK(vitals.wedged == closes);
  CHECK(Reading(simulation, "pressure_wedged") == (closes ? 1 : 0));
  CHECK(((vitals.alarms & torquer::effects::kPressureDamped) != 0) == closes);
  if (closes) {
    CHECK(systolic == Approx(8).epsilon(0.01));
    CHECK(systolic - Reading(simulation, "pressure_diastolic_mmHg") < 0.1);
  } else {
    const double open = 8 + 5 * 2 / kEjectionShare * (16 + TubeMmHgSPerML(200 - 140, 3));
    CHECK(systolic == Approx(open).epsilon(1e-3));
  }
}

TEST_CASE("A closed lumen settles with its time constant, and keeps a damped pulse", "[effects]") {
  // A catheter of 3 mm closes the stem. The two beds behind it share one pressure.
  const std::string muscle = "systolic_mmHg = 100\n";
  SceneOf scene(ForkFlow("rate_per_min = 60\npulsatility = 1\n") + muscle +
                MonitorAt("stem", 60, "catheter_radius_mm = 3\n"));
  Simulation simulation(*scene);
  const double left = TubeMmHgSPerML(kForkBranchMm, 3) + 30;
  const double right = TubeMmHgSPerML(kForkBranchMm, 3) + 10;
  const double share = 1 / right / (1 / left + 1 / right);  // of the right bed's pressure
  const double rest = 7 * (1 - share) + 25 * share;
  Run(simulation, 8.1);
  // Mean of the ejection, sin^2 in 35 % of the cycle: 0.175.
  CHECK(Reading(simulation, "pressure_mean_mmHg") ==
        Approx(rest + share * 100 * kEjectionShare / 2).epsilon(0.01));
  // In diastole the muscle rests, and the pressure falls towards `rest` with 0.5 s.
  const VitalSigns& vitals = *simulation.vitals();
  const auto above = [&](double time_s) {
    const auto number = std::llround(time_s / VitalSigns::kSampleS);
    return static_cast<double>(vitals.at(number).pressure_mmHg) - rest;
  };
  CHECK(above(7.9) / above(7.4) == Approx(std::exp(-1)).epsilon(1e-3));
  const double pulse = Reading(simulation, "pressure_systolic_mmHg") -
                       Reading(simulation, "pressure_diastolic_mmHg");
  CHECK(pulse > 1);
  CHECK(pulse < 0.4 * share * 100);
}

TEST_CASE("The R wave begins the systole of the heart's motion", "[effects]") {
  const double phase = GENERATE(0.0, 0.3);
  SceneOf scene(kStraight +
                "[effects.heartbeat]\nrate_per_min = 75\nsystole = 0.3\namplitude_mm = 2\n"
                "direction = [0, 0, 1]\nphase = " +
                std::to_string(phase) +
                "\n[[effects.heartbeat.region]]\nside_of_mm = [150, 0, 0]\nside = [1, 0, 0]\n"
                "edge_mm = 20\n[effects.patient_monitor]\n");
  Simulation simulation(*scene);
  Run(simulation, 3);
  const VitalSigns& vitals = *simulation.vitals();
  const auto [r_wave_s, height] = LargestEcg(vitals);
  CHECK(height == Approx(1).epsilon(0.05));
  CHECK(std::abs(std::remainder(r_wave_s - vitals.beat_s, 60 / 75.0)) < 0.0021);
  // The heart's largest displacement follows the R wave by the systole.
  torquer::vessel::MovingField& field = *scene->moving_field();
  double farthest_mm = 0;
  double farthest_s = 0;
  for (double time_s = r_wave_s; time_s < r_wave_s + 60 / 75.0; time_s += 1e-3) {
    field.SetTime(time_s);
    const Eigen::Vector3d rest(180, 0, 0);
    const double moved_mm = (field.Moved(rest, rest) - rest).norm();
    if (moved_mm <= farthest_mm) continue;
    farthest_mm = moved_mm;
    farthest_s = time_s;
  }
  CHECK(farthest_mm == Approx(2).epsilon(1e-3));
  CHECK(farthest_s - r_wave_s == Approx(0.3 * 60 / 75).margin(0.004));
  CHECK(Reading(simulation, "heart_rate_per_min") == Approx(75));
  CHECK(std::isnan(Reading(simulation, "pressure_mmHg")));
  CHECK(std::isnan(Reading(simulation, "pressure_mean_mmHg")));
  CHECK(std::isnan(Reading(simulation, "pressure_wedged")));
}

TEST_CASE("The ejection of a flow begins at the R wave", "[effects]") {
  SceneOf scene(ForkFlow("rate_per_min = 60\npulsatility = 1\n") + MonitorAt("stem", 50));
  Simulation simulation(*scene);
  Run(simulation, 3.99);
  const VitalSigns& vitals = *simulation.vitals();
  const double r_wave_s = LargestEcg(vitals).first;
  CHECK(r_wave_s == Approx(3).margin(0.002));
  std::int64_t highest = vitals.first();
  for (std::int64_t n = vitals.first(); n < vitals.samples; ++n) {
    if (vitals.at(n).pressure_mmHg > vitals.at(highest).pressure_mmHg) highest = n;
  }
  const double peak_s = static_cast<double>(highest) * VitalSigns::kSampleS;
  CHECK(peak_s - r_wave_s == Approx(kEjectionShare / 2).margin(0.004));
}

TEST_CASE("The ECG has its waves in order", "[effects]") {
  CHECK(EcgAt(0) == Approx(1));
  // P before the QRS, Q and S below zero beside the R wave, T after it.
  CHECK(EcgAt(1 - 1.0 / 6) > 0.15);
  CHECK(EcgAt(1 - 0.045) < 0);
  CHECK(EcgAt(0.045) < 0);
  CHECK(EcgAt(0.25) > 0.25);
  CHECK(std::abs(EcgAt(0.5)) < 0.05);
  for (double x = 0; x < 1; x += 0.001) CHECK(EcgAt(x) <= 1 + 1e-3);
}

TEST_CASE("A tip within another catheter has the pressure at that one's mouth", "[effects]") {
  std::string text = WithCatheter(0.3);
  text +=
      "[[instrument]]\nname = \"guide\"\nmax_length_mm = 150\nradius_mm = 1\n"
      "inner_radius_mm = 0.8\nrigidity_N_mm2 = 2\ninserted_at_start_mm = 90\n";
  SceneOf scene(text + kTubeFlow + "[effects.patient_monitor]\ninstrument = \"guidewire\"\n");
  Simulation simulation(*scene);
  Run(simulation, 0.1);
  CHECK(Reading(simulation, "pressure_mmHg") ==
        Approx(60 + 5 * TubeMmHgSPerML(200 - 91, 2)).epsilon(2e-4));
  Run(simulation, 0.3, 60);  // out of it, to 100 mm
  CHECK(Reading(simulation, "pressure_mmHg") ==
        Approx(60 + 5 * TubeMmHgSPerML(200 - 101, 2)).epsilon(2e-4));
}

TEST_CASE("Alarms name the figure that is out of its limits", "[effects]") {
  const auto alarms = [](const std::string& flow, const std::string& limits) {
    SceneOf scene(ForkFlow(flow) + MonitorAt("left", 40, limits));
    Simulation simulation(*scene);
    Run(simulation, 2.1);
    return simulation.vitals()->alarms;
  };
  using namespace torquer::effects;  // NOLINT(google-build-using-namespace)
  // The systolic pressure is 51 mmHg at 60 beats a minute.
  const std::string slow = "rate_per_min = 60\npulsatility = 0\n";
  CHECK(alarms(slow, "") == kSystolicLow);
  CHECK(alarms(slow, "systolic_low_mmHg = 40\n") == 0);
  CHECK(alarms(slow, "systolic_low_mmHg = 20\nsystolic_high_mmHg = 30\n") == kSystolicHigh);
  CHECK(alarms(slow, "systolic_low_mmHg = 40\nrate_low_per_min = 61\n") == kRateLow);
  CHECK(alarms(slow, "systolic_low_mmHg = 40\nrate_high_per_min = 59\n") == kRateHigh);
  // Without a heart there is no rate, and no alarm for it.
  CHECK(alarms("", "systolic_low_mmHg = 40\n") == 0);
}

TEST_CASE("A restarted monitor repeats its curves", "[effects]") {
  SceneOf scene(WithCatheter(1) + kTubeFlow + "[effects.patient_monitor]\n");
  Simulation simulation(*scene);
  Run(simulation, 0.5, 20);
  const VitalSigns first = *simulation.vitals();
  simulation.Restart();
  CHECK(simulation.vitals()->samples == 1);
  Run(simulation, 0.5, 20);
  for (std::int64_t n = 0; n < first.samples; ++n) {
    CHECK(simulation.vitals()->at(n).pressure_mmHg == first.at(n).pressure_mmHg);
  }
}

TEST_CASE("A monitor that cannot work is refused with the remedy", "[effects]") {
  const std::string heart =
      "[effects.heartbeat]\nrate_per_min = 70\namplitude_mm = 2\ndirection = [0, 0, 1]\n"
      "[[effects.heartbeat.region]]\nside_of_mm = [150, 0, 0]\nside = [1, 0, 0]\nedge_mm = 20\n";
  const std::string monitor = "[effects.patient_monitor]\n";
  std::string pulse = kTubeFlow;
  pulse.replace(pulse.find("inlet_mL_s"), 0, "rate_per_min = 72\n");
  CHECK_THAT(Refusal(kStraight + monitor), Contains("nothing to show"));
  CHECK_THAT(Refusal(kStraight + kTubeFlow + monitor), Contains("no instrument has a lumen"));
  CHECK_THAT(Refusal(kStraight + heart + pulse + monitor + "at = \"entry\"\n"),
             Contains("72 beats a minute") && Contains("70 from phase 0"));
  CHECK_THAT(Refusal(kStraight + heart + monitor + "at = \"entry\"\n"),
             Contains("needs [effects.flow]"));
  CHECK(Refusal(kStraight + heart + kTubeFlow + monitor + "at = \"entry\"\n").empty());
  CHECK(Refusal(kStraight + kTubeFlow + monitor + "instrument = \"guidewire\"\n").empty());
  for (const char* keys :
       {"at = \"place\"\n", "at_mm = 3\n", "at = \"entry\"\ninstrument = \"guidewire\"\n",
        "catheter_radius_mm = 1\n", "at = \"place\"\ncenterline = \"none\"\nat_mm = 3\n",
        "instrument = \"none\"\n", "at = \"entry\"\nrate_low_per_min = 130\n",
        "at = \"entry\"\nsystolic_low_mmHg = 170\n"}) {
    INFO(keys);
    CHECK(Refusal(kStraight + kTubeFlow + monitor).find("patient_monitor") != std::string::npos);
    CHECK(Refusal(kStraight + kTubeFlow + monitor + keys).find("patient_monitor") !=
          std::string::npos);
  }
}
