// Simulated hand, ruler and sensor with known errors, for runs whose true values are known.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

#include "calibration/stroke_check.h"

namespace torquer::test {

/// Standard deviations. Half the variance of a stroke's error arises at its start, half at its end.
struct HandFaults {
  double push_mm = 0.5;                              ///< from a ruler read at both ends
  double push_turn_rad = std::numbers::pi / 180.0;   ///< turning while pushing
  double turn_rad = 1.5 * std::numbers::pi / 180.0;  ///< a line set by eye against a mark
  double turn_push_mm = 0.5;                         ///< pushing while turning
  calibration::CommonErrors common;                  ///< constant throughout a run
  double sensor_walk = 0.015;                        ///< counts per sqrt(count), each axis

  /// Exact references: only the sensor has noise.
  static HandFaults None() { return {0.0, 0.0, 0.0, 0.0, {}, 0.015}; }
};

/// Position of the cylinder's surface.
struct HandPose {
  double mm = 0.0;
  double rad = 0.0;
};

inline calibration::MotionParameters RandomTruth(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  calibration::MotionParameters truth;
  truth.gain_mm_per_count = calibration::kMmPerInch / 1200 * (1.0 + 0.1 * unit(random));
  truth.misalignment_rad = 0.1 * unit(random);
  truth.cylinder_radius_mm = 5.0 + unit(random);
  truth.skew_rad = 0.02 * unit(random);
  return truth;
}

/// Sensor that follows the hand and reports whole counts.
class SimulatedSensor {
 public:
  SimulatedSensor(const calibration::MotionParameters& truth, double walk, std::mt19937_64& random)
      : truth_(truth), walk_(walk), random_(random) {}

  void MoveTo(const HandPose& pose) {
    const double push = truth_.misalignment_rad;
    const double turn = push + truth_.skew_rad;
    const double counts_per_mm = (1.0 + height_gain_) / truth_.gain_mm_per_count;
    const double s = (pose.mm - at_.mm) * counts_per_mm;
    const double c = truth_.cylinder_radius_mm * (pose.rad - at_.rad) * counts_per_mm;
    const double noise = walk_ * std::sqrt(std::hypot(s, c));
    axial_ += std::cos(push) * s - std::sin(turn) * c + noise * normal_(random_);
    transverse_ += std::sin(push) * s + std::cos(turn) * c + noise * normal_(random_);
    at_ = pose;
  }
  /// Counts more for each motion, as a share: the cylinder is at another height.
  void SetHeightGain(double share) { height_gain_ = share; }
  double axial() const { return std::nearbyint(axial_); }
  double transverse() const { return std::nearbyint(transverse_); }

 private:
  calibration::MotionParameters truth_;
  double walk_;
  std::mt19937_64& random_;
  std::normal_distribution<double> normal_;
  HandPose at_;
  double height_gain_ = 0.0;
  double axial_ = 0.0, transverse_ = 0.0;
};

/// Hand that reaches each requested place with random errors.
class SimulatedHand {
 public:
  SimulatedHand(const HandFaults& faults, double length_mm, double turns, std::mt19937_64& random)
      : faults_(faults),
        length_mm_(length_mm),
        turn_rad_(2.0 * std::numbers::pi * turns),
        random_(random) {
    length_mm_ += faults.common.push_mm * Normal();
    turn_rad_ += faults.common.turn_rad * Normal();
    push_habit_rad_ = faults.common.push_turn_rad * Normal();
    turn_habit_mm_ = faults.common.turn_push_mm * Normal();
  }
  HandPose PushStart() { return Off({}, faults_.push_mm, faults_.push_turn_rad); }
  HandPose PushEnd() {
    return Off({length_mm_, push_habit_rad_}, faults_.push_mm, faults_.push_turn_rad);
  }
  HandPose TurnStart() { return Off({}, faults_.turn_push_mm, faults_.turn_rad); }
  HandPose TurnEnd() {
    return Off({turn_habit_mm_, turn_rad_}, faults_.turn_push_mm, faults_.turn_rad);
  }

 private:
  double Normal() { return normal_(random_); }
  HandPose Off(HandPose pose, double mm, double rad) {
    pose.mm += mm / std::numbers::sqrt2 * Normal();
    pose.rad += rad / std::numbers::sqrt2 * Normal();
    return pose;
  }

  HandFaults faults_;
  double length_mm_;
  double turn_rad_;
  std::mt19937_64& random_;
  std::normal_distribution<double> normal_;
  double push_habit_rad_ = 0.0, turn_habit_mm_ = 0.0;
};

/// Strokes of a run, pushes first.
inline std::vector<calibration::RecordedStroke> SimulatedStrokes(
    const calibration::MotionParameters& truth, const HandFaults& faults, int pushes, int turns,
    std::mt19937_64& random) {
  constexpr double kLengthMm = 150.0;
  constexpr double kTurns = 2.0;
  SimulatedSensor sensor(truth, faults.sensor_walk, random);
  SimulatedHand hand(faults, kLengthMm, kTurns, random);
  std::vector<calibration::RecordedStroke> strokes;
  for (int i = 0; i < pushes + turns; ++i) {
    calibration::RecordedStroke recorded;
    const bool push = i < pushes;
    recorded.stroke.kind = push ? calibration::MotionKind::kPush : calibration::MotionKind::kTurn;
    recorded.stroke.reference = push ? kLengthMm : 2.0 * std::numbers::pi * kTurns;
    if (i == 0 || i == pushes) sensor.MoveTo(push ? hand.PushStart() : hand.TurnStart());
    const double axial = sensor.axial();
    const double transverse = sensor.transverse();
    sensor.MoveTo(push ? hand.PushEnd() : hand.TurnEnd());
    recorded.stroke.axial_counts = sensor.axial() - axial;
    recorded.stroke.transverse_counts = sensor.transverse() - transverse;
    sensor.MoveTo(push ? hand.PushStart() : hand.TurnStart());
    recorded.back_axial_counts = sensor.axial() - axial - recorded.stroke.axial_counts;
    recorded.back_transverse_counts =
        sensor.transverse() - transverse - recorded.stroke.transverse_counts;
    strokes.push_back(recorded);
  }
  return strokes;
}

inline calibration::StrokeExpectation ExpectationOf(const HandFaults& faults) {
  calibration::StrokeExpectation expected;
  expected.turn_rad = 4.0 * std::numbers::pi;
  expected.push_error_mm = faults.push_mm + 0.02;
  expected.push_turn_error_rad = faults.push_turn_rad + 0.002;
  expected.turn_error_rad = faults.turn_rad + 0.002;
  expected.turn_push_error_mm = faults.turn_push_mm + 0.02;
  expected.gain_mm_per_count = calibration::kMmPerInch / 1200;
  return expected;
}

/// Strokes that were not refused.
inline std::vector<calibration::Stroke> GoodStrokes(
    const std::vector<calibration::RecordedStroke>& recorded,
    const calibration::StrokeExpectation& expected) {
  const auto rejections = calibration::JudgeStrokes(recorded, expected);
  std::vector<calibration::Stroke> good;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    if (!rejections[i]) good.push_back(recorded[i].stroke);
  }
  return good;
}

}  // namespace torquer::test
