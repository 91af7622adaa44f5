#include "tests/support/paths.h"

namespace torquer::test {

std::string SourcePath(const std::string& below_root) { return TORQUER_SOURCE_DIR + below_root; }
std::string ProgramPath(const std::string& name) { return TORQUER_BIN_DIR "/" + name; }
std::string FirmwarePath(const std::string& name) { return TORQUER_FIRMWARE_DIR "/" + name; }

}  // namespace torquer::test
