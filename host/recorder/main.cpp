// torquer-report: the figures and the picture of a recorded session.

#include <cstdio>
#include <fstream>
#include <iostream>
#include <string>

#include "calibration/calibration_file.h"
#include "host/recorder/report_output.h"
#include "host/recorder/vessel_outline.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/support/command_line.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace {

constexpr char kUsage[] =
    "usage: torquer-report LOG [--calibration FILE] [--json] [--picture FILE.svg]\n"
    "                          [--scene FILE]\n"
    "Tells what a session that lcm-logger recorded lost, and whether the wire went where the hand\n"
    "went. Exit status: 0 when no report was lost and both agree within one count of the sensor,\n"
    "1 when not, 2 when there is nothing to judge.\n"
    "  --calibration FILE  that the daemon used; without, nominal gains, as --uncalibrated has\n"
    "  --json              one JSON object instead of text\n"
    "  --picture FILE.svg  draw the last state of the wire in its vessel\n"
    "  --scene FILE        of the vessel, where it is not where the simulator had it\n";

constexpr std::size_t kOutlineTriangles = 8000;

struct Options {
  std::string log;
  std::string calibration;
  std::string picture;
  std::string scene;
  bool json = false;
  bool help = false;
};

Options Parse(int argc, char** argv) {
  Options options;
  torquer::CommandLine line;
  line.Operand(options.log);
  line.Option("--calibration", options.calibration);
  line.Option("--picture", options.picture);
  line.Option("--scene", options.scene);
  line.Flag("--json", options.json);
  line.Flag("--help", options.help);
  line.Parse(argc, argv, kUsage);
  if (options.log.empty() && !options.help) {
    throw torquer::UserError(std::string("no LOG given\n") + kUsage);
  }
  return options;
}

void WriteFile(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file)
    throw torquer::UserError(path + ": cannot be written; name a file in a folder of yours");
}

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

int Run(const Options& options) {
  torquer::SessionReporter reporter(torquer::protocol::kGuidewire);
  const torquer::SessionLogSummary summary =
      torquer::ReadSessionLog(options.log, reporter.Handlers());
  const torquer::calibration::MotionModel motion =
      options.calibration.empty()
          ? torquer::calibration::NominalCalibration("", reporter.cpi()).motion
          : torquer::calibration::ReadCalibration(options.calibration).motion;
  Eigen::Matrix2d motion_per_count;
  motion_per_count << motion.per_count[0][0], motion.per_count[0][1], motion.per_count[1][0],
      motion.per_count[1][1];

  torquer::SessionReport report = reporter.Finish(motion_per_count);
  report.undecodable = summary.undecodable;
  if (!options.picture.empty()) {
    const torquer::scene::Scene scene(options.scene.empty() ? report.scene_file : options.scene);
    WriteFile(options.picture, torquer::DrawReport(report, Surface(scene.vessel())));
  }
  std::cout << (options.json ? torquer::FormatReportJson(report, options.picture)
                             : torquer::FormatReport(report));
  return report.Good() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = Parse(argc, argv);
    if (options.help) {
      std::cout << kUsage;
      return 0;
    }
    return Run(options);
  } catch (const torquer::UserError& error) {
    std::cerr << "torquer-report: " << error.what() << "\n";
    return torquer::kExitUserError;
  }
}
