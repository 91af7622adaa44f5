#include "host/daemon/device_monitor.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer::daemon {
namespace {

constexpr double kDegreesPerRad = 57.29577951308232;
// Full deflection of the bars.
constexpr double kFullSpeedMmPerS = 200.0;
constexpr double kFullSpeedRadPerS = 12.566370614359172;
constexpr double kFullQuality = 160.0;
constexpr std::size_t kTextColumns = 34;  // width of the text before a bar plus the bar's brackets
constexpr std::size_t kMostColumns = 100;
constexpr std::size_t kFewestBarColumns = 11;

// A bar that grows to both sides of its middle: [    ####|         ].
std::string Balance(double fraction, std::size_t columns) {
  const std::size_t half = columns / 2;
  const auto length = static_cast<std::size_t>(
      std::lround(std::clamp(std::abs(fraction), 0.0, 1.0) * static_cast<double>(half)));
  std::string bar(2 * half + 1, ' ');
  bar[half] = '|';
  for (std::size_t i = 1; i <= length; ++i) bar[fraction < 0 ? half - i : half + i] = '#';
  return "[" + bar + "]";
}

std::string Bar(double fraction, std::size_t columns) {
  const auto length = static_cast<std::size_t>(
      std::lround(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(columns)));
  return "[" + std::string(length, '#') + std::string(columns - length, ' ') + "]";
}

// Words for the pressed buttons and the active faults; "-" if there are none.
std::string Remarks(const PipelineOutput& output) {
  const std::pair<bool, const char*> remarks[] = {
      {(output.sample.buttons & protocol::kButtonXray) != 0, "X-ray"},
      {(output.sample.buttons & protocol::kButtonContrast) != 0, "contrast"},
      {(output.sample.buttons & protocol::kButtonClutch) != 0, "clutch"},
      {(output.hand.flags & protocol::kCommandStickTable) != 0, "stick moves the table"},
      {(output.hand.flags & protocol::kCommandStickHeight) != 0,
       "stick moves the table up and down"},
      {(output.hand.flags & protocol::kCommandSensorFault) != 0, "SENSOR FAULT"},
      {(output.hand.flags & protocol::kCommandLift) != 0, "LIFTED OR POOR SURFACE"},
      {(output.hand.flags & protocol::kCommandUncalibrated) != 0, "uncalibrated"},
  };
  std::string words;
  for (const auto& [holds, word] : remarks) {
    if (holds) words += (words.empty() ? "" : ", ") + std::string(word);
  }
  return words.empty() ? "-" : words;
}

}  // namespace

void DeviceBars::Add(const std::string& device, const PipelineOutput& output) {
  device_ = device;
  if (newest_ && output.sample.epoch_start == device::EpochStart::kNone) {
    missing_ += output.sample.report_number - newest_->sample.report_number - 1;
  }
  ++reports_;
  newest_ = output;
}

DeviceBars::Rates DeviceBars::Since(double seconds) {
  Rates rates{static_cast<double>(std::exchange(reports_, 0)) / seconds, 0, 0};
  if (shown_) {
    const double passed_s = 1e-6 * static_cast<double>(newest_->origin_us - shown_->origin_us);
    if (passed_s > 0) {
      rates.mm_per_s =
          (newest_->hand.pose.insertion_mm - shown_->hand.pose.insertion_mm) / passed_s;
      rates.rad_per_s =
          (newest_->hand.pose.rotation_rad - shown_->hand.pose.rotation_rad) / passed_s;
    }
  }
  shown_ = newest_;
  return rates;
}

std::vector<std::string> DeviceBars::Lines(double seconds, std::size_t width) {
  if (!newest_) return {"no report yet"};
  const Rates rates = Since(seconds);
  const device::Sample& sample = newest_->sample;
  const Pose& pose = newest_->hand.pose;
  const std::size_t columns =
      std::clamp<std::size_t>(width, kTextColumns + kFewestBarColumns, kMostColumns) - kTextColumns;
  const auto joystick = [&](int value) { return (value - 512) / 512.0; };
  std::vector<std::string> lines{
      fmt::format("{}  boot {}  {:.0f} reports/s, {} missing", device_, sample.boot_id,
                  rates.reports_per_s, missing_),
      fmt::format("insertion {:9.2f} mm         ", pose.insertion_mm) +
          Balance(rates.mm_per_s / kFullSpeedMmPerS, columns),
      fmt::format("rotation  {:9.1f} deg        ", pose.rotation_rad * kDegreesPerRad) +
          Balance(rates.rad_per_s / kFullSpeedRadPerS, columns),
      fmt::format("joystick x {:4}  LAO {:5.1f}  ", sample.joystick_x,
                  pose.lao_rad * kDegreesPerRad) +
          Balance(joystick(sample.joystick_x), columns),
      fmt::format("joystick y {:4}  CRA {:5.1f}  ", sample.joystick_y,
                  pose.cra_rad * kDegreesPerRad) +
          Balance(joystick(sample.joystick_y), columns),
      fmt::format("surface    {:4}  shutter {:4} ", sample.surface_quality, sample.shutter) +
          Bar(sample.surface_quality / kFullQuality, columns),
      fmt::format("counts {} axial, {} transverse at {} cpi", sample.axial_counts,
                  sample.transverse_counts, sample.cpi),
      "now: " + Remarks(*newest_)};
  for (std::string& line : lines) line.resize(std::min(line.size(), width));
  return lines;
}

std::string DeviceBars::Line(double seconds) {
  if (!newest_) return "no report yet";
  const Rates rates = Since(seconds);
  return fmt::format(
             "{}: {:.0f} reports/s, {} missing, {:.2f} mm, {:.1f} deg, joystick {} {}, surface "
             "{}: ",
             device_, rates.reports_per_s, missing_, newest_->hand.pose.insertion_mm,
             newest_->hand.pose.rotation_rad * kDegreesPerRad, newest_->sample.joystick_x,
             newest_->sample.joystick_y, newest_->sample.surface_quality) +
         Remarks(*newest_);
}

DeviceMonitor::DeviceMonitor()
    : terminal_(isatty(STDOUT_FILENO) != 0), thread_([this] { Run(); }) {}

DeviceMonitor::~DeviceMonitor() {
  stop_ = true;
  thread_.join();
}

void DeviceMonitor::Add(const std::string& device, const PipelineOutput& output) {
  const std::lock_guard lock(mutex_);
  bars_.Add(device, output);
}

void DeviceMonitor::Print(const std::string& text) {
  const std::lock_guard lock(mutex_);
  printed_.push_back(text);
}

void DeviceMonitor::Run() {
  using Clock = std::chrono::steady_clock;
  const auto interval = std::chrono::milliseconds(terminal_ ? 100 : 1000);
  constexpr auto kStep = std::chrono::milliseconds(20);
  Clock::time_point drawn = Clock::now();
  while (!stop_) {
    std::this_thread::sleep_for(kStep);
    const Clock::time_point now = Clock::now();
    if (now - drawn < interval) continue;
    Draw(std::chrono::duration<double>(now - drawn).count());
    drawn = now;
  }
  Draw(std::max(1e-3, std::chrono::duration<double>(Clock::now() - drawn).count()));
}

void DeviceMonitor::Draw(double seconds) {
  winsize size{};
  std::size_t width = 80;
  if (terminal_ && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) {
    width = size.ws_col - 1u;
  }
  std::string text;
  {
    // Released before the output, which a slow terminal may block.
    const std::lock_guard lock(mutex_);
    if (terminal_ && lines_shown_ > 0) text = fmt::format("\033[{}A\033[J", lines_shown_);
    for (const std::string& line : std::exchange(printed_, {})) text += line + "\n";
    if (terminal_) {
      const std::vector<std::string> lines = bars_.Lines(seconds, width);
      for (const std::string& line : lines) text += line + "\n";
      lines_shown_ = lines.size();
    } else {
      text += bars_.Line(seconds) + "\n";
    }
  }
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace torquer::daemon
