// torquer-report: the figures and the picture of a recorded session.

#include <fmt/format.h>

#include <string>

#include "calibration/calibration_file.h"
#include "host/recorder/report_output.h"
#include "host/recorder/vessel_outline.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/support/atomic_file.h"
#include "host/support/program.h"
#include "protocol/lcm_channels.h"

namespace {

constexpr std::size_t kOutlineTriangles = 8000;

struct Arguments {
  std::string log;
  std::string calibration;
  std::string picture;
  std::string scene;
  bool json = false;
};

torquer::PictureVessel Surface(const torquer::scene::Vessel& vessel) {
  if (!vessel.surface) {
    return torquer::OutlineInAbout(kOutlineTriangles, *vessel.field, vessel.bounds_mm);
  }
  const torquer::vessel::TriangleMesh& mesh = vessel.surface->mesh();
  torquer::PictureVessel surface;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    surface.triangles_mm.push_back({mesh.Corner(i, 0), mesh.Corner(i, 1), mesh.Corner(i, 2)});
  }
  return surface;
}

int Run(const Arguments& arguments) {
  if (arguments.log.empty()) throw torquer::UsageError("LOG is missing; name the log of a session");
  torquer::SessionReporter reporter(torquer::protocol::kGuidewire);
  const torquer::SessionLogSummary summary =
      torquer::ReadSessionLog(arguments.log, reporter.Handlers());
  const torquer::calibration::MotionModel motion =
      arguments.calibration.empty()
          ? torquer::calibration::NominalCalibration("", reporter.cpi()).motion
          : torquer::calibration::ReadCalibration(arguments.calibration).motion;
  Eigen::Matrix2d motion_per_count;
  motion_per_count << motion.per_count[0][0], motion.per_count[0][1], motion.per_count[1][0],
      motion.per_count[1][1];

  torquer::SessionReport report = reporter.Finish(motion_per_count);
  report.undecodable = summary.undecodable;
  if (!arguments.picture.empty()) {
    const torquer::scene::Scene scene(arguments.scene.empty() ? report.scene_file
                                                              : arguments.scene);
    torquer::WriteFileAtomically(arguments.picture,
                                 torquer::DrawReport(report, Surface(scene.vessel())));
  }
  fmt::print("{}", arguments.json ? torquer::FormatReportJson(report, arguments.picture)
                                  : torquer::FormatReport(report));
  return report.Good() ? torquer::kExitSuccess : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-report",
                           "Reports what a session that lcm-logger recorded has lost, and whether "
                           "the wire went where the hand went.");
  program.Note(
      "Exit status: 0 when no report was lost and hand and wire agree within one count of the "
      "sensor, 1 when not, 2 when there is nothing to judge.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.log, "log of the session, written by lcm-logger");
  options.Text("--calibration", "FILE", arguments.calibration,
               "calibration that the daemon used; without it nominal gains, as --uncalibrated has",
               torquer::ValueKind::kFile);
  options.Flag("--json", arguments.json, "print one JSON object instead of text");
  options.Text("--picture", "FILE.svg", arguments.picture,
               "draw the last state of the wire in its vessel", torquer::ValueKind::kFile);
  options.Text("--scene", "FILE", arguments.scene,
               "scene with the vessel, where it is not where the simulator had it",
               torquer::ValueKind::kFile);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
