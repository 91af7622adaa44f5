// `fuzz-libfuzzer [libFuzzer's options and folders]` runs one target under libFuzzer, whose inputs
// follow the code that they reach (https://llvm.org/docs/LibFuzzer.html). The environment variable
// TORQUER_FUZZ_TARGET names the target, because libFuzzer restarts itself with other arguments.
// `fuzz-libfuzzer --list` prints the targets. `fuzz-libfuzzer --seeds FOLDER` writes the target's
// seeds there. The script tests/fuzz/run calls it.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/fuzz/target.h"

namespace {

const torquer::fuzz::Target* target = nullptr;

void WriteSeeds(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  int number = 0;
  for (const auto& seed : target->seeds()) {
    std::ofstream(folder / ("seed-" + std::to_string(number++)), std::ios::binary)
        .write(reinterpret_cast<const char*>(seed.data()),
               static_cast<std::streamsize>(seed.size()));
  }
}

}  // namespace

#pragma GCC visibility push(default)
extern "C" {

// Function of libFuzzer: mutates an input in place and returns its new size.
std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

int LLVMFuzzerInitialize(int* count, char*** words) {
  const std::string word = *count > 1 ? (*words)[1] : "";
  if (word == "--list") {
    for (const std::string& name : torquer::fuzz::TargetNames()) std::printf("%s\n", name.c_str());
    std::exit(0);
  }
  const char* name = std::getenv("TORQUER_FUZZ_TARGET");
  if (name == nullptr) {
    std::fprintf(stderr, "TORQUER_FUZZ_TARGET names no target; fuzz-libfuzzer --list does\n");
    std::exit(2);
  }
  target = &torquer::fuzz::FindTarget(name);
  if (word == "--seeds" && *count == 3) {
    WriteSeeds((*words)[2]);
    std::exit(0);
  }
  return 0;
}

std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                    unsigned /*seed*/) {
  size = LLVMFuzzerMutate(data, size, most);
  if (target->repair == nullptr) return size;
  torquer::fuzz::Bytes input(data, data + size);
  target->repair(input);
  input.resize(std::min(input.size(), most));
  std::memcpy(data, input.data(), input.size());
  return input.size();
}

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  torquer::fuzz::Try(*target, {data, size});
  return 0;
}

}  // extern "C"
#pragma GCC visibility pop
