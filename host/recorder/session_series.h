// Time series of a session, in memory that does not grow with the session.
#pragma once

#include <cstddef>
#include <vector>

namespace torquer {

/// Value at one time.
struct SeriesPoint {
  double time_s = 0;
  double value = 0;
};

/// Time series of one measurement. It keeps at most kMostPoints points for a session of any length.
/// These are the minimum and maximum of equal time intervals, and the first and last value. A peak
/// is never lost, and its time is exact.
class Series {
 public:
  static constexpr std::size_t kMostPoints = 2000;
  /// Values and times of larger magnitude are treated as invalid.
  static constexpr double kMost = 1e12;

  /// Ignores a point that is not finite or beyond kMost. A time before the newest one is replaced
  /// by it.
  void Add(double time_s, double value);

  bool empty() const { return stretches_.empty(); }
  /// Newest point; the series must not be empty.
  const SeriesPoint& last() const { return last_; }
  /// Kept points; times never decrease.
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
  std::vector<Stretch> stretches_;  // consecutive, starting at the first point's time
  SeriesPoint first_;
  SeriesPoint last_;
};

/// Time interval.
struct Span {
  double begin_s = 0;
  double end_s = 0;
};

/// Intervals in which something was on. If there are more than kMostSpans, the closest ones are
/// merged; the total stays exact.
class Spans {
 public:
  static constexpr std::size_t kMostSpans = 500;

  /// Sets the state from `time_s` until the next call. A time before the newest one is replaced by
  /// it. A time that is not finite or beyond Series::kMost is ignored.
  void Set(double time_s, bool on);

  const std::vector<Span>& spans() const { return spans_; }  ///< in order, without overlap
  double total_s() const { return total_s_; }                ///< up to the newest call of Set
  bool on() const { return on_; }                            ///< since the newest call of Set

 private:
  void JoinNearest();

  std::vector<Span> spans_;
  double total_s_ = 0;
  double time_s_ = 0;
  bool begun_ = false;
  bool on_ = false;
};

}  // namespace torquer
