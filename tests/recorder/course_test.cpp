#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "host/recorder/session_course.h"
#include "host/recorder/session_log.h"
#include "host/recorder/session_report.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;

namespace {

constexpr std::int64_t kClock = 5;

// Tick with one instrument, whose tip is at (tip_mm, 0, 0).
torquer_lcm::wire_state_t Tick(std::int64_t number, double time_s, double insertion_mm,
                               double tip_mm) {
  torquer_lcm::wire_state_t state{};
  state.tick = number;
  state.time_s = time_s;
  state.clock_id = kClock;
  state.publish_us = std::llround(1e6 * time_s);
  state.status = protocol::kWireConverged;
  state.instruments.resize(1);
  state.instruments[0].name = protocol::kGuidewire;
  state.instruments[0].insertion_mm = insertion_mm;
  state.instruments[0].rotation_rad = insertion_mm / 10;
  state.instruments[0].tip_mm[0] = tip_mm;
  state.nodes_mm = {{0, 0, 0}, {static_cast<float>(tip_mm), 0, 0}};
  return state;
}

torquer_lcm::instrument_command_t Pedals(double time_s, bool xray) {
  torquer_lcm::instrument_command_t command{};
  command.instrument = protocol::kGuidewire;
  command.clock_id = kClock;
  command.publish_us = std::llround(1e6 * time_s);
  command.xray = xray ? 1 : 0;
  return command;
}

double Highest(const Series& series) {
  double highest = 0;
  for (const SeriesPoint& point : series.Points()) highest = std::max(highest, point.value);
  return highest;
}

}  // namespace

TEST_CASE("The course has way, speed and reversals of a motion that is known") {
  // Forward for 4 s at 10 mm/s, back for 1 s at 5 mm/s. Then 1 s at rest with a tremor of 0.4 mm,
  // and 2 s forward at 20 mm/s.
  const auto place_mm = [](double time_s) {
    if (time_s < 4) return 10 * time_s;
    if (time_s < 5) return 40 - 5 * (time_s - 4);
    if (time_s < 6) return 35 + 0.2 * std::sin(20 * time_s);
    return 35 + 20 * (time_s - 6);
  };
  SessionCourse course;
  for (int i = 0; i <= 8000; ++i) {
    const double time_s = 1e-3 * i;
    course.Add(Tick(i, time_s, 100 + place_mm(time_s), place_mm(time_s)));
  }
  REQUIRE(course.instruments().size() == 1);
  const InstrumentCourse& wire = course.instruments()[0];
  CHECK(wire.name == "guidewire");
  CHECK(wire.reversals == 2);
  CHECK(Highest(wire.insertion_mm) == Approx(175));
  CHECK(Highest(wire.rotation_deg) == Approx(17.5 * 180 / M_PI));
  // At each turn, and at the end, less than a step is lost.
  CHECK(course.tip_path_mm() == Approx(40 + 5 + 40).margin(3 * SessionCourse::kPathStepMm));
  CHECK(course.peak_speed_mm_s() == Approx(20).epsilon(1e-3));
  // 85 mm in the 7 s of motion; the tremor increases both a little.
  CHECK(course.moving_speed_mm_s().value() == Approx(85.0 / 7).epsilon(0.15));
  CHECK(course.begin_s() == 0);
  CHECK(course.end_s() == Approx(8));
  CHECK(course.tip_way_mm().size() == Approx(85 / 0.5).margin(8));
}

TEST_CASE("The way of the tip is that of the innermost instrument in a longer one") {
  SessionCourse course;
  for (int i = 0; i <= 100; ++i) {
    torquer_lcm::wire_state_t state = Tick(i, 0.01 * i, 0.5 * i, 0.5 * i);
    state.nodes_mm.push_back({70, 0, 0});  // as far as a catheter reaches
    course.Add(state);
  }
  CHECK(course.tip_path_mm() == Approx(50).margin(0.5));
  CHECK(course.peak_speed_mm_s() == Approx(50).epsilon(1e-3));
}

TEST_CASE("A long way of the tip is kept evenly, and within bounds") {
  SessionCourse course;
  constexpr int kTicks = 30'000;
  for (int i = 0; i <= kTicks; ++i) course.Add(Tick(i, 1e-3 * i, 0, 0.6 * i));
  CHECK(course.tip_path_mm() == Approx(0.6 * kTicks));
  REQUIRE(course.tip_way_mm().size() <= SessionCourse::kMostPathPoints);
  CHECK(course.tip_way_mm().size() > SessionCourse::kMostPathPoints / 4);
  CHECK(course.tip_way_mm().front().x() == 0);
  std::vector<double> steps_mm;
  for (std::size_t i = 1; i < course.tip_way_mm().size(); ++i) {
    steps_mm.push_back((course.tip_way_mm()[i] - course.tip_way_mm()[i - 1]).norm());
  }
  const auto [least, most] = std::minmax_element(steps_mm.begin(), steps_mm.end());
  CHECK(*most < 1.25 * *least);
}

TEST_CASE("A constant value is drawn constant until it changes, without a ramp") {
  SessionCourse course;
  course.Add(Tick(0, 1, 10, 10));
  course.Add(Tick(1, 9, 20, 20));  // the next tick: 8 s of rest
  const std::vector<SeriesPoint> points = course.instruments()[0].insertion_mm.Points();
  REQUIRE(points.size() == 3);
  CHECK(points[1].time_s == Approx(9).margin(0.01));
  CHECK(points[1].value == 10);
  // For ticks missing from the log, the course is unknown.
  course.Add(Tick(7, 12, 30, 30));
  CHECK(course.instruments()[0].insertion_mm.Points().size() == 4);
}

TEST_CASE("Pedals are those of the innermost instrument's commands, and up when they fall silent") {
  SessionCourse course;
  course.Add(Pedals(0, true));  // before any instrument is known
  course.Add(Tick(0, 1, 10, 10));
  torquer_lcm::instrument_command_t foreign = Pedals(1.05, true);
  foreign.instrument = "catheter";
  course.Add(foreign);
  CHECK(course.xray().spans().empty());
  for (int i = 0; i < 10; ++i) course.Add(Pedals(1.1 + 0.1 * i, i < 5));  // on until 1.6 s
  CHECK(course.xray().total_s() == Approx(0.5));
  course.Add(Pedals(2.1, true));
  course.Add(Tick(1, 5, 10, 10));  // no command for 300 ms
  REQUIRE(course.xray().spans().size() == 2);
  CHECK(course.xray().spans()[0].begin_s == Approx(1.1));
  CHECK(course.xray().spans()[0].end_s == Approx(1.6));
  CHECK(course.xray().spans()[1].begin_s == Approx(2.1));
  CHECK(course.xray().spans()[1].end_s == Approx(2.4));
  CHECK(course.contrast().spans().empty());
}

TEST_CASE("A peak of the wall force between two readings is in the course") {
  SessionCourse course;
  torquer_lcm::readings_t readings{};
  readings.names = {"wall_force_largest_mN", "wall_force_largest_ever_mN"};
  const double values[][2] = {{3, 3}, {4, 17}, {2, 17}};
  for (int i = 0; i < 3; ++i) {
    course.Add(Tick(i, 0.1 * i, 0, 0));
    readings.tick = i;
    readings.time_s = 0.1 * i;
    readings.values = {values[i][0], values[i][1]};
    course.Add(readings);
  }
  const std::vector<SeriesPoint> points = course.wall_force_mN().Points();
  REQUIRE(points.size() == 3);
  CHECK(points[0].value == 3);
  CHECK(points[1].value == 17);
  CHECK(points[2].value == 2);
}

TEST_CASE("The newest injection of the readings is listed once, until the next one begins") {
  SessionCourse course;
  torquer_lcm::readings_t readings{};
  readings.names = {"injection_start_s", "injection_set_mL", "injection_rate_mL_s", "injection_mL",
                    "injection_aborted"};
  const std::vector<double> all[] = {std::vector<double>(5, std::nan("")),
                                     {2.5, 8, 4, 0, 0},
                                     {2.5, 8, 4, 3, 0},
                                     {2.5, 8, 4, 3, 1},
                                     {2.5, 8, 4, 3, 1},
                                     {9, 6, 2, 1, 0},
                                     {9, 6, 2, 6, 0},
                                     {20, 6, 2, 0.5, 0}};
  for (const std::vector<double>& values : all) {
    readings.values = values;
    course.Add(readings);
  }
  REQUIRE(course.injections().size() == 3);
  const torquer::PowerInjection first = course.injections()[0];
  const torquer::PowerInjection second = course.injections()[1];
  const torquer::PowerInjection third = course.injections()[2];
  CHECK((first.start_s == 2.5 && first.volume_mL == 8 && first.rate_mL_s == 4));
  CHECK((first.delivered_mL == 3 && first.aborted && !first.complete()));
  CHECK((second.start_s == 9 && second.delivered_mL == 6 && second.complete()));
  CHECK((third.delivered_mL == 0.5 && !third.aborted && !third.complete()));
  for (int k = 0; k < 200; ++k) {
    readings.values = {30.0 + k, 6, 2, 0.25 * k, 0};
    course.Add(readings);
  }
  CHECK(course.injections().size() == SessionCourse::kMostInjections);
  CHECK(course.injections().back().delivered_mL == 0.25 * (SessionCourse::kMostInjections - 4));
}

TEST_CASE("A wall force of a tick that did not settle is apart from those that count") {
  SessionCourse course;
  torquer_lcm::readings_t readings{};
  readings.names = {"wall_force_largest_mN", "wall_force_largest_ever_mN"};
  const double values[][2] = {{3, 3}, {12000, 17}, {4, 17}, {900, 17}};
  for (int i = 0; i < 4; ++i) {
    torquer_lcm::wire_state_t state = Tick(i, 0.1 * i, 0, 0);
    if (i == 1) state.status = protocol::kWireBudgetSpent;
    // The state of the last readings is not in the log.
    if (i < 3) course.Add(state);
    readings.tick = i;
    readings.time_s = 0.1 * i;
    readings.values = {values[i][0], values[i][1]};
    course.Add(readings);
  }
  const std::vector<SeriesPoint> counted = course.wall_force_mN().Points();
  REQUIRE(counted.size() == 3);
  CHECK(counted[1].value == 17);  // a settled tick between two messages
  CHECK(counted[2].value == 4);
  const std::vector<SeriesPoint> apart = course.unsettled_force_mN().Points();
  REQUIRE(apart.size() == 2);
  CHECK(apart[0].value == 12000);
  CHECK(apart[0].time_s == 0.1);
  CHECK(apart[1].value == 900);
}

TEST_CASE("The solver's health is counted over the ticks of a log") {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.course = true;
  faults.repeated_states = true;
  WriteSession(folder.Path("log"), faults);
  SessionReporter reporter;
  ReadSessionLog(folder.Path("log"), reporter.Handlers());
  const SessionReport report = reporter.Finish(
      [](const std::string&, int) -> Eigen::Matrix2d { return Eigen::Matrix2d::Identity(); });
  const SolverHealth& solver = report.course.solver();
  CHECK(solver.ticks == kReports);
  CHECK(solver.unconverged == 10);
  CHECK(solver.budget_spent == 10);
  CHECK(solver.stalled == 0);
  CHECK(solver.largest_residual == 3e-7);
  CHECK(report.course.xray().total_s() == Approx(0.25).margin(2e-3));
  CHECK(report.course.contrast().total_s() == Approx(0.05).margin(2e-3));
}

TEST_CASE("A course accepts any values of a log") {
  SessionCourse course;
  torquer_lcm::wire_state_t odd = Tick(INT64_MIN, 1e300, 1e300, 1e30);
  course.Add(odd);
  odd.time_s = 0;
  course.Add(odd);
  odd.tick = INT64_MAX;
  odd.time_s = 1e12;
  odd.instruments.resize(100);
  odd.instruments[0].insertion_mm = std::nan("");
  course.Add(odd);
  odd.nodes_mm.clear();
  odd.instruments.clear();
  course.Add(odd);
  CHECK(course.instruments().size() == SessionCourse::kMostInstruments);
  torquer_lcm::instrument_command_t command = Pedals(0, true);
  command.publish_us = INT64_MAX;
  course.Add(command);
  CHECK(std::isfinite(course.xray().total_s()));
}

TEST_CASE("Motion without X-ray is measured for all hands, and a rest is none") {
  SessionCourse course;
  auto run = [&course, tick = 0](double from_s, double to_s, double from_mm, double mm_s) mutable {
    for (double time_s = from_s; time_s < to_s - 1e-9; time_s += 0.01) {
      const double mm = from_mm + mm_s * (time_s - from_s);
      course.Add(Tick(tick++, time_s, mm, mm));
    }
  };
  run(0, 1, 5, 0);
  CHECK_FALSE(course.first_motion_s());
  run(1, 2, 5, 10);
  CHECK(course.first_motion_s().value() == Approx(1.06));
  CHECK(course.blind().path_mm == Approx(9.9));
  CHECK(course.blind().time_s == Approx(0.99).margin(0.011));
  course.Add(Pedals(1.995, true));
  for (double time_s = 2; time_s < 3; time_s += 0.1) {
    course.Add(Pedals(time_s, true));
    run(time_s, time_s + 0.1, 15, -20);
  }
  CHECK(course.blind().path_mm == Approx(9.9));
  course.Add(Pedals(3, false));
  const double before_mm = course.blind().path_mm;
  run(3, 4, 13.2, 0);  // at rest
  CHECK(course.blind().path_mm == Approx(before_mm).margin(0.01));
  run(4, 5, 13.2, -10);
  CHECK(course.blind().path_mm - before_mm == Approx(9.9).margin(0.2));
}

TEST_CASE("Motion of any hand without X-ray counts, and a gap of the log does not") {
  SessionCourse course;
  const auto add = [&course](std::int64_t number, double time_s, double first_mm,
                             double second_mm) {
    torquer_lcm::wire_state_t state = Tick(number, time_s, first_mm, first_mm);
    state.instruments.push_back(state.instruments[0]);
    state.instruments[1].name = "microcatheter";
    state.instruments[1].insertion_mm = second_mm;
    state.instruments[1].rotation_rad = 0;
    course.Add(state);
  };
  for (int i = 0; i <= 100; ++i) add(i, 0.01 * i, 5 + 0.1 * i, 20);
  CHECK(course.blind().path_mm == Approx(10));
  CHECK(course.blind().time_s == Approx(1));
  for (int i = 1; i <= 100; ++i) add(100 + i, 1 + 0.01 * i, 15, 20 + 0.2 * i);
  CHECK(course.blind().path_mm == Approx(30));
  CHECK(course.blind().time_s == Approx(2));
  // Lost ticks: the path is known, the time of the motion is not.
  add(900, 9, 18, 40);
  CHECK(course.blind().path_mm == Approx(33));
  CHECK(course.blind().time_s == Approx(2).margin(0.051));
}
