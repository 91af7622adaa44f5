#include "host/recorder/session_series.h"

#include <algorithm>
#include <cmath>

namespace torquer {

Series::Stretch Series::Join(const Stretch& a, const Stretch& b) {
  if (!a.any) return b;
  if (!b.any) return a;
  return {true, b.low.value < a.low.value ? b.low : a.low,
          b.high.value > a.high.value ? b.high : a.high};
}

void Series::DoubleStretches() {
  stretch_s_ *= 2;
  for (std::size_t i = 0; i < stretches_.size(); i += 2) {
    const Stretch next = i + 1 < stretches_.size() ? stretches_[i + 1] : Stretch();
    stretches_[i / 2] = Join(stretches_[i], next);
  }
  stretches_.resize((stretches_.size() + 1) / 2);
}

void Series::Add(double time_s, double value) {
  if (!(std::abs(time_s) <= kMost && std::abs(value) <= kMost)) return;
  if (empty()) first_ = {time_s, value};
  if (!empty()) time_s = std::max(time_s, last_.time_s);
  const double since_first_s = time_s - first_.time_s;
  while (since_first_s / stretch_s_ >= static_cast<double>(kMostStretches)) DoubleStretches();
  const auto index = static_cast<std::size_t>(since_first_s / stretch_s_);
  if (index >= stretches_.size()) stretches_.resize(index + 1);
  last_ = {time_s, value};
  stretches_[index] = Join(stretches_[index], {true, last_, last_});
}

std::vector<SeriesPoint> Series::Points() const {
  std::vector<SeriesPoint> points;
  const auto add = [&points](const SeriesPoint& point) {
    const bool again = !points.empty() && points.back().time_s == point.time_s &&
                       points.back().value == point.value;
    if (!again) points.push_back(point);
  };
  if (!empty()) add(first_);
  for (const Stretch& stretch : stretches_) {
    if (!stretch.any) continue;
    const bool low_first = stretch.low.time_s <= stretch.high.time_s;
    add(low_first ? stretch.low : stretch.high);
    add(low_first ? stretch.high : stretch.low);
  }
  if (!empty()) add(last_);
  return points;
}

void Spans::JoinNearest() {
  std::size_t nearest = 1;
  for (std::size_t i = 2; i < spans_.size(); ++i) {
    if (spans_[i].begin_s - spans_[i - 1].end_s <
        spans_[nearest].begin_s - spans_[nearest - 1].end_s) {
      nearest = i;
    }
  }
  spans_[nearest - 1].end_s = spans_[nearest].end_s;
  spans_.erase(spans_.begin() + static_cast<std::ptrdiff_t>(nearest));
}

void Spans::Set(double time_s, bool on) {
  if (!(std::abs(time_s) <= Series::kMost)) return;
  if (begun_) time_s = std::max(time_s, time_s_);
  if (on_) {
    spans_.back().end_s = time_s;
    total_s_ += time_s - time_s_;
  } else if (on) {
    if (spans_.size() == kMostSpans) JoinNearest();
    spans_.push_back({time_s, time_s});
  }
  begun_ = true;
  on_ = on;
  time_s_ = time_s;
}

}  // namespace torquer
