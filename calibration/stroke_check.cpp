#include "calibration/stroke_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace torquer::calibration {
namespace {

constexpr double kPi = std::numbers::pi;
// Outlier threshold, in standard deviations. A good stroke exceeds it about once in a hundred runs.
constexpr double kOutlier = 4.0;
// Largest angle by which a sensor's bracket can be misaligned. A stroke at a larger angle is
// another motion.
constexpr double kLargestAngle = 25.0 * kPi / 180.0;
// Error of a sensor over a stroke, in counts, for an exact motion of the hand.
constexpr double kSensorCounts = 3.0;
// Smallest number of strokes with a meaningful median.
constexpr std::size_t kFewest = 3;

double Degrees(double rad) { return rad * 180.0 / kPi; }

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

// Surface motion of a stroke by nominal gains: mm along the requested direction and across it.
struct Surface {
  double along_mm;
  double across_mm;
};

Surface SurfaceOf(const Stroke& stroke, const StrokeExpectation& expected) {
  const double axial = stroke.axial_counts * expected.gain_mm_per_count;
  const double transverse = stroke.transverse_counts * expected.gain_mm_per_count;
  if (stroke.kind != MotionKind::kTurn) return {axial, transverse};
  return {transverse, axial};
}

Rejection JudgePush(const Surface& surface, double asked_mm, const StrokeExpectation& expected) {
  const double travel = std::hypot(surface.along_mm, surface.across_mm);
  if (travel < 0.5 * asked_mm / expected.gain_factor) {
    return fmt::format("too short: about {:.0f} mm instead of {:.0f} mm", travel, asked_mm);
  }
  if (surface.along_mm < -0.5 * travel) {
    return "wrong direction: the count decreased; push away from you (or the sensor is mounted in "
           "reverse)";
  }
  if (std::abs(std::atan2(surface.across_mm, surface.along_mm)) > kLargestAngle) {
    return fmt::format("turned while pushing, by about {:.0f} degrees",
                       Degrees(std::abs(surface.across_mm) / expected.cylinder_radius_mm));
  }
  if (travel > asked_mm * expected.gain_factor || travel < asked_mm / expected.gain_factor) {
    return fmt::format(
        "about {:.0f} mm by the sensor's resolution instead of {:.0f} mm: the push was incomplete, "
        "or the declared length is wrong",
        travel, asked_mm);
  }
  return std::nullopt;
}

Rejection JudgeTurn(const Surface& surface, double asked_rad, const StrokeExpectation& expected) {
  const double travel = std::hypot(surface.along_mm, surface.across_mm);
  const double turns = travel / (2.0 * kPi * expected.cylinder_radius_mm);
  const double asked_turns = asked_rad / (2.0 * kPi);
  const double factor = expected.gain_factor * expected.radius_factor;
  if (turns < 0.5 * asked_turns / factor) {
    return fmt::format("too little: about {:.1f} turns instead of {:.0f}", turns, asked_turns);
  }
  if (surface.along_mm < -0.5 * travel) {
    return "wrong direction: turn clockwise as you see it (or the sensor is mounted in reverse)";
  }
  if (std::abs(std::atan2(surface.across_mm, surface.along_mm)) > kLargestAngle) {
    return fmt::format("pushed while turning, by about {:.0f} mm", std::abs(surface.across_mm));
  }
  if (turns > asked_turns * factor || turns < asked_turns / factor) {
    return fmt::format(
        "about {:.1f} turns by the cylinder's radius instead of {:.0f}: the turns were miscounted, "
        "or the declared radius is wrong",
        turns, asked_turns);
  }
  return std::nullopt;
}

Rejection JudgeAlone(const RecordedStroke& recorded, const StrokeExpectation& expected) {
  if (recorded.interrupted) return "the device restarted or was disconnected during the stroke";
  if (recorded.faulty) return "the sensor did not answer during the stroke";
  if (recorded.lifted) {
    return "the sensor was lifted, or tracked the surface poorly, during the stroke";
  }
  const Surface surface = SurfaceOf(recorded.stroke, expected);
  return recorded.stroke.kind != MotionKind::kTurn
             ? JudgePush(surface, recorded.stroke.reference, expected)
             : JudgeTurn(surface, recorded.stroke.reference, expected);
}

// Deviation of a stroke, and of its end after the way back, from their nominal positions: mm of
// surface.
struct Deviation {
  Surface stroke;
  Surface closure;
};

// Deviations of all strokes from the median of those not refused so far; empty if too few remain.
std::vector<Deviation> Deviations(std::span<const RecordedStroke> strokes,
                                  std::span<const Rejection> rejections, MotionKind kind,
                                  const StrokeExpectation& expected) {
  std::array<std::vector<double>, 2> ratios;
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    const Stroke& stroke = strokes[i].stroke;
    if (stroke.kind != kind || rejections[i]) continue;
    ratios[0].push_back(stroke.axial_counts / stroke.reference);
    ratios[1].push_back(stroke.transverse_counts / stroke.reference);
  }
  if (ratios[0].size() < kFewest) return {};
  const double axial = Median(ratios[0]);
  const double transverse = Median(ratios[1]);
  const double length = std::hypot(axial, transverse);
  const auto split = [&](double a, double t) {
    const double mm = expected.gain_mm_per_count / length;
    return Surface{(a * axial + t * transverse) * mm, (t * axial - a * transverse) * mm};
  };
  std::vector<Deviation> deviations;
  for (const RecordedStroke& recorded : strokes) {
    const Stroke& stroke = recorded.stroke;
    deviations.push_back({split(stroke.axial_counts - axial * stroke.reference,
                                stroke.transverse_counts - transverse * stroke.reference),
                          split(stroke.axial_counts + recorded.back_axial_counts,
                                stroke.transverse_counts + recorded.back_transverse_counts)});
  }
  return deviations;
}

// Robust standard deviation of a single stroke, from the median deviation; for use with kOutlier.
double Spread(std::span<const Deviation> deviations, std::span<const RecordedStroke> strokes,
              std::span<const Rejection> rejections, MotionKind kind, double Surface::*part) {
  constexpr double kDeviationOfMedian = 1.4826;  // of a normal distribution
  std::vector<double> sizes;
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    if (strokes[i].stroke.kind == kind && !rejections[i]) {
      sizes.push_back(std::abs(deviations[i].stroke.*part));
    }
  }
  return kDeviationOfMedian * Median(sizes);
}

std::string PushReason(const Deviation& off, bool along, bool closure,
                       const StrokeExpectation& expected) {
  if (closure && along) {
    return fmt::format(
        "the return ended {:.1f} mm from the start of the stroke: the wire slipped, or did not "
        "reach the stop",
        std::abs(off.closure.along_mm));
  }
  if (closure) {
    return fmt::format("it came back turned by {:.0f} degrees: slipped, or turned on the way",
                       Degrees(std::abs(off.closure.across_mm) / expected.cylinder_radius_mm));
  }
  if (along) {
    return fmt::format("{:.1f} mm {}", std::abs(off.stroke.along_mm),
                       off.stroke.along_mm < 0.0
                           ? "shorter than the others: slipped, or stopped short"
                           : "longer than the others: started too early, or the others slipped");
  }
  return fmt::format("turned while pushing, by {:.0f} degrees more than the others",
                     Degrees(std::abs(off.stroke.across_mm) / expected.cylinder_radius_mm));
}

std::string TurnReason(const Deviation& off, bool along, bool closure,
                       const StrokeExpectation& expected) {
  const double degrees = Degrees(std::abs(closure ? off.closure.along_mm : off.stroke.along_mm) /
                                 expected.cylinder_radius_mm);
  if (closure && along) {
    return fmt::format(
        "turned back, it stood {:.0f} degrees from where it began: slipped, or the marks did "
        "not meet",
        degrees);
  }
  if (closure) {
    return fmt::format("it came back {:.1f} mm farther along: slipped, or pushed while turning",
                       std::abs(off.closure.across_mm));
  }
  if (along) {
    return fmt::format("{:.0f} degrees {}", degrees,
                       off.stroke.along_mm < 0.0
                           ? "less than the others: slipped, or miscounted"
                           : "more than the others: miscounted, or the others slipped");
  }
  return fmt::format("pushed while turning, by {:.1f} mm more than the others",
                     std::abs(off.stroke.across_mm));
}

// Refuses the worst outlier of one kind; false without an outlier.
bool RefuseOne(std::span<const RecordedStroke> strokes, std::vector<Rejection>& rejections,
               MotionKind kind, const StrokeExpectation& expected) {
  const std::vector<Deviation> deviations = Deviations(strokes, rejections, kind, expected);
  if (deviations.empty()) return false;
  const bool push = kind != MotionKind::kTurn;
  const double floor_mm = kSensorCounts * expected.gain_mm_per_count;
  const double radius = expected.cylinder_radius_mm;
  const double along_mm =
      std::max({floor_mm, push ? expected.push_error_mm : radius * expected.turn_error_rad,
                Spread(deviations, strokes, rejections, kind, &Surface::along_mm)});
  const double across_mm = std::max(
      {floor_mm, push ? radius * expected.push_turn_error_rad : expected.turn_push_error_mm,
       Spread(deviations, strokes, rejections, kind, &Surface::across_mm)});

  double worst = kOutlier;
  std::size_t worst_index = strokes.size();
  std::string reason;
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    if (strokes[i].stroke.kind != kind || rejections[i]) continue;
    const Deviation& off = deviations[i];
    // The start of a stroke and the end of its way back add two errors of reading.
    const double closure = std::numbers::sqrt2;
    const std::array<double, 4> sizes{std::abs(off.stroke.along_mm) / along_mm,
                                      std::abs(off.stroke.across_mm) / across_mm,
                                      std::abs(off.closure.along_mm) / (closure * along_mm),
                                      std::abs(off.closure.across_mm) / (closure * across_mm)};
    for (std::size_t k = 0; k < sizes.size(); ++k) {
      if (sizes[k] <= worst) continue;
      worst = sizes[k];
      worst_index = i;
      const bool along = k % 2 == 0;
      reason = push ? PushReason(off, along, k >= 2, expected)
                    : TurnReason(off, along, k >= 2, expected);
    }
  }
  if (worst_index == strokes.size()) return false;
  rejections[worst_index] = reason;
  return true;
}

}  // namespace

std::vector<Rejection> JudgeStrokes(std::span<const RecordedStroke> strokes,
                                    const StrokeExpectation& expected) {
  std::vector<Rejection> rejections;
  for (const RecordedStroke& stroke : strokes) rejections.push_back(JudgeAlone(stroke, expected));
  for (const MotionKind kind : {MotionKind::kPush, MotionKind::kTurn, MotionKind::kRaisedPush}) {
    while (RefuseOne(strokes, rejections, kind, expected)) {
    }
  }
  return rejections;
}

}  // namespace torquer::calibration
