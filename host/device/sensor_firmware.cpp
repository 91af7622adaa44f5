#include "host/device/sensor_firmware.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "host/device/report_copy.h"
#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/user_paths.h"
#include "protocol/hid_reports.h"

namespace torquer::device {
namespace {

// Letters, digits, commas: a listing of bytes, or Intel HEX.
bool LooksLikeText(const std::vector<std::uint8_t>& bytes) {
  return !bytes.empty() && std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) {
    return (byte >= ' ' && byte <= '~') || byte == '\n' || byte == '\r' || byte == '\t';
  });
}

protocol::DiagnosticsReport Diagnostics(FeatureReports& reports) {
  return GetReport<protocol::DiagnosticsReport>(reports, protocol::kDiagnosticsReportId);
}

}  // namespace

std::vector<std::uint8_t> ReadSromFile(const std::string& path) {
  const InputFile file(path, "name the file with the sensor maker's firmware image");
  // Reads at most one byte more than an image has, which shows a file that is too long.
  std::vector<std::uint8_t> bytes(protocol::kSromBytes + 1);
  bytes.resize(file.ReadAt(0, bytes.data(), bytes.size()));
  if (LooksLikeText(bytes)) {
    throw UserError(path +
                    ": is a text file, but an image of the PMW3360 is binary; convert the C array "
                    "or Intel HEX file to binary");
  }
  if (bytes.size() != protocol::kSromBytes) {
    throw UserError(path + ": has " +
                    (bytes.size() > protocol::kSromBytes
                         ? std::string("more than ") + std::to_string(protocol::kSromBytes)
                         : std::to_string(bytes.size())) +
                    " bytes where an image of the PMW3360 has " +
                    std::to_string(protocol::kSromBytes) + "; name the right file");
  }
  return bytes;
}

int LoadSrom(FeatureReports& reports, const std::vector<std::uint8_t>& image) {
  std::vector<std::uint8_t> report(1 + image.size(), protocol::kSromReportId);
  std::copy(image.begin(), image.end(), report.begin() + 1);
  try {
    reports.Set(report);
  } catch (const ReportRefused&) {
    const protocol::DiagnosticsReport after = Diagnostics(reports);
    if (after.sensor_fault_cause == protocol::kSensorSromRefused) {
      throw UserError(
          "the sensor rejected the firmware image: it is damaged, or for another sensor than the "
          "PMW3360. The sensor works without it");
    }
    throw UserError(
        "the device refused the firmware image: its sensor does not answer (check its wiring), or "
        "its firmware is too old for this (run torquer-flash)");
  }
  const int id = RunningSrom(reports);
  if (id == 0) {
    throw UserError(
        "the sensor has lost the firmware image again; check its supply, and try again");
  }
  return id;
}

int RunningSrom(FeatureReports& reports) { return Diagnostics(reports).srom_id; }

std::optional<std::string> KeptSromPath(const std::string& serial) {
  return DeviceFilePath(serial, ".srom");
}

std::optional<std::string> KeepSrom(const std::string& serial,
                                    const std::vector<std::uint8_t>& image) {
  std::optional<std::string> path = KeptSromPath(serial);
  if (!path) return std::nullopt;
  std::error_code ignored;  // writing the file then fails with a better message
  std::filesystem::create_directories(std::filesystem::path(*path).parent_path(), ignored);
  WriteFileAtomically(*path,
                      std::string_view(reinterpret_cast<const char*>(image.data()), image.size()));
  return path;
}

}  // namespace torquer::device
