#include "calibration/fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "host/support/error.h"

namespace torquer::calibration {
namespace {

// One row of the model: value = gain[0] * axial + gain[1] * transverse.
struct RowFit {
  std::array<double, 2> gain{};
  Matrix2 covariance{};
};

// Accumulates the normal equations of a weighted regression on two regressors.
class RowRegression {
 public:
  void Add(double axial, double transverse, double value, double error) {
    const double weight = 1.0 / (error * error);
    aa_ += weight * axial * axial;
    at_ += weight * axial * transverse;
    tt_ += weight * transverse * transverse;
    av_ += weight * axial * value;
    tv_ += weight * transverse * value;
  }

  // 1 when all motions point the same way in the plane of counts, 0 when they spread evenly.
  bool Degenerate() const {
    const double determinant = aa_ * tt_ - at_ * at_;
    const double half_trace = 0.5 * (aa_ + tt_);
    return !(determinant > 1e-4 * half_trace * half_trace);
  }

  RowFit Solve() const {
    const double determinant = aa_ * tt_ - at_ * at_;
    RowFit fit;
    fit.covariance = {
        {{tt_ / determinant, -at_ / determinant}, {-at_ / determinant, aa_ / determinant}}};
    fit.gain = {fit.covariance[0][0] * av_ + fit.covariance[0][1] * tv_,
                fit.covariance[1][0] * av_ + fit.covariance[1][1] * tv_};
    return fit;
  }

 private:
  double aa_ = 0.0, at_ = 0.0, tt_ = 0.0, av_ = 0.0, tv_ = 0.0;
};

void Check(const ReferenceMotion& motion, std::size_t index) {
  const auto refuse = [&](const char* field, double value, const char* remedy) {
    throw UserError("reference motion " + std::to_string(index + 1) + ": " + field + " = " +
                    std::to_string(value) + "; " + remedy);
  };
  const auto finite = [&](const char* field, double value) {
    if (!std::isfinite(value)) refuse(field, value, "give a finite number");
  };
  finite("axial_counts", motion.axial_counts);
  finite("transverse_counts", motion.transverse_counts);
  finite("insertion_mm", motion.insertion_mm);
  finite("rotation_rad", motion.rotation_rad);
  const auto positive = [&](const char* field, double value) {
    if (!(value > 0.0 && std::isfinite(value))) {
      refuse(field, value, "declare how far the reference may be off, more than 0");
    }
  };
  positive("insertion_error_mm", motion.insertion_error_mm);
  positive("rotation_error_rad", motion.rotation_error_rad);
}

// First-order propagation of the gains' covariance through ParametersOf(), by central differences.
MotionParameters ParameterErrors(const MotionModel& model, const std::array<RowFit, 2>& rows) {
  using Field = double MotionParameters::*;
  constexpr std::array<Field, 4> kFields{
      &MotionParameters::gain_mm_per_count, &MotionParameters::misalignment_rad,
      &MotionParameters::cylinder_radius_mm, &MotionParameters::skew_rad};
  MotionParameters errors;
  for (const Field field : kFields) {
    double variance = 0.0;
    for (std::size_t row = 0; row < 2; ++row) {
      const double step = 1e-6 * std::hypot(model.per_count[row][0], model.per_count[row][1]);
      std::array<double, 2> slope{};
      for (std::size_t column = 0; column < 2; ++column) {
        MotionModel above = model;
        MotionModel below = model;
        above.per_count[row][column] += step;
        below.per_count[row][column] -= step;
        slope[column] = (ParametersOf(above).*field - ParametersOf(below).*field) / (2.0 * step);
      }
      const Matrix2& c = rows[row].covariance;
      variance += slope[0] * slope[0] * c[0][0] + 2.0 * slope[0] * slope[1] * c[0][1] +
                  slope[1] * slope[1] * c[1][1];
    }
    errors.*field = std::sqrt(variance);
  }
  return errors;
}

double Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

MotionFit FitMotion(std::span<const ReferenceMotion> motions, int cpi) {
  RowRegression insertion;
  RowRegression rotation;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const ReferenceMotion& motion = motions[i];
    Check(motion, i);
    insertion.Add(motion.axial_counts, motion.transverse_counts, motion.insertion_mm,
                  motion.insertion_error_mm);
    rotation.Add(motion.axial_counts, motion.transverse_counts, motion.rotation_rad,
                 motion.rotation_error_rad);
  }
  if (insertion.Degenerate() || rotation.Degenerate()) {
    throw UserError("the " + std::to_string(motions.size()) +
                    " reference motions do not tell pushing and turning apart; add strokes along "
                    "the axis and whole turns, each larger than the other motion in it");
  }
  const std::array<RowFit, 2> rows{insertion.Solve(), rotation.Solve()};

  MotionFit fit;
  fit.model.cpi = cpi;
  for (std::size_t row = 0; row < 2; ++row) {
    fit.model.per_count[row] = rows[row].gain;
    fit.model.standard_error[row] = {std::sqrt(rows[row].covariance[0][0]),
                                     std::sqrt(rows[row].covariance[1][1])};
  }
  fit.parameters = ParametersOf(fit.model);
  fit.parameter_error = ParameterErrors(fit.model, rows);
  for (const ReferenceMotion& motion : motions) {
    const auto predicted = [&](std::size_t row) {
      return rows[row].gain[0] * motion.axial_counts + rows[row].gain[1] * motion.transverse_counts;
    };
    const HandMotion residual{motion.insertion_mm - predicted(0),
                              motion.rotation_rad - predicted(1)};
    fit.residuals.push_back(residual);
    fit.chi_squared += std::pow(residual.insertion_mm / motion.insertion_error_mm, 2) +
                       std::pow(residual.rotation_rad / motion.rotation_error_rad, 2);
  }
  fit.degrees_of_freedom = 2 * static_cast<int>(motions.size()) - 4;
  return fit;
}

JoystickAxis FitJoystickAxis(std::span<const double> at_rest, std::span<const double> moved,
                             double full_rate_rad_per_s) {
  // A fifth of the way from the middle to the end; a stick that reaches less was not moved.
  constexpr double kLeastTravel = 100.0;
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
  if (axis.center - axis.dead_zone - axis.minimum < kLeastTravel ||
      axis.maximum - axis.center - axis.dead_zone < kLeastTravel) {
    throw UserError("the joystick rests at " + std::to_string(axis.center) +
                    " and was moved from " + std::to_string(axis.minimum) + " to " +
                    std::to_string(axis.maximum) +
                    "; move it to both ends, and let go of it at rest");
  }
  return axis;
}

}  // namespace torquer::calibration
