#include "host/daemon/pipeline.h"

#include <catch2/catch.hpp>
#include <random>

#include "calibration/motion_model.h"
#include "protocol/lcm_channels.h"
#include "tests/support/reports.h"
#include "tests/support/sanitizer.h"

namespace {

using torquer::calibration::MotionParameters;
using torquer::daemon::HandTracker;
using torquer::daemon::Pipeline;
using torquer::daemon::PipelineOutput;
using torquer::protocol::InputReport;
using torquer::test::BytesOf;

torquer::calibration::Calibration Crooked() {
  torquer::calibration::Calibration calibration =
      torquer::calibration::NominalCalibration("X", 1200);
  calibration.motion = torquer::calibration::ModelOf(MotionParameters{.gain_mm_per_count = 0.0213,
                                                                      .misalignment_rad = 0.03,
                                                                      .cylinder_radius_mm = 5.1,
                                                                      .skew_rad = 0.002},
                                                     1200);
  return calibration;
}

std::int32_t Wrapped(std::int64_t value) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)));
}

}  // namespace

TEST_CASE("Ten million reports, nearly three hours, leave no drift between counts and command") {
  const torquer::calibration::Calibration calibration = Crooked();
  Pipeline pipeline(HandTracker(calibration, {}));
  pipeline.OnConnected();
  std::mt19937_64 random(20);
  std::uniform_int_distribution<int> step(-40, 47);  // advances on average
  std::uniform_int_distribution<int> percent(0, 99);

  // Just before every counter wraps.
  std::int64_t axial = 2147483000;
  std::int64_t transverse = -2147483000;
  const std::int64_t first_axial = axial;
  const std::int64_t first_transverse = transverse;
  std::int64_t lost = 0;
  std::int64_t repeated = 0;
  std::optional<PipelineOutput> last;
  InputReport report = torquer::test::StillReport(65000);
  report.device_time_us = 4294000000u;
  constexpr int kReports = torquer::test::Rounds(10000000, 10);
  for (int i = 0; i < kReports; ++i) {
    report.axial_counts = Wrapped(axial);
    report.transverse_counts = Wrapped(transverse);
    const std::int64_t receive_us = 1000LL * i + 1000;
    const bool drop = i > 5 && i < kReports - 1 && percent(random) < 2;
    if (drop) {
      ++lost;
    } else {
      const std::optional<PipelineOutput> output = pipeline.OnReport(BytesOf(report), receive_us);
      REQUIRE(output);
      last = output;
      if (percent(random) < 1) {
        ++repeated;
        REQUIRE_FALSE(pipeline.OnReport(BytesOf(report), receive_us));
      }
    }
    report = torquer::test::Next(report);
    if (i < kReports - 1) {
      axial += step(random);
      transverse -= step(random);
    }
  }

  const torquer::calibration::HandMotion truth = torquer::calibration::Apply(
      calibration.motion, axial - first_axial, transverse - first_transverse);
  REQUIRE(last);
  CHECK(last->hand.pose.insertion_mm == truth.insertion_mm);  // exactly
  CHECK(last->hand.pose.rotation_rad == truth.rotation_rad);
  CHECK(last->sample.axial_counts == axial);
  CHECK(last->sample.transverse_counts == transverse);
  CHECK(last->sample.report_number == 65000 + kReports - 1);
  CHECK(pipeline.decoder().counters().lost == lost);
  CHECK(pipeline.decoder().counters().duplicated == repeated);
  CHECK(pipeline.decoder().counters().jumps == 0);
}

TEST_CASE("The same reports and arrivals give the same outputs, bit for bit") {
  const auto run = [] {
    std::vector<double> outputs;
    Pipeline pipeline(HandTracker(Crooked(), {}));
    pipeline.OnConnected();
    std::mt19937_64 random(3);
    InputReport report = torquer::test::StillReport();
    for (int i = 0; i < 5000; ++i) {
      report = torquer::test::Next(report);
      report.axial_counts += static_cast<std::int32_t>(random() % 50);
      report.joystick_x = static_cast<std::uint16_t>(random() % 1024);
      const auto delay_us = static_cast<std::int64_t>(random() % 500);
      const auto output = pipeline.OnReport(BytesOf(report), 1000LL * i + delay_us);
      if (!output) continue;
      outputs.push_back(output->hand.pose.insertion_mm);
      outputs.push_back(output->hand.pose.lao_rad);
      outputs.push_back(static_cast<double>(output->origin_us));
    }
    return outputs;
  };
  CHECK(run() == run());
}

TEST_CASE("A transcript of clutch, lift, reset and replug gives the expected states") {
  torquer::calibration::Calibration calibration =
      torquer::calibration::NominalCalibration("X", 1200);
  calibration.motion.per_count = {{{1.0, 0.0}, {0.0, 1.0}}};
  Pipeline pipeline(HandTracker(calibration, {}));
  pipeline.OnConnected();
  InputReport report = torquer::test::StillReport();
  std::int64_t host_us = 0;
  const auto step = [&](int counts) {
    report = torquer::test::Next(report);
    report.axial_counts += counts;
    host_us += 1000;
    const auto output = pipeline.OnReport(BytesOf(report), host_us);
    REQUIRE(output);
    return *output;
  };

  CHECK(step(500).hand.pose.insertion_mm == 0.0);  // the start position is zero
  CHECK(step(10).hand.pose.insertion_mm == 10.0);

  report.buttons = torquer::protocol::kButtonClutch;
  CHECK(step(-4).hand.pose.insertion_mm == 10.0);
  CHECK(step(-4).hand.flags == torquer::protocol::kCommandClutch);
  report.buttons = 0;
  CHECK(step(0).hand.pose.insertion_mm == 10.0);
  CHECK(step(5).hand.pose.insertion_mm == 15.0);

  report.flags = torquer::protocol::kFlagLift;
  CHECK(step(77).hand.pose.insertion_mm == 15.0);
  report.flags = 0;
  CHECK(step(3).hand.pose.insertion_mm == 15.0);
  CHECK(step(1).hand.pose.insertion_mm == 16.0);

  // Watchdog reset: all of the device's counters restart.
  report = torquer::test::StillReport();
  report.boot_id = 200;
  CHECK(step(0).hand.pose.insertion_mm == 16.0);
  CHECK(step(2).hand.pose.insertion_mm == 18.0);

  // Replug of a device that kept its power: same boot, moved in the meantime.
  pipeline.OnConnected();
  report.sequence = 30000;
  report.device_time_us += 3000000;
  host_us += 3000000;
  const PipelineOutput back = step(40);
  CHECK(back.hand.pose.insertion_mm == 18.0);
  CHECK(back.origin_us == host_us);
  CHECK(step(1).hand.pose.insertion_mm == 19.0);

  // After the connection has settled, a gap is counted; it loses no motion.
  for (int i = 0; i < 4; ++i) step(0);
  report.sequence += 10;
  report.device_time_us += 10000;
  host_us += 10000;
  CHECK(step(6).hand.pose.insertion_mm == 25.0);
  CHECK(pipeline.decoder().counters().lost == 10);
}
