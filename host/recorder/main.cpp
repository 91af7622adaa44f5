// torquer-report: the figures and the picture of a recorded session.

#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "calibration/calibration_file.h"
#include "host/recorder/report_output.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/simulator/vessel/surface_net.h"
#include "host/support/atomic_file.h"
#include "host/support/program.h"

namespace {

constexpr std::size_t kOutlineTriangles = 8000;

struct Arguments {
  std::string log;
  std::vector<std::string> calibrations;
  std::string picture;
  std::string scene;
  bool json = false;
};

torquer::PictureVessel Surface(const torquer::vessel::Vessel& vessel) {
  const torquer::vessel::TriangleMesh mesh =
      vessel.surface
          ? vessel.surface->mesh()
          : torquer::vessel::SurfaceInAbout(kOutlineTriangles, *vessel.field, vessel.bounds_mm);
  torquer::PictureVessel surface;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    surface.triangles_mm.push_back({mesh.Corner(i, 0), mesh.Corner(i, 1), mesh.Corner(i, 2)});
  }
  return surface;
}

// The calibration of a device: of the given files the one that names it, otherwise the only one,
// otherwise nominal gains.
Eigen::Matrix2d MotionPerCount(const std::vector<std::string>& files, const std::string& device,
                               int cpi) {
  torquer::calibration::MotionModel motion =
      torquer::calibration::NominalCalibration("", cpi).motion;
  for (const std::string& file : files) {
    const torquer::calibration::Calibration given = torquer::calibration::ReadCalibration(file);
    if (given.device == device || files.size() == 1) motion = given.motion;
  }
  Eigen::Matrix2d per_count;
  per_count << motion.per_count[0][0], motion.per_count[0][1], motion.per_count[1][0],
      motion.per_count[1][1];
  return per_count;
}

int Run(const Arguments& arguments) {
  if (arguments.log.empty()) throw torquer::UsageError("LOG is missing; name the log of a session");
  // One that cannot be written is refused before a long log is read.
  std::optional<torquer::AtomicFile> picture;
  if (!arguments.picture.empty()) picture.emplace(arguments.picture);
  torquer::SessionReporter reporter;
  const torquer::SessionLogSummary summary =
      torquer::ReadSessionLog(arguments.log, reporter.Handlers());
  torquer::SessionReport report = reporter.Finish([&](const std::string& device, int cpi) {
    return MotionPerCount(arguments.calibrations, device, cpi);
  });
  report.undecodable = summary.undecodable;
  report.damage = summary.damage;
  if (picture) {
    const torquer::scene::Scene scene(arguments.scene.empty() ? report.scene_file
                                                              : arguments.scene);
    picture->out() << torquer::DrawReport(report, Surface(scene.vessel()));
    picture->Finish();
  }
  fmt::print("{}", arguments.json ? torquer::FormatReportJson(report, arguments.picture)
                                  : torquer::FormatReport(report));
  return report.Good() ? torquer::kExitSuccess : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-report",
                           "Reports what a recorded session has lost, and whether "
                           "each instrument went where its hand went.");
  program.Note(
      "Exit status: 0 when no report was lost, hand and wire agree within one count of the sensor, "
      "and the log is whole; 1 when not; 2 when there is nothing to judge.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.log, "log of the session, written by torquer-recorder");
  options.Texts(
      "--calibration", "FILE", arguments.calibrations,
      "calibration that a daemon used, once for each device; without it nominal gains, as "
      "--uncalibrated has");
  options.Flag("--json", arguments.json, "print one JSON object instead of text");
  options.Text("--picture", "FILE.svg", arguments.picture,
               "draw the last state of the wire in its vessel", torquer::ValueKind::kFile);
  options.Text("--scene", "FILE", arguments.scene,
               "scene with the vessel, where it is not where the simulator had it",
               torquer::ValueKind::kFile);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
