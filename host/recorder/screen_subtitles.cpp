#include "host/recorder/screen_subtitles.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "host/recorder/page_text.h"
#include "host/recorder/svg_text.h"
#include "host/support/angle.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

constexpr std::size_t kLongestName = 30;

std::string Angle(double rad, const char* positive, const char* negative) {
  const long degrees = std::lround(rad * kDegreesPerRad);
  return fmt::format("{} {}°", degrees < 0 ? negative : positive, std::labs(degrees));
}

// A clock does not round up.
std::string Clock(double time_s) {
  const auto tenths = static_cast<std::int64_t>(std::floor(10 * time_s));
  return fmt::format("{}:{:02}.{}", tenths / 600, tenths / 10 % 60, tenths % 10);
}

// Style and text of one screen position.
struct Line {
  const char* style;
  std::string text;
  bool operator==(const Line&) const = default;
};
using Lines = std::array<Line, 5>;

std::string Angles(const ScreenPlane& plane) {
  if (plane.picture < 0) return "";
  return Angle(plane.lao_rad, "LAO", "RAO") + "  " + Angle(plane.cra_rad, "CRA", "CAU");
}

Lines LinesAt(const ScreenCourse& course, std::int64_t time_us) {
  const ScreenMoment moment = course.At(time_us);
  const bool shown = moment.planes[0].picture >= 0;
  std::string dose;
  if (moment.fluoroscopy_s) Append(dose, "\\NX-ray {}", SecondsText(*moment.fluoroscopy_s));
  if (moment.air_kerma_mGy) {
    Append(dose, "\\NAir kerma {} mGy", ValueText(*moment.air_kerma_mGy));
  }
  if (moment.contrast_mL) Append(dose, "\\NContrast {} mL", ValueText(*moment.contrast_mL));
  if (!dose.empty()) dose.erase(0, 2);
  std::string session = EscapeSubtitle(Printable(moment.scene, kLongestName));
  if (!session.empty()) session += "\\N";
  session += Clock(1e-6 * static_cast<double>(time_us));
  Lines lines = {{{"Hold", shown ? "LAST IMAGE HOLD" : ""},
                  {"Arm", Angles(moment.planes[0])},
                  {"Lateral", Angles(moment.planes[1])},
                  {"Session", session},
                  {"Dose", dose}}};
  if (moment.xray) lines[0] = {"Xray", "X-RAY ON"};
  return lines;
}

// Time halfway to the previous frame, so that rounding cannot shift a text by a frame.
std::string EventTime(std::int64_t frame) {
  const std::int64_t hundredths =
      std::max<std::int64_t>(0, (2 * frame - 1) * 100 / (2 * ClipSpan::kFramesPerS));
  return fmt::format("{}:{:02}:{:02}.{:02}", hundredths / 360'000, hundredths / 6000 % 60,
                     hundredths / 100 % 60, hundredths % 100);
}

}  // namespace

std::string EscapeSubtitle(std::string_view text) {
  std::string escaped;
  for (const char character : text) {
    if (character == '{' || character == '}') escaped += '\\';
    escaped += character;
    // A backslash has no escape. An invisible word joiner separates it from the next character.
    if (character == '\\') escaped += "\u2060";
  }
  return escaped;
}

std::string ScreenSubtitles(const ScreenCourse& course, const ClipSpan& span, int width,
                            int height) {
  const int size = std::max(8, height / 26);
  std::string out = fmt::format(
      "[Script Info]\nScriptType: v4.00+\nPlayResX: {}\nPlayResY: {}\nWrapStyle: 2\n"
      "ScaledBorderAndShadow: yes\n\n[V4+ Styles]\n"
      "Format: Name, Fontname, Fontsize, PrimaryColour, OutlineColour, Bold, BorderStyle, Outline, "
      "Shadow, Alignment, MarginL, MarginR, MarginV\n",
      width, height);
  const int plane_width = width / course.planes();
  const auto style = [&](const char* name, const char* color, int alignment, int right = 0) {
    Append(out, "Style: {},DejaVu Sans,{},{},&H00000000,0,1,{:.1f},0,{},{},{},{}\n", name, size,
           color, 0.08 * size, alignment, size / 2, right + size / 2, size / 2);
  };
  style("Xray", "&H0030D0FF", 7);  // blue, green, red: amber
  style("Hold", "&H00FFFFFF", 7);
  style("Arm", "&H00FFFFFF", 9, width - plane_width);
  style("Lateral", "&H00FFFFFF", 9);
  style("Session", "&H00FFFFFF", 1);
  style("Dose", "&H00FFFFFF", 3);
  out += "\n[Events]\nFormat: Layer, Start, End, Style, Text\n";

  Lines standing = LinesAt(course, span.TimeUs(0));
  std::array<std::int64_t, std::tuple_size_v<Lines>> since{};
  for (std::int64_t frame = 1; frame <= span.frames; ++frame) {
    const Lines next = frame < span.frames ? LinesAt(course, span.TimeUs(frame)) : Lines{};
    for (std::size_t k = 0; k < next.size(); ++k) {
      if (next[k] == standing[k] && frame < span.frames) continue;
      if (!standing[k].text.empty()) {
        Append(out, "Dialogue: 0,{},{},{},{}\n", EventTime(since[k]), EventTime(frame),
               standing[k].style, standing[k].text);
      }
      standing[k] = next[k];
      since[k] = frame;
    }
  }
  return out;
}

}  // namespace torquer
