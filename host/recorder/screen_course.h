// What the fluoroscopy screen showed when, from the log of a session.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/gray_jpeg.h"
#include "host/support/event_log.h"
#include "host/support/log_parts.h"

namespace torquer {

/// What stands on the part of the screen that one plane has.
struct ScreenPlane {
  std::int64_t picture = -1;  ///< which one stands there; -1: none yet
  double lao_rad = 0;         ///< of the picture
  double cra_rad = 0;
};

/// The screen at a moment.
struct ScreenMoment {
  std::array<ScreenPlane, 2> planes;  ///< the second one of a biplane system alone
  bool xray = false;                  ///< the pedal is down
  std::string scene;                  ///< its name, as the log has it
  /// The newest readings; negative: the scene does not publish it.
  double fluoroscopy_s = -1;
  double air_kerma_mGy = -1;
  double contrast_mL = -1;
};

/// An index of a log. Pictures stay in the file.
class ScreenCourse {
 public:
  /// Reads the log at `path` once. Throws UserError naming it when it cannot be read or holds no
  /// picture.
  explicit ScreenCourse(const std::string& path);

  /// From the first record of the log, which is at 0, to the last.
  std::int64_t length_us() const { return length_us_; }
  /// When the first picture came.
  std::int64_t first_picture_us() const { return pictures_[0].front().time_us; }
  /// 2 where the log has pictures from a second side, otherwise 1.
  int planes() const { return pictures_[1].empty() ? 1 : 2; }
  /// The largest of each among the pictures.
  int width() const { return width_; }
  int height() const { return height_; }
  const LogDamage& damage() const { return damage_; }
  /// Messages on channels that matter here which are none, and pictures that are no JPEG.
  std::int64_t unusable() const { return unusable_; }

  /// Of a log that holds no command, X-ray is on while its pictures are new.
  ScreenMoment At(std::int64_t time_us) const;

  /// A picture of a plane by its number in a moment; nothing where its JPEG is damaged. Throws
  /// UserError when the file cannot be read any more.
  std::optional<GrayPicture> ReadPicture(int plane, std::int64_t picture) const;

 private:
  struct Picture {
    std::int64_t time_us = 0;
    std::int64_t place = 0;  // of the message in the file
    std::uint32_t bytes = 0;
    std::int64_t number = 0;
    double taken_s = 0;
    double lao_rad = 0, cra_rad = 0;
  };
  struct Change {
    std::int64_t time_us = 0;
    bool on = false;
  };
  struct Readings {
    std::int64_t time_us = 0;
    double fluoroscopy_s = -1, air_kerma_mGy = -1, contrast_mL = -1;
  };
  struct Scene {
    std::int64_t time_us = 0;
    std::string name, instrument;  // the innermost, whose pedals count
  };

  static void Note(std::vector<Change>& changes, std::int64_t time_us, bool on);
  bool Take(const LogRecord& record, std::int64_t time_us);
  bool TakePicture(const LogRecord& record, std::int64_t time_us, int plane);
  bool TakeCommand(const LogRecord& record, std::int64_t time_us);
  bool TakeReadings(const LogRecord& record, std::int64_t time_us);
  bool TakeScene(const LogRecord& record, std::int64_t time_us);

  LogInput file_;
  std::array<std::vector<Picture>, 2> pictures_;  // of each plane; all of these by time
  std::vector<Change> pedal_;
  std::vector<Change> live_;  // on while pictures are new
  std::vector<Readings> readings_;
  std::vector<Scene> scenes_;
  std::int64_t commanded_us_ = 0;  // when the last command came
  std::int64_t length_us_ = 0;
  int width_ = 0, height_ = 0;
  LogDamage damage_;
  std::int64_t unusable_ = 0;
};

}  // namespace torquer
