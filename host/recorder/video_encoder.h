// Video encoder: runs Debian's ffmpeg.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>

namespace torquer {

struct VideoFormat {
  enum class Kind { kMp4, kWebm };  ///< H.264 and VP9, both yuv420p

  Kind kind = Kind::kMp4;
  int width = 0;  ///< even, as height
  int height = 0;
  int frames_per_s = 0;
};

/// Child process that takes gray frames, draws subtitles on them, and writes a file. No shell and
/// no path in a folder is involved: frames, subtitles and file are descriptors.
class VideoEncoder {
 public:
  /// `subtitles` is a file of Advanced SubStation Alpha; `output` a descriptor of an empty file,
  /// which must stay open.
  /// Throws UserError when ffmpeg cannot be started.
  VideoEncoder(const VideoFormat& format, const std::string& subtitles, int output);
  /// Kills ffmpeg if it still runs.
  ~VideoEncoder();
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  /// Adds a frame of width x height pixels. Returns false once ffmpeg accepts no more; Finish()
  /// then reports why.
  bool Add(std::span<const std::uint8_t> pixels);

  /// Waits until the file is complete. Throws UserError with ffmpeg's messages if encoding failed.
  /// It also throws if ffmpeg exited with status 0 but did not take all frames or wrote no video.
  void Finish();

 private:
  VideoFormat::Kind kind_;
  int output_ = -1;
  bool refused_ = false;  // ffmpeg accepts no more frames
  int frames_ = -1;       // socket to its standard input
  int messages_ = -1;     // file without a name that holds its standard error
  pid_t process_ = -1;
};

}  // namespace torquer
