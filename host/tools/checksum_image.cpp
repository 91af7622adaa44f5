// torquer-checksum-image: writes the image trailer with length and CRC as the last step of the
// firmware's build.
#include <cstdint>
#include <string>
#include <vector>

#include "host/support/atomic_file.h"
#include "host/support/input_file.h"
#include "host/support/program.h"
#include "host/tools/flash_image.h"

namespace {

struct Arguments {
  std::string flash;
  std::string trailer;
};

int Run(const Arguments& arguments) {
  if (arguments.trailer.empty()) throw torquer::UsageError("FLASH.bin and TRAILER.bin are needed");
  const std::string contents =
      torquer::ReadInputFile(arguments.flash, "check the path and its permissions");
  const std::vector<std::uint8_t> flash(contents.begin(), contents.end());
  const torquer::protocol::ImageTrailer trailer =
      torquer::tools::MakeTrailer(flash, arguments.flash);
  torquer::WriteFileAtomically(arguments.trailer,
                               {reinterpret_cast<const char*>(&trailer), sizeof trailer});
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-checksum-image",
      "Reads the flash contents that the firmware build produced, and writes the image trailer "
      "with their length and CRC. The build calls this program as its last step.");
  Arguments arguments;
  program.options().Operand("FLASH.bin", arguments.flash, "contents of the flash from address 0");
  program.options().Operand("TRAILER.bin", arguments.trailer, "trailer file to write");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
