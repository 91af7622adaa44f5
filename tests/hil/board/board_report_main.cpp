// board_report writes the report that the builder of a device sends in.
#include <fmt/format.h>

#include <cstdio>
#include <string>

#include "host/support/atomic_file.h"
#include "host/support/program.h"
#include "tests/hil/board_report.h"

int main(int argc, char** argv) {
  torquer::hil::BoardReportRequest request;
  std::string output = "torquer-board-report.txt";
  torquer::Program program(
      "board_report",
      "Writes a report about a bench device, to be sent in: ids, fuses, rates, "
      "jitter, surface, the camera's picture, calibration.");
  program.Note(
      "Stop what reads the device first. A firmware image in its sensor is lost on the way; "
      "torquer-daemon loads it again where torquer-flash --srom has kept it.");
  torquer::Options& options = program.options();
  options.Text("--device", "SERIAL", request.serial,
               "device with this serial number, needed when there are several");
  options.Text("--fuses", "PROGRAMMER", request.programmer,
               "read the chip's fuses too, by this ISP programmer (avrdude -c)");
  options.Text("--port", "TTY", request.port, "serial port of the programmer, where it needs one",
               torquer::ValueKind::kFile);
  options.Number("--seconds", "S", request.seconds, 1, 3600, "read reports for so long");
  options.Text("--output", "FILE", output, "where the report goes", torquer::ValueKind::kFile);
  return program.Main(argc, argv, [&] {
    request.say = [](const std::string& line) {
      fmt::print("{}\n", line);
      std::fflush(stdout);
    };
    const std::string report = torquer::hil::BoardReport(request);
    fmt::print("\n{}\n", report);
    torquer::WriteFileAtomically(output, report);
    fmt::print("written to {}\n", output);
    return static_cast<int>(torquer::kExitSuccess);
  });
}
