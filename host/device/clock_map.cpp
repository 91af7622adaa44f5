#include "host/device/clock_map.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace torquer::device {
namespace {

constexpr double kBlockUs = 250000.0;
constexpr std::size_t kBlocks = 120;
// A line through fewer blocks follows the jitter rather than the drift.
constexpr std::size_t kBlocksForDrift = 4;
// Twice the error of a ceramic resonator. A larger drift means that the clock does not run evenly.
constexpr double kLargestDrift = 0.01;
// A report this early, or a whole block this late, means that the clocks have jumped.
constexpr double kJumpUs = 20000.0;

}  // namespace

void ClockMap::Reset() {
  begun_ = false;
  minima_.clear();
  drift_ = 0.0;
}

std::optional<double> ClockMap::drift() const {
  return minima_.size() < kBlocksForDrift ? std::nullopt : std::optional(drift_);
}

void ClockMap::Begin(std::int64_t device_us, std::int64_t host_us) {
  begun_ = true;
  anchor_device_us_ = device_us;
  anchor_host_us_ = host_us;
  minima_.clear();
  block_minimum_ = {};
  block_start_ = 0.0;
  offset_ = 0.0;
  drift_ = 0.0;
}

std::int64_t ClockMap::Map(std::int64_t device_us, std::int64_t host_us) {
  if (!begun_) Begin(device_us, host_us);
  Point point;
  point.device = static_cast<double>(device_us - anchor_device_us_);
  point.excess = static_cast<double>((host_us - anchor_host_us_) - (device_us - anchor_device_us_));

  const double host = point.device + point.excess;
  if (host - block_start_ >= kBlockUs) {
    FinishBlock();
    if (!begun_) {
      Begin(device_us, host_us);
      point = {};
    } else {
      block_start_ = host;
    }
    block_minimum_ = point;
  }
  if (point.excess - drift_ * point.device <
      block_minimum_.excess - drift_ * block_minimum_.device) {
    block_minimum_ = point;
  }
  // No report arrives before it is sent: the line moves down at once.
  const double early = offset_ - (point.excess - drift_ * point.device);
  if (early > kJumpUs) {
    ++restarts_;
    Begin(device_us, host_us);
    point = {};
  } else if (early > 0.0) {
    offset_ -= early;
  }

  const double excess = offset_ + drift_ * point.device;
  const std::int64_t origin_us = anchor_host_us_ + (device_us - anchor_device_us_) +
                                 static_cast<std::int64_t>(std::floor(excess));
  last_origin_us_ = std::min(host_us, std::max(origin_us, last_origin_us_));
  return last_origin_us_;
}

void ClockMap::FinishBlock() {
  const double late = block_minimum_.excess - (offset_ + drift_ * block_minimum_.device);
  if (late > kJumpUs) {
    ++restarts_;
    begun_ = false;
    return;
  }
  // No line goes through points of a device clock that stands still.
  if (!minima_.empty() && block_minimum_.device <= minima_.back().device) return;
  minima_.push_back(block_minimum_);
  if (minima_.size() > kBlocks) minima_.pop_front();
  Refit();
}

// Edge of the lower convex hull below the mean device time. Of all lines below the points, it has
// the least sum of distances to them.
void ClockMap::Refit() {
  if (minima_.size() < kBlocksForDrift) {
    offset_ = minima_.front().excess;
    for (const Point& point : minima_) offset_ = std::min(offset_, point.excess);
    return;
  }
  std::vector<Point> hull;
  double mean = 0.0;
  for (const Point& point : minima_) {
    mean += point.device / static_cast<double>(minima_.size());
    while (hull.size() >= 2) {
      const Point& a = hull[hull.size() - 2];
      const Point& b = hull.back();
      const bool b_above_chord = (b.excess - a.excess) * (point.device - a.device) >=
                                 (point.excess - a.excess) * (b.device - a.device);
      if (!b_above_chord) break;
      hull.pop_back();
    }
    hull.push_back(point);
  }
  for (std::size_t i = 1; i < hull.size(); ++i) {
    if (hull[i].device < mean) continue;
    const Point& a = hull[i - 1];
    const Point& b = hull[i];
    const double slope = (b.excess - a.excess) / (b.device - a.device);
    drift_ = std::clamp(slope, -kLargestDrift, kLargestDrift);
    offset_ = a.excess - drift_ * a.device;
    break;
  }
  // A clamped slope could cut through the points.
  for (const Point& point : minima_) {
    offset_ = std::min(offset_, point.excess - drift_ * point.device);
  }
}

}  // namespace torquer::device
