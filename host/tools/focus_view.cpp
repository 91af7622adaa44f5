#include "host/tools/focus_view.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "host/bus/clock.h"
#include "host/device/sensor_firmware.h"
#include "host/device/sensor_picture.h"
#include "host/device/source_reports.h"
#include "host/support/atomic_file.h"
#include "host/support/csv_table.h"
#include "host/support/error.h"
#include "host/tools/calibrate_terminal.h"
#include "host/tools/focus_picture.h"

namespace torquer::tools {
namespace {

using calibration::FocusHeight;
using calibration::FocusPicture;

constexpr char kSeriesHeader[] = "shims_mm,sharpness";

// Number of pictures for a verdict: pixels that stay dark in all of them are dirt.
constexpr std::size_t kPictures = 4;
constexpr std::int64_t kFirstDeviceUs = 5000000;
// Pause after the start and after each picture: the sensor restarts, then the hand moves on.
constexpr std::int64_t kBetweenUs = 400000;

void WaitForDevice(device::ReportSource& source, const std::atomic<bool>& stop) {
  const std::int64_t start_us = bus::MonotonicUs();
  for (bool here = false; !here && !stop;) {
    source.Wait(50, [&](const device::SourceEvent& event) {
      here = here || event.kind == device::SourceEvent::Kind::kConnected;
    });
    if (!here && bus::MonotonicUs() - start_us > kFirstDeviceUs) {
      throw UserError(
          fmt::format("no device: none found at {} for 5 seconds; connect the bench device or "
                      "start torquer-emulator, and check --source and --device",
                      source.place()));
    }
  }
}

void LetTimePass(device::ReportSource& source, std::int64_t us, const std::atomic<bool>& stop) {
  const std::int64_t end_us = bus::MonotonicUs() + us;
  while (!stop && bus::MonotonicUs() < end_us) source.Wait(20, [](const device::SourceEvent&) {});
}

// Heights of earlier runs; none if the file does not exist yet. Checks that it can be written.
std::vector<FocusHeight> ReadSeries(const std::string& path) {
  std::vector<FocusHeight> heights;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    for (const CsvRow& row : ReadCsv(path, kSeriesHeader)) {
      heights.push_back(
          {CsvNumber(path, kSeriesHeader, row, 0), CsvNumber(path, kSeriesHeader, row, 1)});
    }
    if (!heights.empty()) static_cast<void>(calibration::FindFocus(heights));
  }
  const AtomicFile writable(path);
  return heights;
}

std::string SeriesText(const std::vector<FocusHeight>& heights) {
  std::string text = std::string(kSeriesHeader) + "\n";
  for (const FocusHeight& height : heights) {
    text += fmt::format("{:g},{:.4f}\n", height.shims_mm, height.sharpness);
  }
  return text;
}

}  // namespace

bool ShowFocus(device::ReportSource& source, const std::string& png_path,
               const std::optional<FocusSeries>& series, const std::atomic<bool>& stop) {
  std::vector<FocusHeight> heights = series ? ReadSeries(series->path) : std::vector<FocusHeight>{};
  if (!png_path.empty()) AtomicFile{png_path};  // checked before the work
  WaitForDevice(source, stop);
  device::SourceReports reports(source);
  LetTimePass(source, kBetweenUs, stop);
  const bool live = isatty(STDOUT_FILENO) != 0 && isatty(STDIN_FILENO) != 0;
  Terminal terminal;
  terminal.Print(fmt::format("Turn and push the wire slowly: what does not move with it is dirt.{}",
                             live ? " q ends." : ""));
  std::vector<FocusPicture> pictures;
  calibration::FocusVerdict verdict;
  bool had_image = false;
  long lines = 0;
  try {
    had_image = device::RunningSrom(reports) != 0;
    for (bool quit = false; !quit && !stop && (live || pictures.size() < kPictures);) {
      device::SensorPicture picture = device::TakeSensorPicture(reports);
      if (pictures.size() == kPictures) pictures.erase(pictures.begin());
      pictures.push_back(std::move(picture.pixels));
      verdict = calibration::JudgeFocus(pictures, picture.surface_quality);
      const std::string text =
          FocusText(pictures.back(), live) + FocusVerdictText(verdict, picture.surface_quality);
      if (live || pictures.size() == kPictures) {
        // Overwrite the previous picture.
        if (live && lines > 0) fmt::print("\033[{}A\033[J", lines);
        fmt::print("{}", text);
        std::fflush(stdout);
        lines = std::count(text.begin(), text.end(), '\n');
      }
      if (live || pictures.size() < kPictures) LetTimePass(source, kBetweenUs, stop);
      while (const std::optional<char> key = terminal.Key()) quit = quit || *key == 'q';
    }
  } catch (const device::DeviceGone& gone) {
    throw UserError(fmt::format("{}; check the cable and run the same command again", gone.what()));
  } catch (const device::ReportRefused& refused) {
    throw UserError(
        fmt::format("{}; run torquer-flash to renew the device's firmware", refused.what()));
  }
  if (pictures.empty()) return false;
  if (!png_path.empty()) {
    WriteFileAtomically(png_path, FocusPng(pictures.back()));
    fmt::print("Kept as {}.\n", png_path);
  }
  bool good = verdict.good;
  if (series) {
    heights.push_back({series->shims_mm, verdict.figures.sharpness});
    const calibration::FocusSearch search = calibration::FindFocus(heights);
    WriteFileAtomically(series->path, SeriesText(heights));
    fmt::print("{}\n", search.advice);
    good = good && search.in_focus;
  }
  if (had_image) {
    fmt::print("The sensor's firmware image is lost; load it again: torquer-flash --srom FILE\n");
  }
  return good;
}

}  // namespace torquer::tools
