#include "calibration/procedure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/support/error.h"

namespace torquer::calibration {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

// A hand is still when it moved less than this for kStillUs.
constexpr double kStillMm = 0.25;

// A sensor at rest gives no counts, except over a shiny or distant surface.
constexpr std::int64_t kRestUs = 1500000;
constexpr double kRestCounts = 6.0;
constexpr std::int64_t kRestPatienceUs = 8000000;

bool NumberWithin(double value, double low, double high) { return value >= low && value <= high; }

void Require(bool good, const char* name, double value, const char* range) {
  if (good) return;
  throw UserError(fmt::format("{} = {:g}: must be {}", name, value, range));
}

}  // namespace

Procedure::Procedure(const ProcedureSettings& settings) : settings_(settings) {
  Require(NumberWithin(settings.length_mm, 10, 1000), "length", settings.length_mm,
          "from 10 to 1000 mm");
  Require(NumberWithin(settings.length_error_mm, 0.001, 0.1 * settings.length_mm), "length error",
          settings.length_error_mm, "from 0.001 mm to a tenth of the length");
  Require(NumberWithin(settings.cylinder_radius_mm, 0.2, 100), "cylinder radius",
          settings.cylinder_radius_mm, "from 0.2 to 100 mm");
  Require(NumberWithin(settings.play_mm, 0, 2), "play", settings.play_mm, "from 0 to 2 mm");
  Require(NumberWithin(settings.pushes, 3, 100), "number of pushes", settings.pushes,
          "from 3 to 100");
  Require(NumberWithin(settings.turn_strokes, 3, 100), "number of strokes of turns",
          settings.turn_strokes, "from 3 to 100");
  Require(NumberWithin(settings.turns, 1, 50), "number of turns a stroke", settings.turns,
          "from 1 to 50");
}

double Procedure::NominalGain() const { return kMmPerInch / settings_.cpi; }

StrokeExpectation Procedure::Expectation() const {
  StrokeExpectation expected;
  expected.push_mm = settings_.length_mm;
  expected.turn_rad = kTurn * settings_.turns;
  expected.push_error_mm = settings_.ruler ? settings_.length_error_mm : settings_.stop_play_mm;
  expected.push_turn_error_rad = settings_.push_turn_rad;
  expected.turn_error_rad = settings_.mark_rad;
  expected.turn_push_error_mm = settings_.turn_push_mm;
  expected.gain_mm_per_count = NominalGain();
  expected.gain_factor = settings_.cpi_known ? 1.3 : 4.0;
  expected.cylinder_radius_mm = settings_.cylinder_radius_mm;
  return expected;
}

int Procedure::Good(MotionKind kind) const {
  int good = 0;
  for (std::size_t i = 0; i < strokes_.size(); ++i) {
    good += strokes_[i].stroke.kind == kind && !rejections_[i];
  }
  return good;
}

void Procedure::Say(Message::Kind kind, const std::string& text) {
  messages_.push_back({kind, text});
}

std::vector<Message> Procedure::TakeMessages() {
  std::vector<Message> taken;
  taken.swap(messages_);
  return taken;
}

void Procedure::GoOn() {
  const auto next = [this](Step step) {
    step_ = step;
    place_ = Place::kStart;
    marking_ = false;
    current_ = {};
  };
  switch (step_) {
    case Step::kRest:
      return next(Step::kPushes);
    case Step::kPushes:
      return next(Step::kRaised);
    case Step::kRaised:
      return next(Step::kTurns);
    case Step::kTurns:
      return next(settings_.has_joystick ? Step::kJoystick : Step::kDone);
    case Step::kJoystick:
    case Step::kDone:
      return next(Step::kDone);
  }
}

void Procedure::Take(const Reading& reading) {
  const bool pressed = reading.button && !(last_ && last_->button);
  if (reading.interrupted) recent_.clear();
  recent_.push_back(reading);
  // Keeps the readings of the time for which a hand must rest.
  while (recent_.size() > 1 && reading.time_us - recent_[1].time_us >= kStillUs) {
    recent_.pop_front();
  }
  last_ = reading;
  if (pressed) Press(Key::kMark);
  switch (step_) {
    case Step::kRest:
      return Rest(reading);
    case Step::kPushes:
    case Step::kRaised:
    case Step::kTurns:
      return Follow(reading);
    case Step::kJoystick:
      return Joystick(reading);
    case Step::kDone:
      return;
  }
}

void Procedure::Press(Key key) {
  if (key == Key::kMark) {
    if (InStrokes()) marking_ = true;
    if (step_ == Step::kJoystick) EndJoystick();
    return;
  }
  if (key == Key::kUndo) {
    if (InStrokes()) Undo();
    return;
  }
  switch (step_) {
    case Step::kRest:
      Say(Message::Kind::kInfo, "rest was not checked: the sensor may drift");
      return GoOn();
    case Step::kRaised:
      Say(Message::Kind::kInfo,
          fmt::format("the height was not measured: its play of {:g} mm counts as an error of up "
                      "to {:.1f} %",
                      settings_.play_mm, 100 * kLargestHeightGain_per_mm * settings_.play_mm));
      std::erase_if(strokes_, [](const RecordedStroke& recorded) {
        return recorded.stroke.kind == MotionKind::kRaisedPush;
      });
      rejections_ = JudgeStrokes(strokes_, Expectation());
      return GoOn();
    case Step::kJoystick:
      Say(Message::Kind::kInfo, "the joystick keeps its nominal center and ends");
      return GoOn();
    case Step::kPushes:
    case Step::kTurns:
      return Say(Message::Kind::kInfo, "there is no calibration without pushes and turns");
    case Step::kDone:
      return;
  }
}

// --- rest ----------------------------------------------------------------------------------------

void Procedure::Rest(const Reading& reading) {
  if (rest_asked_us_ < 0 || reading.interrupted) rest_asked_us_ = reading.time_us;
  const auto begin = [&] {
    rest_from_ = reading;
    rest_readings_ = 0;
    rest_joystick_x_ = rest_joystick_y_ = 0.0;
  };
  if (!rest_from_ || reading.interrupted || reading.lifted || reading.faulty) begin();
  const auto moved = [](std::int64_t to, std::int64_t from) {
    return std::abs(static_cast<double>(to - from));
  };
  const double counts = std::max(moved(reading.axial_counts, rest_from_->axial_counts),
                                 moved(reading.transverse_counts, rest_from_->transverse_counts));
  if (counts > kRestCounts) begin();
  ++rest_readings_;
  rest_joystick_x_ += reading.joystick_x;
  rest_joystick_y_ += reading.joystick_y;
  const std::int64_t rested_us = reading.time_us - rest_from_->time_us;
  if (rested_us >= kRestUs) {
    rest_joystick_x_ /= static_cast<double>(rest_readings_);
    rest_joystick_y_ /= static_cast<double>(rest_readings_);
    drift_counts_per_s_ = counts / (1e-6 * static_cast<double>(rested_us));
    rest_checked_ = true;
    Say(Message::Kind::kAccepted,
        fmt::format("at rest it drifts by {:.1f} counts a second, surface quality {}",
                    drift_counts_per_s_, reading.surface_quality));
    return GoOn();
  }
  if (reading.time_us - rest_asked_us_ < kRestPatienceUs) return;
  rest_asked_us_ = reading.time_us;
  if (reading.faulty) {
    Say(Message::Kind::kRejected, "the sensor does not answer; check its wires and supply");
  } else if (reading.lifted) {
    Say(Message::Kind::kRejected,
        fmt::format("the sensor sees no surface (quality {}); set its distance, and see that the "
                    "cylinder is under its window",
                    reading.surface_quality));
  } else {
    Say(Message::Kind::kRejected,
        "the count changes at rest; keep your hands off; if it still changes, look for a shiny "
        "cylinder, a wrong distance or light from the side");
  }
}

// --- strokes -------------------------------------------------------------------------------------

void Procedure::Follow(const Reading& reading) {
  if (reading.interrupted && place_ != Place::kStart) {
    current_.interrupted = true;
    EndStroke();
    place_ = Place::kStart;
    marking_ = false;
    return;
  }
  if (place_ != Place::kStart) {
    current_.lifted |= reading.lifted;
    current_.faulty |= reading.faulty;
    quality_sum_ += reading.surface_quality;
    ++quality_readings_;
  }
  if (!marking_) return;
  if (const std::optional<Counts> place = StillPlace()) {
    marking_ = false;
    TakeMark(*place);
  }
}

// Mean position of the hand while it was still; empty until it was still for long enough.
std::optional<Procedure::Counts> Procedure::StillPlace() const {
  if (recent_.back().time_us - recent_.front().time_us < kStillUs) return std::nullopt;
  const Reading& origin = recent_.front();
  Counts low, high, sum;
  for (const Reading& reading : recent_) {
    const auto axial = static_cast<double>(reading.axial_counts - origin.axial_counts);
    const auto transverse =
        static_cast<double>(reading.transverse_counts - origin.transverse_counts);
    low = {std::min(low.axial, axial), std::min(low.transverse, transverse)};
    high = {std::max(high.axial, axial), std::max(high.transverse, transverse)};
    sum = {sum.axial + axial, sum.transverse + transverse};
  }
  const double still = std::max(2.0, kStillMm / NominalGain());
  if (high.axial - low.axial > still || high.transverse - low.transverse > still) {
    return std::nullopt;
  }
  const auto count = static_cast<double>(recent_.size());
  return Counts{static_cast<double>(origin.axial_counts) + sum.axial / count,
                static_cast<double>(origin.transverse_counts) + sum.transverse / count};
}

void Procedure::TakeMark(const Counts& place) {
  const Counts way{place.axial - mark_.axial, place.transverse - mark_.transverse};
  mark_ = place;
  if (step_ == Step::kPushes && place_ != Place::kThere) {
    if (!first_start_) first_start_ = place;
    last_start_ = place;
  }
  switch (place_) {
    case Place::kStart:
      place_ = Place::kThere;
      break;
    case Place::kThere:
      current_.stroke.axial_counts = way.axial;
      current_.stroke.transverse_counts = way.transverse;
      place_ = Place::kBack;
      return;
    case Place::kBack:
      current_.back_axial_counts = way.axial;
      current_.back_transverse_counts = way.transverse;
      place_ = Place::kThere;
      EndStroke();
      break;
  }
}

void Procedure::EndStroke() {
  const StrokeExpectation expected = Expectation();
  const bool push = Pushing();
  current_.stroke.kind = kind();
  current_.stroke.reference = push ? expected.push_mm : expected.turn_rad;
  current_.stroke.reference_error = push ? expected.push_error_mm : expected.turn_error_rad;
  if (current_.interrupted && push) first_start_.reset();
  strokes_.push_back(current_);
  current_ = {};
  Judge();
  const int wanted = step_ == Step::kPushes   ? settings_.pushes
                     : step_ == Step::kRaised ? kRaisedPushes
                                              : settings_.turn_strokes;
  if (Good(kind()) >= wanted) GoOn();
}

// Judges all strokes again. Reports the result for the last stroke, and changes for the others.
void Procedure::Judge() {
  const std::vector<Rejection> before = rejections_;
  rejections_ = JudgeStrokes(strokes_, Expectation());
  constexpr std::array<const char*, 3> kNames{"push", "turns", "raised push"};
  std::array<int, 3> number{};
  for (std::size_t i = 0; i < strokes_.size(); ++i) {
    const auto kind = static_cast<std::size_t>(strokes_[i].stroke.kind);
    const std::string name = fmt::format("{} {}", kNames[kind], ++number[kind]);
    const bool is_new = i >= before.size();
    if (is_new && !rejections_[i]) {
      Say(Message::Kind::kAccepted, name + fmt::format(": {:+.0f} axial, {:+.0f} transverse counts",
                                                       strokes_[i].stroke.axial_counts,
                                                       strokes_[i].stroke.transverse_counts));
    } else if (rejections_[i] && (is_new || !before[i])) {
      Say(Message::Kind::kRejected,
          name + (is_new ? " is not used: " : " is no longer used: ") + *rejections_[i]);
    } else if (!is_new && before[i] && !rejections_[i]) {
      Say(Message::Kind::kAccepted, name + " is used again");
    }
  }
}

void Procedure::Undo() {
  if (strokes_.empty() || strokes_.back().stroke.kind != kind()) {
    return Say(Message::Kind::kInfo, "there is no stroke to undo");
  }
  strokes_.pop_back();
  rejections_.pop_back();
  Judge();
  place_ = Place::kStart;
  marking_ = false;
  current_ = {};
  Say(Message::Kind::kInfo, "the last stroke is undone");
}

HandMotion Procedure::SinceMark() const {
  if (!last_) return {};
  const double gain = NominalGain();
  return {(static_cast<double>(last_->axial_counts) - mark_.axial) * gain,
          (static_cast<double>(last_->transverse_counts) - mark_.transverse) * gain /
              settings_.cylinder_radius_mm};
}

// --- the result ----------------------------------------------------------------------------------

ProcedureResult Procedure::Result() const {
  ProcedureResult result;
  std::vector<Stroke> good;
  for (std::size_t i = 0; i < strokes_.size(); ++i) {
    if (!rejections_[i]) good.push_back(strokes_[i].stroke);
  }
  CommonErrors common;
  common.push_mm = settings_.ruler ? settings_.ruler_scale_mm : settings_.length_error_mm;
  common.push_turn_rad = settings_.push_turn_habit_rad;
  common.turn_push_mm = settings_.turn_push_habit_mm;
  common.height_gain = kLargestHeightGain_per_mm * settings_.play_mm;
  result.fit = FitMotion(good, common, settings_.cpi);
  result.calibration.motion = result.fit.model;
  if (axes_) {
    result.calibration.lao = (*axes_)[0];
    result.calibration.cra = (*axes_)[1];
  }
  result.strokes = strokes_;
  result.rejections = rejections_;
  result.drift_counts_per_s = drift_counts_per_s_;
  if (first_start_ && last_start_) {
    result.return_mm = (last_start_->axial - first_start_->axial) * NominalGain();
  }
  if (quality_readings_ > 0) {
    result.mean_surface_quality = quality_sum_ / static_cast<double>(quality_readings_);
  }
  result.rest_checked = rest_checked_;
  result.joystick_measured = axes_.has_value();
  return result;
}

}  // namespace torquer::calibration
