// torquer-study: measures the simulator and writes reports.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "host/study/accuracy.h"
#include "host/study/effects.h"
#include "host/study/experiments.h"
#include "host/study/paper.h"
#include "host/study/scaling.h"
#include "host/study/segments.h"
#include "host/study/study.h"
#include "host/study/torture.h"
#include "host/study/trace.h"
#include "host/study/twist.h"
#include "host/support/program.h"

namespace torquer::study {
namespace {

// Table of studies: every subcommand has its line here.
std::vector<std::unique_ptr<Study>> AllStudies() {
  std::vector<std::unique_ptr<Study>> studies;
  studies.push_back(MakeAccuracyStudy());
  studies.push_back(MakeEffectsStudy());
  studies.push_back(MakeExperimentsStudy());
  studies.push_back(MakePaperStudy());
  studies.push_back(MakeScalingStudy());
  studies.push_back(MakeSegmentsStudy());
  studies.push_back(MakeTortureStudy());
  studies.push_back(MakeTraceStudy());
  studies.push_back(MakeTwistStudy());
  return studies;
}

void AddCommonOptions(Options& options, StudyRun::Options& common) {
  options.Group("Options of every study");
  options.Flag("--quick", common.quick, "measure fewer and smaller cases");
  options.Flag("--json", common.json,
               "print JSON objects on standard output, one per line, instead of text");
  options.Text("--out", "FOLDER", common.folder,
               "output folder for STUDY.csv, STUDY.jsonl, STUDY.html and STUDY.svg",
               ValueKind::kFolder);
}

int RunStudy(Study& study, const StudyRun::Options& options) {
  StudyRun run(study.name(), options);
  const bool held = study.Run(run);
  run.Finish(study.title());
  return held ? kExitSuccess : kExitFailure;
}

int Main(int argc, char** argv) {
  Program program("torquer-study",
                  "Measures the accuracy and the computing time of the simulator. It writes "
                  "figures as text, CSV, JSON and a report with plots.");
  program.Note(
      "Exit status: 0 on success; 1 when a check of the study failed; 2 when an option or a file "
      "cannot be used.");
  const std::vector<std::unique_ptr<Study>> studies = AllStudies();
  StudyRun::Options common;
  common.folder = "study-results";
  for (const auto& study : studies) {
    Options& options = program.Subcommand(study->name(), study->summary());
    study->AddOptions(options);
    AddCommonOptions(options, common);
  }
  return program.Main(argc, argv, [&] {
    for (const auto& study : studies) {
      if (study->name() == program.subcommand()) return RunStudy(*study, common);
    }
    return static_cast<int>(kExitUnexpected);
  });
}

}  // namespace
}  // namespace torquer::study

int main(int argc, char** argv) { return torquer::study::Main(argc, argv); }
