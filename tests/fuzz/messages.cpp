// Fuzz target for every LCM type: bus check and generated decoder. The first byte selects the type.
#include "tests/fuzz/target.h"
#include "tests/support/sample_messages.h"

namespace torquer::fuzz::messages_target {
namespace {

const std::vector<test::SampleMessage>& Samples() {
  static const std::vector<test::SampleMessage> samples = test::SampleMessages();
  return samples;
}

std::vector<Bytes> Seeds() {
  std::vector<Bytes> seeds;
  for (std::size_t k = 0; k < Samples().size(); ++k) {
    seeds.push_back({static_cast<std::uint8_t>(k)});
    seeds.back().insert(seeds.back().end(), Samples()[k].bytes.begin(), Samples()[k].bytes.end());
  }
  return seeds;
}

// A decoded message must encode to the same bytes (sample_messages.h).
bool Accepts(std::span<const std::uint8_t> input) {
  if (input.empty()) return false;
  const auto message = input.subspan(1);
  return Samples()[input[0] % Samples().size()].decodes({message.begin(), message.end()});
}

// Corrects the fingerprint of the type.
void Repair(Bytes& input) {
  if (input.size() < 9) return;
  const Bytes& sample = Samples()[input[0] % Samples().size()].bytes;
  std::copy_n(sample.begin(), 8, input.begin() + 1);
}

const Registration kRegistration({.name = "messages",
                                  .seeds = Seeds,
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 60000});

}  // namespace
}  // namespace torquer::fuzz::messages_target
