// Fuzz target for calibration files. An accepted file is written again and must read back the same.
#include <stdexcept>

#include "calibration/calibration_file.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::calibration_target {
namespace {

constexpr std::string_view kEnd = "[end]\nchecksum = \"";

std::vector<Bytes> Seeds() {
  return {ToBytes(SourceText("calibration/emulator.toml")),
          ToBytes(calibration::FormatCalibration(calibration::NominalCalibration("FUZZ-1", 800)))};
}

bool Accepts(std::span<const std::uint8_t> input) {
  const auto read = calibration::ParseCalibration(ToText(input), "fuzz.toml");
  const std::string written = calibration::FormatCalibration(read);
  try {
    if (calibration::FormatCalibration(calibration::ParseCalibration(written, "written.toml")) !=
        written) {
      throw std::logic_error("written again, it is another calibration");
    }
  } catch (const UserError& e) {
    throw std::logic_error(std::string("what is written cannot be read: ") + e.what());
  }
  return true;
}

// Corrects the checksum in the last line.
void Repair(Bytes& input) {
  std::string text = ToText(input);
  text.resize(std::min(text.size(), text.rfind(kEnd)));
  text += std::string(kEnd) + Hex(Fnv1a(text)) + "\"\n";
  input = ToBytes(text);
}

const Registration kRegistration({.name = "calibration",
                                  .seeds = Seeds,
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 4000});

}  // namespace
}  // namespace torquer::fuzz::calibration_target
