#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "host/recorder/session_series.h"

using namespace torquer;

namespace {

SeriesPoint Lowest(const std::vector<SeriesPoint>& points) {
  return *std::min_element(points.begin(), points.end(),
                           [](auto& a, auto& b) { return a.value < b.value; });
}

SeriesPoint Highest(const std::vector<SeriesPoint>& points) {
  return *std::max_element(points.begin(), points.end(),
                           [](auto& a, auto& b) { return a.value < b.value; });
}

}  // namespace

TEST_CASE("A series keeps every peak of a session of any length") {
  // Four hours at 1 kHz: a wave, and two single peaks at odd times.
  const int count = GENERATE(100, 1999, 60'000, 14'400'000);
  const int high_at = count / 3 + 7;
  const int low_at = 2 * count / 3 + 11;
  Series series;
  for (int i = 0; i < count; ++i) {
    const double value = i == high_at ? 5.5 : i == low_at ? -4.5 : std::sin(1e-4 * i);
    series.Add(2 + 1e-3 * i, value);
  }
  const std::vector<SeriesPoint> points = series.Points();
  REQUIRE(points.size() <= Series::kMostPoints);
  CHECK(points.size() >= std::min(static_cast<std::size_t>(count), Series::kMostPoints / 4));
  CHECK(Highest(points).value == 5.5);
  CHECK(Highest(points).time_s == Approx(2 + 1e-3 * high_at));
  CHECK(Lowest(points).value == -4.5);
  CHECK(Lowest(points).time_s == Approx(2 + 1e-3 * low_at));
  CHECK(points.front().time_s == 2);
  CHECK(points.front().value == 0);
  CHECK(points.back().time_s == Approx(2 + 1e-3 * (count - 1)));
  CHECK(points.back().value == Approx(std::sin(1e-4 * (count - 1))));
  CHECK(std::is_sorted(points.begin(), points.end(),
                       [](auto& a, auto& b) { return a.time_s < b.time_s; }));
}

TEST_CASE("A series takes any numbers, and omits NaN") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Series series;
  CHECK(series.empty());
  CHECK(series.Points().empty());
  for (const double odd : {kNan, kInfinity, -kInfinity, 1e300}) {
    series.Add(odd, 1);
    series.Add(1, odd);
  }
  CHECK(series.empty());
  series.Add(-1e12, 3);
  series.Add(1e12, 4);
  series.Add(0, 7);  // late: counts as the newest time
  const std::vector<SeriesPoint> points = series.Points();
  REQUIRE(points.size() == 3);
  CHECK(points.back().time_s == 1e12);
  CHECK(points.back().value == 7);
}

TEST_CASE("Spans are bounded, and their total is exact") {
  Spans spans;
  spans.Set(0, false);
  // On for 10 ms in every 100 ms, with one long pause in the middle.
  constexpr int kTimes = 3000;
  for (int i = 0; i < kTimes; ++i) {
    const double begin_s = 0.1 * i + (i >= kTimes / 2 ? 50 : 0);
    spans.Set(begin_s, true);
    spans.Set(begin_s + 0.004, true);
    spans.Set(begin_s + 0.01, false);
  }
  CHECK(spans.total_s() == Approx(0.01 * kTimes));
  REQUIRE(spans.spans().size() == Spans::kMostSpans);
  CHECK(spans.spans().front().begin_s == 0);
  CHECK(spans.spans().back().end_s == Approx(0.1 * (kTimes - 1) + 50.01));
  double largest_pause_s = 0;
  for (std::size_t i = 1; i < spans.spans().size(); ++i) {
    const double pause_s = spans.spans()[i].begin_s - spans.spans()[i - 1].end_s;
    CHECK(pause_s > 0);
    largest_pause_s = std::max(largest_pause_s, pause_s);
  }
  CHECK(largest_pause_s == Approx(50.09));
}
