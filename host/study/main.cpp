// torquer-study: measures what the simulator does, and writes it down.

#include <algorithm>
#include <exception>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "host/study/accuracy.h"
#include "host/study/effects.h"
#include "host/study/paper.h"
#include "host/study/scaling.h"
#include "host/study/study.h"
#include "host/study/torture.h"
#include "host/support/error.h"

namespace torquer::study {
namespace {

// The table of studies: every subcommand has its line here.
std::vector<std::unique_ptr<Study>> AllStudies() {
  std::vector<std::unique_ptr<Study>> studies;
  studies.push_back(MakeAccuracyStudy());
  studies.push_back(MakeEffectsStudy());
  studies.push_back(MakePaperStudy());
  studies.push_back(MakeScalingStudy());
  studies.push_back(MakeTortureStudy());
  return studies;
}

std::string Usage(const std::vector<std::unique_ptr<Study>>& studies) {
  std::string text = "usage: torquer-study STUDY [options]\n";
  for (const auto& study : studies) {
    text += "  " + study->name() +
            std::string(12 - std::min<std::size_t>(11, study->name().size()), ' ') +
            study->summary() + "\n" + study->OptionsUsage();
  }
  return text +
         "options of every study:\n"
         "  --quick       fewer and smaller cases\n"
         "  --json        JSON objects on standard output, one a line, instead of text\n"
         "  --out FOLDER  where STUDY.csv, .jsonl, .html and .svg go; study-results if not given\n";
}

int RunStudy(const std::vector<std::unique_ptr<Study>>& studies, int argc, char** argv) {
  const std::string usage = Usage(studies);
  const std::string name = argc > 1 ? argv[1] : "";
  if (name == "--help") {
    std::cout << usage;
    return 0;
  }
  Study* study = nullptr;
  for (const auto& candidate : studies) {
    if (candidate->name() == name) study = candidate.get();
  }
  if (study == nullptr) {
    throw UserError(
        (name.empty() ? std::string("no study named") : "unknown study '" + name + "'") + "\n" +
        usage);
  }
  StudyRun::Options options;
  options.folder = "study-results";
  bool help = false;
  CommandLine line;
  line.Flag("--quick", options.quick);
  line.Flag("--json", options.json);
  line.Flag("--help", help);
  line.Option("--out", options.folder);
  study->AddOptions(line);
  line.Parse(argc - 1, argv + 1, usage);
  if (help) {
    std::cout << usage;
    return 0;
  }
  StudyRun run(study->name(), options);
  const bool held = study->Run(run);
  run.Finish(study->title());
  return held ? 0 : 1;
}

}  // namespace
}  // namespace torquer::study

int main(int argc, char** argv) {
  try {
    return torquer::study::RunStudy(torquer::study::AllStudies(), argc, argv);
  } catch (const torquer::UserError& error) {
    std::cerr << "torquer-study: " << error.what() << "\n";
    return torquer::kExitUserError;
  } catch (const std::exception& error) {
    std::cerr << "torquer-study: " << error.what() << "\n";
    return 1;
  }
}
