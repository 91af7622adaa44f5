// What a session was like over time, in memory that does not grow with the session.
#pragma once

#include <cstddef>
#include <vector>

namespace torquer {

/// One value at one time.
struct SeriesPoint {
  double time_s = 0;
  double value = 0;
};

/// A measurement over time. Of a session of any length at most kMostPoints points are kept: the
/// lowest and the highest value of each of equal stretches of time, and the first and last value.
/// A peak is never lost, and its time is exact.
class Series {
 public:
  static constexpr std::size_t kMostPoints = 2000;
  /// Values and times beyond it, of either sign, cannot be drawn and are no measurements.
  static constexpr double kMost = 1e12;

  /// What is not finite or beyond kMost is left out. A time before the newest one counts as that.
  void Add(double time_s, double value);

  bool empty() const { return stretches_.empty(); }
  /// The newest point; only where there is one.
  const SeriesPoint& last() const { return last_; }
  /// What was kept; times do not descend.
  std::vector<SeriesPoint> Points() const;

 private:
  struct Stretch {
    bool any = false;
    SeriesPoint low;
    SeriesPoint high;
  };
  static constexpr std::size_t kMostStretches = (kMostPoints - 2) / 2;

  static Stretch Join(const Stretch& a, const Stretch& b);
  void DoubleStretches();

  double stretch_s_ = 1e-3;
  std::vector<Stretch> stretches_;  // from the first point's time on
  SeriesPoint first_;
  SeriesPoint last_;
};

/// From when to when.
struct Span {
  double begin_s = 0;
  double end_s = 0;
};

/// When something was on. Where it went on more than kMostSpans times, those nearest to each other
/// are shown as one; the total stays exact.
class Spans {
 public:
  static constexpr std::size_t kMostSpans = 500;

  /// Whether it is on from `time_s` until the next call. A time before the newest one counts as
  /// that; one that is not finite or beyond Series::kMost is left out.
  void Set(double time_s, bool on);

  const std::vector<Span>& spans() const { return spans_; }  ///< in order, apart
  double total_s() const { return total_s_; }                ///< up to the newest call

 private:
  void JoinNearest();

  std::vector<Span> spans_;
  double total_s_ = 0;
  double time_s_ = 0;
  bool begun_ = false;
  bool on_ = false;
};

}  // namespace torquer
