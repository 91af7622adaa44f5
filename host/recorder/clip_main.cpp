// torquer-clip: a part of a session's fluoroscopy as a video.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "host/recorder/page_text.h"
#include "host/recorder/screen_course.h"
#include "host/recorder/screen_subtitles.h"
#include "host/recorder/video_encoder.h"
#include "host/support/atomic_file.h"
#include "host/support/error_output.h"
#include "host/support/program.h"

namespace {

using torquer::UsageError;
using torquer::UserError;

constexpr double kLongestS = 1e6;

struct Arguments {
  std::string log;
  std::string out;
  std::optional<double> from_s;
  std::optional<double> to_s;
};

torquer::VideoFormat::Kind KindOf(const std::string& path) {
  if (path.ends_with(".mp4")) return torquer::VideoFormat::Kind::kMp4;
  if (path.ends_with(".webm")) return torquer::VideoFormat::Kind::kWebm;
  throw UsageError(path + ": name a file that ends in .mp4 or .webm");
}

torquer::ClipSpan SpanOf(const Arguments& arguments, const torquer::ScreenCourse& course) {
  const auto us = [](double time_s) -> std::int64_t { return std::llround(1e6 * time_s); };
  torquer::ClipSpan span;
  span.from_us = arguments.from_s ? us(*arguments.from_s) : course.first_picture_us();
  const std::int64_t to_us =
      std::min(arguments.to_s ? us(*arguments.to_s) : course.length_us(), course.length_us());
  // A frame shows the screen at its start time, so the last frame starts before the end.
  const std::int64_t length_us = to_us - span.from_us;
  span.frames = (length_us * torquer::ClipSpan::kFramesPerS + 999'999) / 1'000'000;
  if (length_us <= 0 || course.At(span.TimeUs(span.frames - 1)).planes[0].picture < 0) {
    throw UserError(fmt::format(
        "{}: has no picture in the chosen time; its pictures are from {:.2f} s to {:.2f} s",
        arguments.log, 1e-6 * static_cast<double>(course.first_picture_us()),
        1e-6 * static_cast<double>(course.length_us())));
  }
  return span;
}

// Result of AddFrames: numbers of shown and of damaged pictures. The previous picture stays in
// place of a damaged one. Pictures of a second plane are to the right of the first plane.
struct Shown {
  std::int64_t pictures = 0;
  std::int64_t damaged = 0;
};

void Show(const torquer::GrayPicture& picture, int left, torquer::GrayPicture& frame) {
  for (int y = 0; y < picture.height; ++y) {
    std::copy_n(picture.pixels.begin() + std::ptrdiff_t{y} * picture.width, picture.width,
                frame.pixels.begin() + std::ptrdiff_t{y} * frame.width + left);
  }
}

Shown AddFrames(const torquer::ScreenCourse& course, const torquer::ClipSpan& span,
                const torquer::VideoFormat& format, torquer::VideoEncoder& encoder) {
  Shown shown;
  torquer::GrayPicture frame = torquer::FitInto({1, 1, {0}}, format.width, format.height);
  const int width = format.width / course.planes();
  std::array<std::int64_t, 2> standing = {-1, -1};
  for (std::int64_t k = 0; k < span.frames; ++k) {
    const torquer::ScreenMoment moment = course.At(span.TimeUs(k));
    for (int plane = 0; plane < course.planes(); ++plane) {
      const auto at = static_cast<std::size_t>(plane);
      const std::int64_t picture = moment.planes[at].picture;
      if (picture == standing[at]) continue;
      standing[at] = picture;
      const std::optional<torquer::GrayPicture> read = course.ReadPicture(plane, picture);
      if (read) Show(torquer::FitInto(*read, width, format.height), plane * width, frame);
      ++(read ? shown.pictures : shown.damaged);
    }
    if (!encoder.Add(frame.pixels)) break;
  }
  return shown;
}

int Run(const Arguments& arguments) {
  if (arguments.log.empty()) throw UsageError("LOG is missing; name the log of a session");
  if (arguments.out.empty()) throw UsageError("OUT is missing; name the video file to write");
  if (arguments.from_s && arguments.to_s && *arguments.to_s <= *arguments.from_s) {
    throw UsageError("--to is not later than --from; give a later --to");
  }
  torquer::VideoFormat format{.kind = KindOf(arguments.out),
                              .frames_per_s = torquer::ClipSpan::kFramesPerS};
  // Open the output first: an unwritable path fails before a long log is read.
  torquer::AtomicFile out(arguments.out);
  const torquer::ScreenCourse course(arguments.log);
  const torquer::ClipSpan span = SpanOf(arguments, course);
  // Width and height must be even: yuv420p has one color sample for two by two pixels.
  format.width = (course.width() + 1) / 2 * 2 * course.planes();
  format.height = (course.height() + 1) / 2 * 2;
  torquer::VideoEncoder encoder(format,
                                torquer::ScreenSubtitles(course, span, format.width, format.height),
                                out.descriptor());
  const Shown shown = AddFrames(course, span, format, encoder);
  encoder.Finish();
  if (shown.pictures == 0) {
    throw UserError(arguments.log +
                    ": no picture in the chosen time is complete; choose another --from and --to");
  }
  out.Finish();
  fmt::print("{} pictures in {} frames, {} s, {} x {} in {}\n", shown.pictures, span.frames,
             torquer::ValueText(static_cast<double>(span.frames) / format.frames_per_s),
             format.width, format.height, arguments.out);
  const std::int64_t unusable = course.unusable() + shown.damaged;
  if (unusable > 0) {
    torquer::PrintError("torquer-clip: {}: {} messages or pictures are damaged and left out\n",
                        arguments.log, unusable);
  }
  if (course.damage().any()) {
    torquer::PrintError("torquer-clip: {}: {}\n", arguments.log, course.damage().Describe());
  }
  return unusable > 0 || course.damage().any() ? torquer::kExitFailure : torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-clip",
      "Makes a video of the fluoroscopy screen from the log of a session. Each picture lasts as "
      "long as in the session. Both planes of a biplane system are side by side. The video also "
      "shows X-ray or last image hold, C-arm angles, time, dose and contrast. It needs ffmpeg.");
  program.Note(
      "Exit status: 0 when the video is complete; 1 when the log was damaged; 2 when no video was "
      "made.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.log, "log of the session, written by torquer-recorder");
  options.Operand("OUT", arguments.out, "video file to write: FILE.mp4 (H.264) or FILE.webm (VP9)");
  options.Number("--from", "S", arguments.from_s, 0, kLongestS,
                 "start time of the video, after the first message of the log; without it the "
                 "video starts with the first picture");
  options.Number("--to", "S", arguments.to_s, 0, kLongestS,
                 "end time of the video, after the first message of the log; without it the video "
                 "ends with the log");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
