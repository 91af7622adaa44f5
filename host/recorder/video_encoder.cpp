#include "host/recorder/video_encoder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>
#include <utility>
#include <vector>

#include "host/recorder/video_file.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

constexpr char kInstallFfmpeg[] = "install it (host/install_packages build)";
constexpr std::size_t kMostMessageBytes = 4096;
// Descriptors in ffmpeg. The originals lie above them, so that none is overwritten before it is
// copied.
constexpr int kOutputInChild = 3;
constexpr int kSubtitlesInChild = 4;
constexpr int kAboveChild = 10;

[[noreturn]] void Refuse(const char* what, int error) {
  throw UserError(fmt::format("ffmpeg: {}: {}", what, std::strerror(error)));
}

// Copies a descriptor to a number above those that the child uses.
int Copy(int descriptor) {
  const int copy = descriptor < 0 ? -1 : fcntl(descriptor, F_DUPFD_CLOEXEC, kAboveChild);
  if (copy < 0) Refuse("cannot be given its files", errno);
  return copy;
}

class Descriptor {
 public:
  /// Takes ownership of `fd` and moves it above those that the child uses.
  explicit Descriptor(int fd) : fd_(Copy(fd)) { close(fd); }
  ~Descriptor() {
    if (fd_ >= 0) close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return fd_; }
  int Release() { return std::exchange(fd_, -1); }

 private:
  int fd_ = -1;
};

void WriteAll(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(file, text.data(), text.size());
    if (written < 0 && errno != EINTR) Refuse("cannot be given its subtitles", errno);
    if (written > 0) text.remove_prefix(static_cast<std::size_t>(written));
  }
}

std::vector<std::string> Words(const VideoFormat& format) {
  std::vector<std::string> words = {
      "ffmpeg", "-nostdin", "-hide_banner", "-loglevel", "error", "-xerror",
      // Input.
      "-f", "rawvideo", "-pixel_format", "gray", "-video_size",
      fmt::format("{}x{}", format.width, format.height), "-framerate",
      fmt::format("{}", format.frames_per_s), "-i", "pipe:0",
      // Filter and pixel format of the output.
      "-vf", fmt::format("format=yuv420p,ass=/proc/self/fd/{}", kSubtitlesInChild), "-pix_fmt",
      "yuv420p", "-an"};
  const std::vector<std::string> mp4 = {"-c:v", "libx264",   "-preset",    "medium", "-crf",
                                        "20",   "-movflags", "+faststart", "-f",     "mp4"};
  const std::vector<std::string> webm = {"-c:v",    "libvpx-vp9", "-crf", "30",        "-b:v",
                                         "0",       "-deadline",  "good", "-cpu-used", "4",
                                         "-row-mt", "1",          "-f",   "webm"};
  const std::vector<std::string>& kind = format.kind == VideoFormat::Kind::kMp4 ? mp4 : webm;
  words.insert(words.end(), kind.begin(), kind.end());
  // -y (overwrite): the file already exists and is empty.
  words.insert(words.end(), {"-y", fmt::format("/proc/self/fd/{}", kOutputInChild)});
  return words;
}

// End of the last messages, joined into one line.
std::string LastMessages(int file) {
  std::string text(kMostMessageBytes, '\0');
  const off_t size = lseek(file, 0, SEEK_END);
  const ssize_t got = pread(file, text.data(), text.size(),
                            std::max<off_t>(0, size - static_cast<off_t>(text.size())));
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, got)));
  while (!text.empty() && text.back() == '\n') text.pop_back();
  constexpr std::size_t kShown = 200;
  if (text.size() > kShown) text.erase(0, text.size() - kShown);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return Printable(text);
}

}  // namespace

VideoEncoder::VideoEncoder(const VideoFormat& format, const std::string& subtitles, int output)
    : kind_(format.kind), output_(output) {
  int ends[2];
  // A socket, since writing to a pipe whose reader has ended raises a signal.
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    Refuse("cannot be given frames", errno);
  }
  Descriptor frames(ends[0]);
  const Descriptor input(ends[1]);
  Descriptor messages(memfd_create("ffmpeg-messages", MFD_CLOEXEC));
  const Descriptor texts(memfd_create("ffmpeg-subtitles", MFD_CLOEXEC));
  const Descriptor file(Copy(output));
  WriteAll(texts.get(), subtitles);

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&actions, input.get(), STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, messages.get(), STDERR_FILENO);
  posix_spawn_file_actions_adddup2(&actions, file.get(), kOutputInChild);
  posix_spawn_file_actions_adddup2(&actions, texts.get(), kSubtitlesInChild);
  std::vector<std::string> words = Words(format);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int error = posix_spawnp(&process_, argv[0], &actions, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) {
    process_ = -1;
    throw UserError(
        fmt::format("ffmpeg: cannot be started: {}; {}", std::strerror(error), kInstallFfmpeg));
  }
  frames_ = frames.Release();
  messages_ = messages.Release();
}

VideoEncoder::~VideoEncoder() {
  if (frames_ >= 0) close(frames_);
  if (messages_ >= 0) close(messages_);
  if (process_ < 0) return;
  kill(process_, SIGKILL);
  while (waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

bool VideoEncoder::Add(std::span<const std::uint8_t> pixels) {
  while (!pixels.empty()) {
    const ssize_t sent = send(frames_, pixels.data(), pixels.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EINTR) {
      refused_ = true;
      return false;
    }
    if (sent > 0) pixels = pixels.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

void VideoEncoder::Finish() {
  close(std::exchange(frames_, -1));
  int status = 0;
  while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    // The descriptor itself may be write-only, so the file is opened again for reading.
    const std::string name = fmt::format("/proc/self/fd/{}", output_);
    const Descriptor file(open(name.c_str(), O_RDONLY | O_CLOEXEC));
    const bool video = kind_ == VideoFormat::Kind::kMp4 ? IsMp4(file.get()) : IsWebm(file.get());
    if (video && !refused_) return;
    throw UserError(fmt::format("ffmpeg: ended with status 0, but {}; {}",
                                refused_ ? "did not accept all frames" : "wrote no complete video",
                                kInstallFfmpeg));
  }
  const std::string said = LastMessages(messages_);
  throw UserError(
      fmt::format("ffmpeg: ended with {} {}: {}", WIFSIGNALED(status) ? "signal" : "status",
                  WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status),
                  said.empty() ? "it printed no message; check the free space on the disk" : said));
}

}  // namespace torquer
