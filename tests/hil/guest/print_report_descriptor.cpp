// print_report_descriptor prints the HID report descriptor that the device must have, one byte per
// line.
#include <cstdio>

#include "protocol/hid_descriptor.h"

int main() {
  for (const auto byte : torquer::protocol::kHidReportDescriptor) std::printf("%02x\n", byte);
}
