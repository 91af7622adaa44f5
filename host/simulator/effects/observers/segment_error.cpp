#include "host/simulator/effects/observers/segment_error.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>

namespace torquer::effects {

namespace {

bool IsAtRest(const TickView& tick) {
  return tick.relaxed_at_start || (tick.report.converged && tick.report.arrived());
}

// Largest distance between nodes of the same place along the wire. Nodes are counted from the tip,
// because the first segment takes what is left of the length. NaN for a wire that is too short.
double LargestDistanceMm(const Curve& fine, const Curve& coarse) {
  constexpr auto kStride = static_cast<int>(Comparison::kSegmentFactor);
  const int last = fine.segments();
  const int last_coarse = coarse.segments();
  constexpr int kFewest = 2;
  if (last > 0 && last_coarse < kFewest) return std::numeric_limits<double>::quiet_NaN();
  double largest_mm = 0;
  // The first node of either curve is its entry.
  for (int back = 0; back < last_coarse && kStride * back < last; ++back) {
    const auto at = static_cast<std::size_t>(last - kStride * back);
    const auto at_coarse = static_cast<std::size_t>(last_coarse - back);
    largest_mm = std::max(largest_mm, (fine.nodes()[at] - coarse.nodes()[at_coarse]).norm());
  }
  return largest_mm;
}

}  // namespace

void SegmentError::Restart() {
  error_mm_ = kUnknown;
  largest_ever_mm_ = kUnknown;
}

void SegmentError::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const SegmentError&>(twin);
  error_mm_ = from.error_mm_;
  largest_ever_mm_ = from.largest_ever_mm_;
}

void SegmentError::Compare(const TickView& tick, const TickView& coarse) {
  assert(tick.state.curves() == coarse.state.curves());
  error_mm_ = kUnknown;
  if (!IsAtRest(tick) || !IsAtRest(coarse)) return;
  double largest_mm = 0;
  for (int c = 0; c < tick.state.curves(); ++c) {
    const double apart_mm = LargestDistanceMm(tick.state.curve(c), coarse.state.curve(c));
    if (std::isnan(apart_mm)) return;
    largest_mm = std::max(largest_mm, apart_mm);
  }
  error_mm_ = kErrorOverDistance * largest_mm;
  largest_ever_mm_ = std::fmax(largest_ever_mm_, error_mm_);
}

std::vector<Reading> SegmentError::Readings() const {
  return {{"segment_error_mm", error_mm_}, {"segment_error_largest_ever_mm", largest_ever_mm_}};
}

namespace {

struct SegmentErrorSpec : TableSpec {};

const Keys<SegmentErrorSpec>& SegmentErrorKeys() {
  static const Keys<SegmentErrorSpec> keys = Keys<SegmentErrorSpec>().Example("");
  return keys;
}

std::unique_ptr<Effect> MakeSegmentError(const SegmentErrorSpec&, const EffectContext&) {
  return std::make_unique<SegmentError>();
}

}  // namespace

EffectKind SegmentErrorKind() {
  return {.name = "segment_error",
          .summary =
              "estimated error of the wire's place by the length of its segments, from a "
              "second run with segments twice as long",
          .roles = "observer, comparison",
          .keys = Any(SegmentErrorKeys()),
          .make = MakeWith(MakeSegmentError)};
}

}  // namespace torquer::effects
