#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include "host/emulator/usb_host.h"
#include "protocol/hid_reports.h"
using namespace torquer;
using namespace torquer::emulator;
TEST_CASE("trial") {
  for (const char* name : {"/torquer-firmware.elf", "/torquer-firmware-8mhz.elf"}) {
  FirmwareImage image(std::string(TORQUER_FIRMWARE_DIR) + name);
  BenchOptions options;
  BenchDevice device(image, options);
  device.SetHand([](double t) { HandState h; h.insertion_mm = t > 0.5 ? (t - 0.5) * 1000 : 0; return h; });
  UsbHost host(device);
  int n = 0, gaps = 0; protocol::InputReport last{};
  host.wants_input = [] { return true; };
  host.on_input = [&](const std::vector<std::uint8_t>& p) { protocol::InputReport r; REQUIRE(p.size()==32); std::memcpy(&r, p.data(), 32);
    gaps += n && r.sequence != std::uint16_t(last.sequence + 1); last = r; ++n; };
  CHECK(host.RunUntilReady());
  WARN("ready at " << device.now_us() / 1000 << " ms; " << host.enumeration().product << " " << host.enumeration().serial << " cfg " << host.enumeration().configuration_descriptor.size() << " rd " << host.enumeration().report_descriptor.size());
  auto t0 = std::chrono::steady_clock::now();
  for (int i = 0; i < 5000; ++i) host.RunFrame();
  double dt = std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count();
  WARN("reports " << n << " gaps " << gaps << " axial " << last.axial_counts << " sensor " << device.sensor().axial_counts() << " flags " << int(last.flags) << " x " << last.joystick_x << " y " << last.joystick_y << " t " << last.device_time_us << " " << dt << " s; awake " << device.CyclesUsedFraction() << " cpi " << last.cpi << " buttons " << int(last.buttons) << " boot " << int(last.boot_id));
  auto d = host.GetFeature(4);
  WARN("status " << int(d.status) << " size " << d.data.size());
  if (d.data.size() == 32) { protocol::DiagnosticsReport r; std::memcpy(&r, d.data.data(), 32); WARN("headroom " << r.stack_headroom << " longest " << r.longest_frame_us << " faults " << r.sensor_faults << " missed " << r.frames_missed << " reset " << int(r.reset_reason)); }
  for (auto& v : device.Violations()) WARN(v);
  }
}
