#include "firmware/board/atmega32u4/setup.h"
#include "firmware/board/board.h"
#include "firmware/src/bench_firmware.h"
#include "firmware/src/pmw3360.h"
#include "firmware/src/sensor_service.h"
#include "firmware/src/usb_device.h"

namespace {
extern torquer::firmware::BenchFirmware bench_firmware;
torquer::firmware::Pmw3360 sensor{0};
torquer::firmware::SensorService sensor_reports{sensor};
torquer::firmware::UsbDevice usb{bench_firmware, sensor_reports};
#if TORQUER_BOARD == 2  // kBoardTwoSensorsAtmega32u4
torquer::firmware::Pmw3360 second_sensor{1};
torquer::firmware::BenchFirmware bench_firmware{sensor, sensor_reports, usb, &second_sensor};
#else
torquer::firmware::BenchFirmware bench_firmware{sensor, sensor_reports, usb};
#endif
}  // namespace

int main() {
  torquer::board::SetUp();
  bench_firmware.Start();
  for (;;) {
    bench_firmware.Step();
    torquer::board::Idle();
  }
}
