// Guided calibration as a state machine. It takes readings and keys, and gives instructions and
// finally a calibration. It does no I/O, and its only clock is the time in the readings.
//
//   rest -> pushes -> raised pushes -> turns -> joystick -> done
//
// A stroke is the motion between two marks. The operator rests at one place, marks it, moves to the
// other place, marks it, and comes back. Only the way forward is measured, because both ways share
// the errors of the places. The way back shows if anything slipped.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "calibration/fit.h"
#include "calibration/motion_model.h"
#include "calibration/stroke_check.h"

namespace torquer::calibration {

/// One report of the device, in order of time.
struct Reading {
  std::int64_t time_us = 0;  ///< the device's clock
  std::int64_t axial_counts = 0;
  std::int64_t transverse_counts = 0;
  double joystick_x = 512.0;  ///< 0 .. 1023
  double joystick_y = 512.0;
  int surface_quality = 0;
  bool lifted = false;       ///< lift flag or poor surface
  bool faulty = false;       ///< sensor fault
  bool interrupted = false;  ///< does not continue the previous reading: reset, reconnected, jumped
  bool button = false;       ///< held; pressing it marks
};

enum class Key {
  kMark,  ///< here it is
  kUndo,  ///< forget the last stroke
  kSkip   ///< go on without this step
};

enum class Step { kRest, kPushes, kRaised, kTurns, kJoystick, kDone };

/// Standard deviations of a careful hand, measured or assumed; declare others for a fixture or an
/// unsteady hand. The deviations of one stroke give its weight, and find outliers. Common
/// deviations add to the stated errors.
struct ProcedureSettings {
  bool ruler = false;            ///< lengths are read off a ruler each time, not given by end stops
  double length_mm = 150.0;      ///< of a push
  double length_error_mm = 0.5;  ///< of the stops' distance (common), or of each reading (ruler)
  double stop_play_mm = 0.2;     ///< of one stroke between stops
  double ruler_scale_mm = 0.1;   ///< of the ruler itself over length_mm (common)
  int pushes = 6;                ///< good ones wanted, >= 3
  int turn_strokes = 5;          ///< likewise
  int turns = 2;                 ///< whole turns a stroke, >= 1
  double push_turn_rad = 0.0175;        ///< a hand turns by that in a push
  double push_turn_habit_rad = 0.0087;  ///< and by that in every push
  double mark_rad = 0.026;              ///< error of aligning a line with a mark, per stroke
  double turn_push_mm = 0.5;            ///< unintended push in a stroke of turns
  double turn_push_habit_mm = 0.3;      ///< and by that in every one
  /// Height by which the cylinder can rise in its bore, 0 .. 2; 0.3 in the drawing, without the
  /// preload. If the raised pushes are skipped, it bounds the error that the height causes.
  double play_mm = 0.3;
  double cylinder_radius_mm = kNominalCylinderRadiusMm;
  int cpi = kNominalCpi;
  bool cpi_known = true;  ///< false for an ordinary mouse
  bool has_joystick = true;
};

/// Prompt shown to the operator.
struct Prompt {
  Step step = Step::kRest;
  std::string title;
  std::string instruction;
  int done = 0;          ///< good strokes so far, in steps that count them
  int wanted = 0;        ///< 0 in the others
  bool marking = false;  ///< a mark is requested; it is taken once the hand is still
};

struct Message {
  enum class Kind { kInfo, kAccepted, kRejected };
  Kind kind = Kind::kInfo;
  std::string text;
};

struct ProcedureResult {
  Calibration calibration;  ///< without device and note
  MotionFit fit;
  std::vector<RecordedStroke> strokes;  ///< all, in order
  std::vector<Rejection> rejections;    ///< per stroke; fit.residuals has the good ones
  double drift_counts_per_s = 0.0;      ///< at rest
  double return_mm = 0.0;               ///< from the first start of a push to the last
  double mean_surface_quality = 0.0;    ///< during strokes
  bool rest_checked = false, joystick_measured = false;
};

/// Releases of the joystick: one after each of its ends.
inline constexpr int kStickReleases = 4;

/// Required number of good raised pushes.
inline constexpr int kRaisedPushes = 3;

/// Time for which a hand or a stick must be still.
inline constexpr std::int64_t kStillUs = 250000;

class Procedure {
 public:
  /// Throws UserError naming a setting that is out of range.
  explicit Procedure(const ProcedureSettings& settings);

  /// Takes the next reading, in order of time.
  void Take(const Reading& reading);
  void Press(Key key);

  Prompt prompt() const;
  /// Returns the messages since the previous call.
  std::vector<Message> TakeMessages();
  Step step() const { return step_; }
  /// Motion since the last mark by nominal gains: mm along the axis, rad around it.
  HandMotion SinceMark() const;

  /// Valid only when step() is kDone. Throws UserError as FitMotion() does.
  ProcedureResult Result() const;

 private:
  enum class Place { kStart, kThere, kBack };
  struct Counts {
    double axial = 0.0;
    double transverse = 0.0;
  };

  bool InStrokes() const { return Pushing() || step_ == Step::kTurns; }
  bool Pushing() const { return step_ == Step::kPushes || step_ == Step::kRaised; }
  MotionKind kind() const {
    return step_ == Step::kPushes   ? MotionKind::kPush
           : step_ == Step::kRaised ? MotionKind::kRaisedPush
                                    : MotionKind::kTurn;
  }
  int Good(MotionKind kind) const;
  void Say(Message::Kind kind, const std::string& text);
  void GoOn();

  void Rest(const Reading& reading);
  void Follow(const Reading& reading);
  std::optional<Counts> StillPlace() const;
  void TakeMark(const Counts& place);
  void EndStroke();
  void Judge();
  void Undo();
  void Joystick(const Reading& reading);
  void EndJoystick();
  StrokeExpectation Expectation() const;
  double NominalGain() const;

  ProcedureSettings settings_;
  Step step_ = Step::kRest;
  std::vector<Message> messages_;
  std::optional<Reading> last_;
  std::deque<Reading> recent_;  // as long as a hand must be still

  std::optional<Reading> rest_from_;
  std::int64_t rest_asked_us_ = -1;
  std::int64_t rest_readings_ = 0;
  double rest_joystick_x_ = 0.0, rest_joystick_y_ = 0.0;  // sums, then means
  double drift_counts_per_s_ = 0.0;
  bool rest_checked_ = false;

  Place place_ = Place::kStart;
  bool marking_ = false;
  Counts mark_;  // the last place that was marked
  RecordedStroke current_;
  std::vector<RecordedStroke> strokes_;
  std::vector<Rejection> rejections_;
  std::optional<Counts> first_start_, last_start_;  // of pushes
  double quality_sum_ = 0.0;
  std::int64_t quality_readings_ = 0;

  std::array<std::vector<double>, 2> stick_at_rest_, stick_moved_;
  int releases_ = 0;
  bool stick_away_ = false;
  std::optional<std::array<JoystickAxis, 2>> axes_;
};

}  // namespace torquer::calibration
