// Subtitles for ffmpeg: the texts on the fluoroscopy screen besides the picture.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "host/recorder/screen_course.h"

namespace torquer {

/// Frames of a clip: `frames` is their number, `from_us` the time of the first in the session.
struct ClipSpan {
  static constexpr int kFramesPerS = 30;

  std::int64_t from_us = 0;
  std::int64_t frames = 0;

  std::int64_t TimeUs(std::int64_t frame) const {
    return from_us + frame * 1'000'000 / kFramesPerS;
  }
};

/// Escapes untrusted text, so that Advanced SubStation Alpha shows it without interpreting it.
std::string EscapeSubtitle(std::string_view text);

/// Subtitle file (Advanced SubStation Alpha) for a clip of `width` x `height` pixels. X-ray or last
/// image hold is at the top left, scene and session time at the bottom left. Dose and contrast are
/// at the bottom right. The angles of each C-arm are at the top right of its plane.
std::string ScreenSubtitles(const ScreenCourse& course, const ClipSpan& span, int width,
                            int height);

}  // namespace torquer
