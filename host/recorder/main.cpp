// torquer-report: the figures, the picture and the page of a recorded session.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "calibration/calibration_file.h"
#include "host/recorder/expert_run.h"
#include "host/recorder/pass_marks.h"
#include "host/recorder/report_output.h"
#include "host/recorder/report_page.h"
#include "host/recorder/session_judge.h"
#include "host/recorder/session_limits.h"
#include "host/recorder/session_summary.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/simulator/vessel/surface_net.h"
#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/program.h"

namespace {

constexpr std::size_t kOutlineTriangles = 8000;

struct Arguments {
  std::string log;
  std::vector<std::string> calibrations;
  std::string picture;
  std::string page;
  std::string scene;
  std::string marks;
  std::string trainee;
  std::string group;
  bool json = false;
  bool examination = false;
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

// Calibration of a device: from the given file that names it. Otherwise from the only file, if one
// file is given, else nominal gains.
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

// Writes a page, and the summary that later pages use beside it.
class PageFiles {
 public:
  explicit PageFiles(const std::string& page)
      : path_(page), page_(page), summary_(torquer::SummaryPath(page)) {}

  void Write(const torquer::SessionReport& report, torquer::PageParts parts) {
    const torquer::SessionSummary summary = torquer::Summarize(report);
    parts.earlier = torquer::ReadEarlierSessions(path_, summary);
    page_.out() << torquer::FormatPage(report, parts);
    page_.Finish();
    summary_.out() << torquer::FormatSummary(summary);
    summary_.Finish();
  }

 private:
  std::string path_;
  torquer::AtomicFile page_;
  torquer::AtomicFile summary_;
};

// Pass marks in the given file, otherwise those beside the scene file, if there are any.
std::optional<torquer::MarkSheet> MarksOf(const std::string& given, const std::string& scene_file,
                                          const torquer::SessionReport& report) {
  if (!given.empty()) return torquer::ReadMarks(given, report);
  const std::string beside = torquer::PassMarksPath(scene_file);
  std::error_code error;
  if (!std::filesystem::exists(beside, error)) return std::nullopt;
  return torquer::ReadMarks(beside, report);
}

// Judges a session whose scene has observers. Returns the scene if it was opened. A scene file that
// cannot be read is an error only if the caller needs it.
std::unique_ptr<torquer::scene::Scene> OpenAndJudge(const std::string& log,
                                                    const std::string& scene_file, bool needed,
                                                    torquer::SessionReport& report) {
  const bool observed = !report.readings.names.empty();
  if (!needed && !observed) return nullptr;
  std::unique_ptr<torquer::scene::Scene> scene;
  try {
    scene = std::make_unique<torquer::scene::Scene>(scene_file);
  } catch (const torquer::UserError& error) {
    if (needed) throw;
    report.not_gradable = error.what();
    return nullptr;
  }
  if (!observed) return scene;
  torquer::ApplyJudgment(torquer::JudgeSession(*scene, log), report);
  const std::string expert = torquer::ExpertPath(scene->spec().path);
  std::error_code error;
  if (std::filesystem::exists(expert, error)) report.expert = torquer::RunExpert(*scene, expert);
  return scene;
}

int Run(const Arguments& arguments) {
  if (arguments.trainee.empty() && !arguments.group.empty()) {
    throw torquer::UsageError("--group " + arguments.group + ": name the trainee by --trainee");
  }
  if (arguments.log.empty()) throw torquer::UsageError("LOG is missing; name the log of a session");
  if (!arguments.page.empty() && !arguments.page.ends_with(".html")) {
    throw torquer::UsageError("--page " + arguments.page + ": name a file that ends in .html");
  }
  // Open the outputs first: an unwritable path fails before a long log is read.
  std::optional<torquer::AtomicFile> picture;
  if (!arguments.picture.empty()) picture.emplace(arguments.picture);
  std::optional<PageFiles> page;
  if (!arguments.page.empty()) page.emplace(arguments.page);
  torquer::SessionReporter reporter;
  const torquer::SessionLogSummary summary =
      torquer::ReadSessionLog(arguments.log, reporter.Handlers());
  torquer::SessionReport report = reporter.Finish([&](const std::string& device, int cpi) {
    return MotionPerCount(arguments.calibrations, device, cpi);
  });
  report.undecodable = summary.undecodable;
  report.damage = summary.damage;
  report.unknown = summary.unknown;
  report.started_us = summary.started_us;
  report.examination = arguments.examination;
  report.trainee = arguments.trainee;
  report.group = arguments.group;
  const std::string scene_file = arguments.scene.empty() ? report.scene_file : arguments.scene;
  report.marks = MarksOf(arguments.marks, scene_file, report);
  const std::unique_ptr<torquer::scene::Scene> opened =
      OpenAndJudge(arguments.log, scene_file, picture.has_value() || page.has_value(), report);
  if (report.marks) torquer::CompareMarks(report, *report.marks);
  if (picture || page) {
    const torquer::scene::Scene& scene = *opened;
    const torquer::PictureVessel surface = Surface(scene.vessel());
    if (picture) {
      picture->out() << torquer::DrawReport(report, surface, false);
      picture->Finish();
    }
    if (page) {
      torquer::PageParts parts;
      parts.log = arguments.log;
      parts.limits = torquer::ReadLimits(scene.spec());
      parts.scene_changed = report.description.content_hash != torquer::Hex(scene.content_hash());
      parts.picture = torquer::DrawReport(report, surface, true);
      page->Write(report, std::move(parts));
    }
  }
  fmt::print("{}", arguments.json
                       ? torquer::FormatReportJson(report, arguments.picture, arguments.page)
                       : torquer::FormatReport(report));
  return report.Good() ? torquer::kExitSuccess : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-report",
                           "Reports the losses of a recorded session, and compares the motion of "
                           "each instrument with that of its hand.");
  program.Note(
      "Exit status: 0 when the log is complete, no report was lost, and every wire follows its "
      "device within one count; 1 otherwise; 2 when there is no session to judge.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.log, "log of the session, written by torquer-recorder");
  options.Texts("--calibration", "FILE", arguments.calibrations,
                "calibration file that a daemon used, once per device; without it nominal gains, "
                "as with --uncalibrated");
  options.Flag("--json", arguments.json, "print one JSON object instead of text");
  options.Text("--picture", "FILE.svg", arguments.picture,
               "write a picture of the last state of the wire in its vessel",
               torquer::ValueKind::kFile);
  options.Text("--page", "FILE.html", arguments.page,
               "write a report page of the session, and FILE.session.json beside it, with which "
               "later pages compare their sessions",
               torquer::ValueKind::kFile);
  options.Flag("--examination", arguments.examination,
               "note in all outputs that the session was an examination, not practice");
  options.Text("--trainee", "NAME", arguments.trainee,
               "name of the trainee, for all outputs; the learning curve has the sessions of one "
               "trainee");
  options.Text("--group", "NAME", arguments.group, "group of the trainee, such as a course");
  options.Text("--scene", "FILE", arguments.scene,
               "scene file with the vessel (default: the file that the simulator used)",
               torquer::ValueKind::kFile);
  options.Text(
      "--marks", "FILE", arguments.marks,
      "file with pass marks (default: pass_marks/NAME.toml beside the scene file, if there)",
      torquer::ValueKind::kFile);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
