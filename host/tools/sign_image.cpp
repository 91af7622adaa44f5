// torquer-sign-image: the build's last step for a firmware image. Reads the flash's contents with
// the trailer as it was compiled, and writes that trailer with length and CRC.
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

#include "host/support/error.h"
#include "host/support/program.h"
#include "host/tools/flash_image.h"

namespace {

using torquer::UserError;

int Main(int argc, char** argv) {
  if (argc != 3) throw UserError("usage: torquer-sign-image FLASH.bin TRAILER.bin");
  std::ifstream in(argv[1], std::ios::binary);
  const std::vector<std::uint8_t> flash((std::istreambuf_iterator<char>(in)),
                                        std::istreambuf_iterator<char>());
  if (!in) throw UserError(std::string(argv[1]) + ": cannot be read");
  const torquer::protocol::ImageTrailer trailer = torquer::tools::SignImage(flash, argv[1]);
  std::ofstream out(argv[2], std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(&trailer), sizeof(trailer));
  out.close();
  if (!out) throw UserError(std::string(argv[2]) + ": cannot be written");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Main(argc, argv);
  } catch (const UserError& error) {
    std::fprintf(stderr, "torquer-sign-image: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
