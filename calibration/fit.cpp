#include "calibration/fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>

#include "host/support/error.h"

namespace torquer::calibration {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Counts are rounded at both ends of a stroke: twice the variance of a uniform distribution.
constexpr double kRoundingVariance = 2.0 / 12.0;

using Vector2 = std::array<double, 2>;

// Unknowns of the fit: counts per mm of push (0, 1) and per rad of turn (2, 3). Axial counts come
// before transverse counts.
using Unknowns = std::array<double, 4>;

// One independent source of error in the unknowns.
struct Source {
  std::array<Unknowns, 4> covariance{};
  double degrees_of_freedom = kInfinity;
};

double Along(const Source& source, const Unknowns& gradient) {
  double variance = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      variance += gradient[i] * source.covariance[i][j] * gradient[j];
    }
  }
  return variance;
}

// An estimate that moves with the unknowns by `gradient`. The degrees of freedom of a sum of
// variances are Satterthwaite's (Biometrics Bulletin 2, 1946, 110).
Estimate Propagate(double value, const Unknowns& gradient, std::span<const Source> sources) {
  Estimate estimate;
  estimate.value = value;
  double variance = 0.0;
  double spread = 0.0;
  for (const Source& source : sources) {
    const double part = Along(source, gradient);
    variance += part;
    spread += part * part / source.degrees_of_freedom;
  }
  estimate.standard_error = std::sqrt(variance);
  estimate.degrees_of_freedom = spread > 0.0 ? variance * variance / spread : kInfinity;
  return estimate;
}

double DeclaredShare(const Unknowns& gradient, std::span<const Source> sources) {
  double declared = 0.0;
  double all = 0.0;
  for (const Source& source : sources) {
    const double part = Along(source, gradient);
    all += part;
    if (std::isinf(source.degrees_of_freedom)) declared += part;
  }
  return all > 0.0 ? declared / all : 0.0;
}

// A line through the origin: counts = slope * reference.
struct Line {
  int count = 0;  // of strokes
  Vector2 slope{};
  Matrix2 covariance{};  // of the slope, from the scatter
  double degrees_of_freedom = 0.0;
  double reference = 0.0;  // root of the weighted mean square
};

Line FitLine(std::span<const Stroke> strokes, MotionKind kind) {
  double weights = 0.0;
  double squares = 0.0;
  Line line;
  for (const Stroke& stroke : strokes) {
    if (stroke.kind != kind) continue;
    ++line.count;
    const double weight = 1.0 / (stroke.reference_error * stroke.reference_error);
    weights += weight;
    squares += weight * stroke.reference * stroke.reference;
    line.slope[0] += weight * stroke.reference * stroke.axial_counts;
    line.slope[1] += weight * stroke.reference * stroke.transverse_counts;
  }
  if (line.count < 2) {
    throw UserError(fmt::format(
        "there {} {} {}; take at least two, because their scatter gives the error of the result",
        line.count == 1 ? "is" : "are", line.count,
        kind == MotionKind::kPush   ? "pushes"
        : kind == MotionKind::kTurn ? "turns"
                                    : "raised pushes"));
  }
  for (double& slope : line.slope) slope /= squares;
  line.degrees_of_freedom = line.count - 1;
  line.reference = std::sqrt(squares / weights);
  for (const Stroke& stroke : strokes) {
    if (stroke.kind != kind) continue;
    const double weight = 1.0 / (stroke.reference_error * stroke.reference_error);
    const Vector2 residual{stroke.axial_counts - line.slope[0] * stroke.reference,
                           stroke.transverse_counts - line.slope[1] * stroke.reference};
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t j = 0; j < 2; ++j) {
        line.covariance[i][j] +=
            weight * residual[i] * residual[j] / line.degrees_of_freedom / squares;
      }
    }
  }
  return line;
}

std::vector<Source> Sources(const Line& push, const Line& turn, const CommonErrors& common) {
  std::vector<Source> sources;
  const auto add_block = [&](std::size_t at, const Matrix2& covariance, double degrees_of_freedom) {
    Source source;
    source.degrees_of_freedom = degrees_of_freedom;
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t j = 0; j < 2; ++j) source.covariance[at + i][at + j] = covariance[i][j];
    }
    sources.push_back(source);
  };
  // Error of the unknowns at `at` along `direction`: a fraction with the standard deviation `size`.
  const auto add_common = [&](std::size_t at, const Vector2& direction, double size) {
    Matrix2 covariance{};
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t j = 0; j < 2; ++j) {
        covariance[i][j] = size * size * direction[i] * direction[j];
      }
    }
    add_block(at, covariance, kInfinity);
  };
  const auto add_rounding = [&](std::size_t at, double reference) {
    const double variance = kRoundingVariance / (reference * reference);
    add_block(at, {{{variance, 0.0}, {0.0, variance}}}, kInfinity);
  };
  add_block(0, push.covariance, push.degrees_of_freedom);
  add_block(2, turn.covariance, turn.degrees_of_freedom);
  add_common(0, push.slope, common.push_mm / push.reference);
  add_common(0, turn.slope, common.push_turn_rad / push.reference);
  add_common(2, turn.slope, common.turn_rad / turn.reference);
  add_common(2, push.slope, common.turn_push_mm / turn.reference);
  add_rounding(0, push.reference);
  add_rounding(2, turn.reference);
  return sources;
}

Matrix2 Inverse(const Unknowns& counts) {
  const double determinant = counts[0] * counts[3] - counts[2] * counts[1];
  return {{{counts[3] / determinant, -counts[2] / determinant},
           {-counts[1] / determinant, counts[0] / determinant}}};
}

// Slope of a function of the model in each of the unknowns, by central differences.
Unknowns Gradient(const Unknowns& counts, const std::function<double(const MotionModel&)>& value) {
  Unknowns gradient{};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t column = i / 2 * 2;
    const double step = 1e-6 * std::hypot(counts[column], counts[column + 1]);
    const auto at = [&](double change) {
      Unknowns moved = counts;
      moved[i] += change;
      MotionModel model;
      model.per_count = Inverse(moved);
      return value(model);
    };
    gradient[i] = (at(step) - at(-step)) / (2.0 * step);
  }
  return gradient;
}

void Check(const Stroke& stroke, std::size_t index) {
  const auto require = [&](bool good, const char* field, double value, const char* remedy) {
    if (good) return;
    throw UserError(fmt::format("stroke {}: {} = {:g}; {}", index + 1, field, value, remedy));
  };
  for (const auto& [field, value] : {std::pair{"axial_counts", stroke.axial_counts},
                                     std::pair{"transverse_counts", stroke.transverse_counts}}) {
    require(std::isfinite(value), field, value, "give a finite number");
  }
  require(std::isfinite(stroke.reference) && stroke.reference != 0.0, "reference", stroke.reference,
          "give the intended motion of the hand in mm or rad, not 0");
  require(stroke.reference_error > 0.0 && std::isfinite(stroke.reference_error), "reference_error",
          stroke.reference_error, "give the standard deviation of the reference, more than 0");
}

void Check(const CommonErrors& common) {
  for (const auto& [field, value] :
       {std::pair{"push_mm", common.push_mm}, std::pair{"push_turn_rad", common.push_turn_rad},
        std::pair{"turn_rad", common.turn_rad}, std::pair{"turn_push_mm", common.turn_push_mm},
        std::pair{"height_gain", common.height_gain}}) {
    if (!(value >= 0.0 && std::isfinite(value))) {
      throw UserError(fmt::format("common error {} = {:g}; give a standard deviation, 0 or more",
                                  field, value));
    }
  }
}

// Smallest angle between pushes and turns in the plane of counts. Below it the two are too similar
// to fit.
void CheckApart(const Line& push, const Line& turn) {
  const double area = push.slope[0] * turn.slope[1] - push.slope[1] * turn.slope[0];
  const double lengths =
      std::hypot(push.slope[0], push.slope[1]) * std::hypot(turn.slope[0], turn.slope[1]);
  if (std::abs(area) > 0.1 * lengths) return;
  throw UserError(
      "pushes and turns move the sensor's counts the same way, so that they cannot be "
      "distinguished; "
      "push along the axis and turn about it, and see whether the sensor looks at the cylinder");
}

// Change of the counts along the pushes when the cylinder is raised. Pushes and raised pushes share
// one scatter.
Estimate HeightGain(const Line& push, const Line& raised) {
  const double square = push.slope[0] * push.slope[0] + push.slope[1] * push.slope[1];
  const auto variance_of_one = [&](const Line& line) {
    double along = 0.0;
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t j = 0; j < 2; ++j) {
        along += push.slope[i] * line.covariance[i][j] * push.slope[j];
      }
    }
    return line.count * along / (square * square);
  };
  Estimate gain;
  gain.value = (raised.slope[0] * push.slope[0] + raised.slope[1] * push.slope[1]) / square - 1.0;
  gain.degrees_of_freedom = push.degrees_of_freedom + raised.degrees_of_freedom;
  const double scatter = (push.degrees_of_freedom * variance_of_one(push) +
                          raised.degrees_of_freedom * variance_of_one(raised)) /
                         gain.degrees_of_freedom;
  const double rounding = kRoundingVariance / (raised.reference * raised.reference * square);
  gain.standard_error = std::sqrt((scatter + rounding) / raised.count);
  return gain;
}

// The height changes the counts of pushes and turns together: all unknowns by the same fraction.
Source HeightSource(const Unknowns& counts, const Estimate& height_gain) {
  Source source;
  source.degrees_of_freedom = height_gain.degrees_of_freedom;
  const double variance = height_gain.standard_error * height_gain.standard_error;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) source.covariance[i][j] = variance * counts[i] * counts[j];
  }
  return source;
}

// Height gain from the raised pushes, or the declared bound without any.
void AddHeightGain(std::span<const Stroke> strokes, const Line& push, const CommonErrors& common,
                   MotionFit& fit) {
  fit.height_measured = std::any_of(strokes.begin(), strokes.end(), [](const Stroke& stroke) {
    return stroke.kind == MotionKind::kRaisedPush;
  });
  fit.height_gain.degrees_of_freedom = kInfinity;
  fit.height_gain.bound = common.height_gain;
  if (!fit.height_measured) return;
  fit.height_gain = HeightGain(push, FitLine(strokes, MotionKind::kRaisedPush));
  fit.height_gain.bound = std::abs(fit.height_gain.value);
}

double Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

void AddResiduals(std::span<const Stroke> strokes, const Line& push, const Line& turn,
                  MotionFit& fit) {
  const Matrix2& m = fit.model.per_count;
  for (const Stroke& stroke : strokes) {
    const bool is_push = stroke.kind != MotionKind::kTurn;
    HandMotion residual{is_push ? stroke.reference : 0.0, is_push ? 0.0 : stroke.reference};
    residual.insertion_mm -= m[0][0] * stroke.axial_counts + m[0][1] * stroke.transverse_counts;
    residual.rotation_rad -= m[1][0] * stroke.axial_counts + m[1][1] * stroke.transverse_counts;
    fit.residuals.push_back(residual);
    if (stroke.kind == MotionKind::kRaisedPush) continue;
    HandMotion& scatter = is_push ? fit.push_scatter : fit.turn_scatter;
    const double share = 1.0 / (is_push ? push : turn).degrees_of_freedom;
    scatter.insertion_mm += share * residual.insertion_mm * residual.insertion_mm;
    scatter.rotation_rad += share * residual.rotation_rad * residual.rotation_rad;
  }
  for (HandMotion* scatter : {&fit.push_scatter, &fit.turn_scatter}) {
    scatter->insertion_mm = std::sqrt(scatter->insertion_mm);
    scatter->rotation_rad = std::sqrt(scatter->rotation_rad);
  }
}

}  // namespace

double StudentHalfWidth95(double degrees_of_freedom) {
  const boost::math::students_t distribution(degrees_of_freedom);
  return boost::math::quantile(boost::math::complement(distribution, 0.025));
}

double Estimate::HalfWidth95() const {
  return standard_error * StudentHalfWidth95(degrees_of_freedom) + bound;
}

MotionFit FitMotion(std::span<const Stroke> strokes, const CommonErrors& common, int cpi) {
  for (std::size_t i = 0; i < strokes.size(); ++i) Check(strokes[i], i);
  Check(common);
  const Line push = FitLine(strokes, MotionKind::kPush);
  const Line turn = FitLine(strokes, MotionKind::kTurn);
  CheckApart(push, turn);
  const Unknowns counts{push.slope[0], push.slope[1], turn.slope[0], turn.slope[1]};

  MotionFit fit;
  AddHeightGain(strokes, push, common, fit);
  std::vector<Source> sources = Sources(push, turn, common);
  if (fit.height_measured) sources.push_back(HeightSource(counts, fit.height_gain));
  // Adds to an estimate the fraction by which the height may change it.
  const auto propagate = [&](double value, const Unknowns& gradient) {
    Estimate estimate = Propagate(value, gradient, sources);
    const double change = std::inner_product(gradient.begin(), gradient.end(), counts.begin(), 0.0);
    estimate.bound = std::abs(change) * fit.height_gain.bound;
    return estimate;
  };
  fit.model.cpi = cpi;
  fit.model.per_count = Inverse(counts);
  const auto estimate = [&](const std::function<double(const MotionModel&)>& value) {
    return propagate(value(fit.model), Gradient(counts, value));
  };
  for (std::size_t row = 0; row < 2; ++row) {
    for (std::size_t column = 0; column < 2; ++column) {
      const Estimate element =
          estimate([=](const MotionModel& model) { return model.per_count[row][column]; });
      // The height is assumed to be uniformly distributed within its bound.
      fit.model.standard_error[row][column] =
          std::hypot(element.standard_error, element.bound / std::numbers::sqrt3);
    }
  }
  const auto parameter = [&](double MotionParameters::*field) {
    return estimate([=](const MotionModel& model) { return ParametersOf(model).*field; });
  };
  fit.gain_mm_per_count = parameter(&MotionParameters::gain_mm_per_count);
  fit.misalignment_rad = parameter(&MotionParameters::misalignment_rad);
  fit.cylinder_radius_mm = parameter(&MotionParameters::cylinder_radius_mm);
  fit.skew_rad = parameter(&MotionParameters::skew_rad);

  // A true motion changes the counts by the true slopes. The error of the model is its motion for
  // the difference between true and fitted slopes.
  const Matrix2& m = fit.model.per_count;
  const auto figure = [&](std::size_t row, std::size_t at, double size) {
    Unknowns gradient{};
    gradient[at] = size * m[row][0];
    gradient[at + 1] = size * m[row][1];
    return gradient;
  };
  constexpr double kTurn = 2.0 * std::numbers::pi;
  fit.push_error_mm = propagate(0.0, figure(0, 0, kFigureStrokeMm));
  fit.push_turns_rad = propagate(0.0, figure(1, 0, kFigureStrokeMm));
  fit.turn_error_rad = propagate(0.0, figure(1, 2, kTurn));
  fit.turn_pushes_mm = propagate(0.0, figure(0, 2, kTurn));
  fit.push_declared_share = DeclaredShare(figure(0, 0, kFigureStrokeMm), sources);
  fit.turn_declared_share = DeclaredShare(figure(1, 2, kTurn), sources);
  AddResiduals(strokes, push, turn, fit);
  return fit;
}

JoystickAxis FitJoystickAxis(std::span<const double> at_rest, std::span<const double> moved,
                             double full_rate_rad_per_s) {
  constexpr double kDeviations = 4.0;
  if (at_rest.empty() || moved.empty()) {
    throw UserError("no joystick readings; release the stick, then move it to both ends");
  }
  JoystickAxis axis;
  axis.full_rate_rad_per_s = full_rate_rad_per_s;
  axis.center = Mean(at_rest);
  double variance = 0.0;
  double farthest = 0.0;
  for (const double reading : at_rest) {
    variance += std::pow(reading - axis.center, 2) / static_cast<double>(at_rest.size());
    farthest = std::max(farthest, std::abs(reading - axis.center));
  }
  axis.dead_zone = std::max(farthest, kDeviations * std::sqrt(variance)) + 1.0;
  axis.minimum = *std::min_element(moved.begin(), moved.end());
  axis.maximum = *std::max_element(moved.begin(), moved.end());
  if (axis.center - axis.dead_zone - axis.minimum < kLeastJoystickTravel ||
      axis.maximum - axis.center - axis.dead_zone < kLeastJoystickTravel) {
    throw UserError(fmt::format(
        "the joystick rests at {:.1f} and was moved from {:.0f} to {:.0f}; move it to both ends, "
        "and let go of it at rest",
        axis.center, axis.minimum, axis.maximum));
  }
  return axis;
}

}  // namespace torquer::calibration
