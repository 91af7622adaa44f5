// fuzz-replay TARGET [INPUT] runs the target's seeds and committed corpus, and a fixed number of
// mutations of both. With INPUT it runs only that input, such as one that failed before.
//
// An input that reveals a defect is stored in fuzz-TARGET.input in the current folder. Exit status:
// 0 on success. 1 if a seed is refused, or if all mutations are refused or none. For a defect, the
// sanitizer's status or SIGABRT.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/fuzz/mutation.h"
#include "tests/fuzz/target.h"
#include "tests/support/paths.h"

namespace {

using torquer::fuzz::Bytes;
using torquer::fuzz::Target;

const Bytes* trying = nullptr;
const Target* target_of_it = nullptr;

void KeepInput() {
  if (trying == nullptr) return;
  const std::string path = "fuzz-" + target_of_it->name + ".input";
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(trying->data()),
             static_cast<std::streamsize>(trying->size()));
  file.close();
  std::fprintf(stderr, "the input is in %s\n", path.c_str());
  trying = nullptr;
}

Bytes FileBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    std::fprintf(stderr, "%s cannot be read\n", path.c_str());
    std::exit(2);
  }
  return {std::istreambuf_iterator<char>(file), {}};
}

bool Run(const Target& target, const Bytes& input) {
  trying = &input;
  const bool accepted = Try(target, input);
  trying = nullptr;
  return accepted;
}

std::vector<Bytes> Corpus(const Target& target) {
  const std::filesystem::path folder =
      torquer::test::SourcePath("/tests/fuzz/corpus/" + target.name);
  std::vector<std::filesystem::path> paths;
  std::error_code none;
  for (const auto& file : std::filesystem::directory_iterator(folder, none)) {
    paths.push_back(file.path());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<Bytes> corpus;
  for (const auto& path : paths) corpus.push_back(FileBytes(path));
  return corpus;
}

int Replay(const Target& target) {
  std::vector<Bytes> inputs = target.seeds();
  int status = 0;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    if (Run(target, inputs[k])) continue;
    std::printf("%s: seed %zu is refused\n", target.name.c_str(), k);
    status = 1;
  }
  const std::size_t seeds = inputs.size();
  for (Bytes& input : Corpus(target)) {
    Run(target, input);
    if (!input.empty()) inputs.push_back(std::move(input));
  }
  std::mt19937 random(20261122);
  int accepted = 0;
  for (int k = 0; k < target.replay_inputs; ++k) {
    accepted += Run(target, Mutate(target, inputs, random)) ? 1 : 0;
  }
  std::printf("%s: %zu seeds, %zu of the corpus, %d mutations, of which %d accepted\n",
              target.name.c_str(), seeds, inputs.size() - seeds, target.replay_inputs, accepted);
  // Both must occur, or the mutations have no effect.
  if (accepted == 0 || accepted == target.replay_inputs) {
    std::printf("%s: the mutations reach one side of the parser only\n", target.name.c_str());
    status = 1;
  }
  return status;
}

}  // namespace

// Default visibility, because the sanitizers are shared libraries.
#ifdef __SANITIZE_ADDRESS__
extern "C" [[gnu::visibility("default")]] void __asan_on_error() { KeepInput(); }
#endif
extern "C" [[gnu::visibility("default")]] const char* __asan_default_options() {
  return "abort_on_error=1:handle_abort=1";
}
extern "C" [[gnu::visibility("default")]] const char* __ubsan_default_options() {
  return "abort_on_error=1:print_stacktrace=1";
}

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3) {
    std::fprintf(stderr, "usage: fuzz-replay TARGET [INPUT]\n");
    return 2;
  }
  const Target& target = torquer::fuzz::FindTarget(argv[1]);
  target_of_it = &target;
  if (argc == 2) return Replay(target);
  std::printf("%s\n", Run(target, FileBytes(argv[2])) ? "accepted" : "refused");
  return 0;
}
