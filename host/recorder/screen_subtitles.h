// What stands on the fluoroscopy screen besides the picture, as subtitles for ffmpeg.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "host/recorder/screen_course.h"

namespace torquer {

/// The frames of a clip: `frames` of them, the first at `from_us` of the session.
struct ClipSpan {
  static constexpr int kFramesPerS = 30;

  std::int64_t from_us = 0;
  std::int64_t frames = 0;

  std::int64_t TimeUs(std::int64_t frame) const {
    return from_us + frame * 1'000'000 / kFramesPerS;
  }
};

/// Text of any origin, so that Advanced SubStation Alpha shows it and nothing else happens.
std::string EscapeSubtitle(std::string_view text);

/// The file of subtitles (Advanced SubStation Alpha) for a clip of `width` x `height` pixels. X-ray
/// or last image hold stands at the top left, scene and time of the session at the bottom left,
/// dose and contrast at the bottom right, the angles of each C-arm at the top right of its plane.
std::string ScreenSubtitles(const ScreenCourse& course, const ClipSpan& span, int width,
                            int height);

}  // namespace torquer
