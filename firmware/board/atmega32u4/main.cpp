#include "firmware/board/atmega32u4/setup.h"
#include "firmware/board/board.h"
#include "firmware/src/bench_firmware.h"

namespace {
torquer::firmware::BenchFirmware bench_firmware;
}

int main() {
  torquer::board::SetUp();
  bench_firmware.Start();
  for (;;) {
    bench_firmware.Step();
    torquer::board::Idle();
  }
}
