#include "tests/faults/faulty_run.h"

#include <fstream>

#include "tests/support/paths.h"

namespace torquer::test {
namespace {

std::vector<std::string> Preloaded(const std::vector<std::string>& settings,
                                   const std::vector<std::string>& words) {
  std::vector<std::string> all{"/usr/bin/env"};
  all.insert(all.end(), settings.begin(), settings.end());
  all.push_back("LD_PRELOAD=" + ProgramPath("helpers/failing_io.so"));
  all.insert(all.end(), words.begin(), words.end());
  return all;
}

}  // namespace

std::vector<std::string> WithFault(const Fault& fault, const std::vector<std::string>& words) {
  return Preloaded(
      {"TORQUER_FAULT_KIND=" + fault.kind, "TORQUER_FAULT_AT=" + std::to_string(fault.at),
       "TORQUER_FAULT_UNDER=" + fault.under, "TORQUER_FAULT_LOG=" + fault.log},
      words);
}

std::vector<std::string> WithSetting(const std::string& setting,
                                     const std::vector<std::string>& words) {
  return Preloaded({setting}, words);
}

std::vector<std::string> Steps(const Fault& fault) {
  std::vector<std::string> steps;
  std::ifstream log(fault.log);
  for (std::string line; std::getline(log, line);) steps.push_back(line);
  return steps;
}

}  // namespace torquer::test
