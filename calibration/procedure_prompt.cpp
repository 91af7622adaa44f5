// Prompts of the guided calibration for the operator, step by step.
#include <fmt/format.h>

#include <string>

#include "calibration/procedure.h"

namespace torquer::calibration {

Prompt Procedure::prompt() const {
  Prompt prompt;
  prompt.step = step_;
  prompt.marking = marking_;
  const double length = settings_.length_mm;
  const auto at = [this](const std::string& start, const std::string& there,
                         const std::string& back) {
    return place_ == Place::kStart ? start : place_ == Place::kThere ? there : back;
  };
  switch (step_) {
    case Step::kRest:
      prompt.title = "Rest";
      prompt.instruction = "Hands off the torquer and the joystick";
      break;
    case Step::kPushes:
      prompt.title = "Pushes";
      prompt.done = Good(MotionKind::kPush);
      prompt.wanted = settings_.pushes;
      prompt.instruction =
          settings_.ruler
              ? at("Set it to 0 mm on the ruler, then press Enter",
                   fmt::format("Push straight to {:.1f} mm on the ruler, then press Enter", length),
                   "Pull straight back to 0 mm, then press Enter")
              : at("Pull it back to the near stop, then press Enter",
                   fmt::format("Push it straight to the far stop, {:.1f} mm, then press Enter",
                               length),
                   "Pull it straight back to the near stop, then press Enter");
      break;
    case Step::kRaised: {
      prompt.title = "Raised pushes";
      prompt.done = Good(MotionKind::kRaisedPush);
      prompt.wanted = kRaisedPushes;
      const std::string stop = settings_.ruler ? "0 mm on the ruler" : "the near stop";
      prompt.instruction =
          at("Press the wire upward, keep it so, pull it to " + stop + ", then press Enter",
             fmt::format("Still pressing upward, push it by {:.1f} mm as before, then press Enter",
                         length),
             "Still pressing upward, pull it back to " + stop + ", then press Enter");
      break;
    }
    case Step::kTurns:
      prompt.title = "Turns";
      prompt.done = Good(MotionKind::kTurn);
      prompt.wanted = settings_.turn_strokes;
      prompt.instruction =
          at("Set the line on the torquer to a mark beside it, then press Enter",
             fmt::format("Turn it clockwise by {} whole turns, line to mark, then press Enter",
                         settings_.turns),
             fmt::format("Turn it back by {} whole turns, line to mark, then press Enter",
                         settings_.turns));
      break;
    case Step::kJoystick:
      prompt.title = "Joystick";
      prompt.done = releases_;
      prompt.wanted = kStickReleases;
      prompt.instruction = "Push the stick right, left, away, near, to the end; let go after each";
      break;
    case Step::kDone:
      prompt.title = "Done";
      break;
  }
  return prompt;
}

}  // namespace torquer::calibration
