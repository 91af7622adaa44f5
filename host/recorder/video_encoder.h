// A video made by Debian's ffmpeg.
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

/// A child process that takes gray frames, draws subtitles on them, and writes a file. Nothing of
/// it goes through a shell or by a name in a folder: frames, subtitles and file are descriptors.
class VideoEncoder {
 public:
  /// `subtitles` is a file of Advanced SubStation Alpha; `output` a descriptor of an empty file,
  /// which must stay open.
  /// Throws UserError when ffmpeg cannot be started.
  VideoEncoder(const VideoFormat& format, const std::string& subtitles, int output);
  /// Kills it where it still runs.
  ~VideoEncoder();
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;

  /// A frame of width x height pixels. False once ffmpeg takes no more; Finish() then says why.
  bool Add(std::span<const std::uint8_t> pixels);

  /// Waits until the file is whole. Throws UserError with what ffmpeg said where it is not, also
  /// where ffmpeg ended well but took not all frames or wrote no video.
  void Finish();

 private:
  VideoFormat::Kind kind_;
  int output_ = -1;
  bool refused_ = false;  // it took no more
  int frames_ = -1;       // socket to its standard input
  int messages_ = -1;     // file without a name that holds its standard error
  pid_t process_ = -1;
};

}  // namespace torquer
