// torquer-calibrate --focus with the firmware's image in the emulator, and the display of a
// picture.
#include <png.h>

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>

#include "host/emulator/emulator_run.h"
#include "host/tools/focus_picture.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::calibration::FocusPicture;
using torquer::calibration::kFocusPixels;
using torquer::calibration::kFocusSide;
using torquer::emulator::RunOptions;
using torquer::test::ChildProcess;
using torquer::test::Contents;

// Dark on the left, bright on the right, one dark pixel in the first row.
FocusPicture Ramp() {
  FocusPicture picture(kFocusPixels);
  for (int i = 0; i < kFocusPixels; ++i) {
    picture[static_cast<std::size_t>(i)] =
        static_cast<std::uint8_t>(i % kFocusSide * 127 / (kFocusSide - 1));
  }
  picture[kFocusSide - 1] = 0;
  return picture;
}

// Gray values of a PNG file of kFocusSide x kFocusSide blocks, and its width.
std::vector<std::uint8_t> ReadPng(const std::string& file, int* width) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_memory(&image, file.data(), file.size()) != 0);
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> points(PNG_IMAGE_SIZE(image));
  REQUIRE(png_image_finish_read(&image, nullptr, points.data(), 0, nullptr) != 0);
  *width = static_cast<int>(image.width);
  CHECK(image.height == image.width);
  return points;
}

class Bench {
 public:
  explicit Bench(RunOptions options = {}) {
    std::ofstream(folder_.Path("motion.csv"))
        << "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons\n0,0,0,0,0,\n"
           "60,120,18,0,0,\n";
    options.firmware = torquer::test::FirmwarePath("torquer-firmware.elf");
    options.motion = folder_.Path("motion.csv");
    options.socket = folder_.Path("socket");
    options.use_lcm = false;
    run_.emplace(options);
    thread_ = std::thread([this] { violations = run_->Run(stop_).violations; });
  }
  ~Bench() { Stop(); }
  void Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  int Focus(const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{torquer::test::ProgramPath("torquer-calibrate"),
                                   "--focus",
                                   "--source",
                                   "socket",
                                   "--socket",
                                   folder_.Path("socket"),
                                   "--picture",
                                   folder_.Path("picture.png")};
    words.insert(words.end(), more.begin(), more.end());
    ChildProcess program(words);
    const int status = program.Wait();
    said = program.Output() + program.Error();
    return status;
  }
  std::string Picture() const { return Contents(folder_.Path("picture.png")); }

  std::string said;
  std::int64_t violations = 0;

 private:
  torquer::test::TemporaryFolder folder_;
  std::atomic<bool> stop_ = false;
  std::optional<torquer::emulator::EmulatorRun> run_;
  std::thread thread_;
};

}  // namespace

TEST_CASE("A picture is shown as characters, as shades of gray, and as PNG") {
  const std::string text = torquer::tools::FocusText(Ramp(), false);
  REQUIRE(text.size() == (kFocusSide + 1) * kFocusSide / 2);
  CHECK(std::count(text.begin(), text.end(), '\n') == kFocusSide / 2);
  const std::string second = text.substr(kFocusSide + 1, kFocusSide);
  CHECK(second.front() == ' ');
  CHECK(second.back() == '@');
  CHECK(second[kFocusSide / 2] == '=');
  CHECK(text[kFocusSide - 1] != '@');  // half of this cell is dark

  const std::string gray = torquer::tools::FocusText(Ramp(), true);
  CHECK_THAT(gray, Contains("\033[38;5;232;48;5;232m\u2580"));  // black over black
  CHECK_THAT(gray, Contains("\033[38;5;232;48;5;255m\u2580\033[0m\n"));
  CHECK_THAT(gray, Contains("\033[38;5;255;48;5;255m\u2580\033[0m\n"));

  int width = 0;
  const std::vector<std::uint8_t> points = ReadPng(torquer::tools::FocusPng(Ramp()), &width);
  REQUIRE(width == 10 * kFocusSide);
  const auto at = [&](int x, int y) { return points[static_cast<std::size_t>(y * width + x)]; };
  CHECK(at(0, 0) == 0);
  CHECK(at(width - 1, 9) == 0);
  CHECK(at(width - 1, 10) == 255);
  CHECK(at(width / 2, width - 1) == Approx(127.5).margin(8));
}

TEST_CASE("The view approves a good assembly, and keeps the picture") {
  Bench bench;
  const int status = bench.Focus();
  CAPTURE(bench.said);
  CHECK(status == 0);
  CHECK_THAT(bench.said,
             Contains("surface 64") && Contains("Clean and evenly lit across the pipe"));
  int width = 0;
  const std::vector<std::uint8_t> points = ReadPng(bench.Picture(), &width);
  CHECK(width == 360);
  const auto [darkest, brightest] = std::minmax_element(points.begin(), points.end());
  CHECK(*brightest - *darkest > 60);
  bench.Stop();
  CHECK(bench.violations == 0);
}

TEST_CASE("The view names the problems of an assembly") {
  RunOptions options;
  std::string wanted;
  SECTION("light falls from the side") {
    options.bench.optics.side_shading = 1.7;
    wanted = "across the pipe";
  }
  SECTION("glue on the lens") {
    options.bench.optics.dirt = 0.2;
    wanted = "clean lens and window";
  }
  Bench bench(options);
  const int status = bench.Focus();
  CAPTURE(bench.said);
  CHECK(status == 1);
  CHECK_THAT(bench.said, Contains(wanted) && !Contains("evenly lit"));
}

TEST_CASE("The focus is sought over the shims, from run to run") {
  torquer::test::TemporaryFolder kept;
  const std::string file = kept.Path("heights.csv");
  // The carrier is in focus with shims of 0.4 mm.
  const auto look = [&](double shims_mm, int wanted, const std::string& says) {
    RunOptions options;
    options.bench.optics.distance_mm = 2.0 + shims_mm;
    Bench bench(options);
    const int status = bench.Focus({"--shims", std::to_string(shims_mm), "--heights", file});
    CAPTURE(bench.said);
    CHECK(status == wanted);
    CHECK_THAT(bench.said, Contains(says));
  };
  look(0.2, 1, "with more and with less too");
  look(0.6, 1, "take a picture");
  look(0.4, 0, "In focus");
  const std::string rows = Contents(file);
  CHECK(std::count(rows.begin(), rows.end(), '\n') == 4);

  Bench bench;
  CHECK(bench.Focus({"--shims", "0.4"}) == 2);
  CHECK_THAT(bench.said, Contains("--shims and --heights go together"));
  std::ofstream(file) << "shims_mm,sharpness\n0.2,dull\n";
  CHECK(bench.Focus({"--shims", "0.4", "--heights", file}) == 2);
  CHECK_THAT(bench.said, Contains("heights.csv:2") && Contains("dull"));
  CHECK(Contents(file) == "shims_mm,sharpness\n0.2,dull\n");
}

TEST_CASE("Without a picture the view reports the reason, and keeps none") {
  RunOptions options;
  options.faults.push_back({0, 1e5});
  Bench bench(options);
  CHECK(bench.Focus() == 2);
  CHECK_THAT(bench.said, Contains("its sensor does not answer"));
  CHECK(bench.Picture().empty());

  CHECK(bench.Focus({"--source", "evdev"}) == 2);  // given twice
  ChildProcess mouse({torquer::test::ProgramPath("torquer-calibrate"), "--focus", "--source",
                      "evdev", "--device", "/dev/null"});
  CHECK(mouse.Wait() == 2);
  CHECK_THAT(mouse.Error(), Contains("an ordinary mouse shows no picture"));
  ChildProcess alone({torquer::test::ProgramPath("torquer-calibrate"), "--picture", "a.png"});
  CHECK(alone.Wait() == 2);
  CHECK_THAT(alone.Error(), Contains("--picture goes with --focus"));
}
