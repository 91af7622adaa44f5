// Time course of the fluoroscopy screen, from the log of a session.
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

/// Picture that one plane of the screen shows.
struct ScreenPlane {
  std::int64_t picture = -1;  ///< its number; -1: none yet
  double lao_rad = 0;         ///< C-arm angle of the picture
  double cra_rad = 0;
};

/// State of the screen at one time.
struct ScreenMoment {
  std::array<ScreenPlane, 2> planes;  ///< the second is used by a biplane system only
  bool xray = false;                  ///< the pedal is down
  std::string scene;                  ///< name of the scene in the log
  /// Newest readings; nullopt if they are unknown, or if the scene does not publish them.
  std::optional<double> fluoroscopy_s;
  std::optional<double> air_kerma_mGy;  ///< over all planes
  std::optional<double> contrast_mL;
};

/// Index of a log. The pictures stay in the file.
class ScreenCourse {
 public:
  /// Reads the log at `path` once. Throws UserError with the path if it cannot be read or has no
  /// picture.
  explicit ScreenCourse(const std::string& path);

  /// Time from the first record of the log, which is time 0, to the last.
  std::int64_t length_us() const { return length_us_; }
  /// Time of the first picture.
  std::int64_t first_picture_us() const { return pictures_[0].front().time_us; }
  /// Number of planes: 2 if the log has lateral pictures, otherwise 1.
  int planes() const { return pictures_[1].empty() ? 1 : 2; }
  /// Largest width and largest height among the pictures.
  int width() const { return width_; }
  int height() const { return height_; }
  const LogDamage& damage() const { return damage_; }
  /// Count of undecodable messages on the channels used here, and of pictures with an unusable JPEG
  /// header.
  std::int64_t unusable() const { return unusable_; }

  /// Returns the screen at `time_us`. If the log has no command, X-ray counts as on while pictures
  /// are live (not held).
  ScreenMoment At(std::int64_t time_us) const;

  /// Reads picture number `picture` of a plane (ScreenPlane::picture); nullopt if its JPEG is
  /// damaged. Throws UserError if the file was changed since it was indexed.
  std::optional<GrayPicture> ReadPicture(int plane, std::int64_t picture) const;

 private:
  struct Picture {
    std::int64_t time_us = 0;
    std::int64_t place = 0;  // offset of the message in the file, bytes
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
    std::optional<double> fluoroscopy_s, air_kerma_mGy, contrast_mL;
  };
  struct Scene {
    std::int64_t time_us = 0;
    std::string name, instrument;  // `instrument`: the innermost, which has the pedals
  };

  static void Note(std::vector<Change>& changes, std::int64_t time_us, bool on);
  bool Take(const LogRecord& record, std::int64_t time_us);
  bool TakePicture(const LogRecord& record, std::int64_t time_us, int plane);
  bool TakeCommand(const LogRecord& record, std::int64_t time_us);
  bool TakeReadings(const LogRecord& record, std::int64_t time_us);
  bool TakeScene(const LogRecord& record, std::int64_t time_us);

  LogInput file_;
  std::array<std::vector<Picture>, 2> pictures_;  // by plane; all these lists are by time
  std::vector<Change> pedal_;
  std::vector<Change> live_;  // X-ray on, derived from pictures that are not held
  std::vector<Readings> readings_;
  std::vector<Scene> scenes_;
  std::int64_t commanded_us_ = 0;  // time of the last command
  std::int64_t length_us_ = 0;
  int width_ = 0, height_ = 0;
  LogDamage damage_;
  std::int64_t unusable_ = 0;
};

}  // namespace torquer
