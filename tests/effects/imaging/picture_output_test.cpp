// Picture output of the simulator: files and messages.
#include <png.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <cstdio>
#include <filesystem>
#include <random>
#include <thread>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/picture_t.hpp>
// Must follow <cstdio>, which it needs and does not include.
#include <jpeglib.h>

#include "host/bus/clock.h"
#include "host/simulator/jpeg_encoder.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/picture_thread.h"
#include "host/simulator/program/script_run.h"
#include "protocol/lcm_channels.h"
#include "tests/effects/vascular_scene.h"
#include "tests/support/private_network.h"

using Catch::Contains;
using torquer::effects::ImageSource;
using torquer::simulator::JpegEncoder;
using torquer::simulator::kMostPictureBytes;
using torquer::test::kFork;
using torquer::test::SceneOf;

namespace {

const std::string kSmallXray = "[effects.fluoroscopy]\nwidth_px = 96\nheight_px = 64\n";
constexpr char kHeader[] =
    "time_s,guidewire.insertion_mm,guidewire.rotation_rad,lao_deg,cra_deg,xray,contrast\n";

void Write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

// Runs the script beside a scene; its pictures go into a folder beside it.
torquer::program::ScriptResult Render(const SceneOf& scene) {
  return torquer::program::RunScript(torquer::Scene::FromFile(scene.Beside("test.toml")),
                                     scene.Beside("s.csv"), {.pictures = scene.Beside("out")});
}

std::vector<std::uint8_t> ReadPng(const std::string& path, int& width, int& height) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&image, path.c_str()) != 0);
  image.format = PNG_FORMAT_GRAY;
  std::vector<std::uint8_t> gray(PNG_IMAGE_SIZE(image));
  REQUIRE(png_image_finish_read(&image, nullptr, gray.data(), 0, nullptr) != 0);
  width = static_cast<int>(image.width);
  height = static_cast<int>(image.height);
  return gray;
}

std::vector<std::uint8_t> DecodeJpeg(const std::vector<std::uint8_t>& bytes) {
  jpeg_decompress_struct decompress{};
  jpeg_error_mgr errors{};
  decompress.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&decompress);
  jpeg_mem_src(&decompress, bytes.data(), bytes.size());
  jpeg_read_header(&decompress, TRUE);
  jpeg_start_decompress(&decompress);
  std::vector<std::uint8_t> gray(static_cast<std::size_t>(decompress.output_width) *
                                 decompress.output_height);
  while (decompress.output_scanline < decompress.output_height) {
    std::uint8_t* row =
        &gray[static_cast<std::size_t>(decompress.output_scanline) * decompress.output_width];
    jpeg_read_scanlines(&decompress, &row, 1);
  }
  jpeg_finish_decompress(&decompress);
  jpeg_destroy_decompress(&decompress);
  return gray;
}

}  // namespace

TEST_CASE("A script renders the pictures that its pedal takes", "[effects]") {
  SceneOf scene(kFork + kSmallXray + "pictures_per_s = 10\n");
  Write(scene.Beside("s.csv"), std::string(kHeader) +
                                   "0,0,0,0,0,0,0\n0.1,0,0,0,0,1,0\n0.2,0,0,0,0,1,0\n"
                                   "0.3,0,0,40,10,1,0\n0.4,0,0,40,10,0,0\n");
  CHECK(Render(scene).unconverged == 0);
  int width = 0;
  int height = 0;
  const auto first = ReadPng(scene.Beside("out/picture_000001.png"), width, height);
  CHECK(width == 96);
  CHECK(height == 64);
  CHECK(ReadPng(scene.Beside("out/picture_000003.png"), width, height) != first);
  CHECK_FALSE(std::filesystem::exists(scene.Beside("out/picture_000004.png")));
  CHECK_FALSE(std::filesystem::exists(scene.Beside("s.jsonl")));
}

TEST_CASE("The columns of the C-arm are checked", "[effects]") {
  SceneOf scene(kFork + kSmallXray);
  const auto refuse = [&](const std::string& text, const std::string& said) {
    Write(scene.Beside("s.csv"), text);
    CHECK_THROWS_WITH(Render(scene), Contains(said));
    CHECK_FALSE(std::filesystem::exists(scene.Beside("out")));
  };
  refuse(std::string(kHeader) + "0,0,0,200,0,1,0\n", "s.csv:2: lao_deg is '200'");
  refuse(std::string(kHeader) + "0,0,0,0,-181,1,0\n", "s.csv:2: cra_deg is '-181'");
  refuse(std::string(kHeader) + "0,0,0,0,0,2,0\n", "s.csv:2: xray is '2'; give 0 or 1");
  refuse(std::string(kHeader) + "0,0,0,0,0,1,yes\n", "s.csv:2: contrast is 'yes'");
  refuse("time_s,guidewire.insertion_mm,guidewire.rotation_rad,lao\n", "s.csv:1");
}

TEST_CASE("A scene without fluoroscopy has no picture", "[effects]") {
  SceneOf scene(kFork);
  Write(scene.Beside("s.csv"), "time_s,guidewire.insertion_mm,guidewire.rotation_rad\n0,0,0\n");
  CHECK_THROWS_WITH(Render(scene), Contains("[effects.fluoroscopy]"));
}

TEST_CASE("A picture of any content fits a message", "[effects]") {
  JpegEncoder encoder;
  ImageSource::Picture picture;
  picture.width = picture.height = 1024;
  std::mt19937 random(1);
  std::uniform_int_distribution<int> any(0, 255);
  picture.gray.resize(1024UL * 1024UL);
  for (std::uint8_t& gray : picture.gray) gray = static_cast<std::uint8_t>(any(random));
  CHECK(encoder.Encode(picture, kMostPictureBytes).bytes.size() <= kMostPictureBytes);
  CHECK(encoder.Encode(picture, kMostPictureBytes).width == 512);
  // A smooth picture keeps its resolution, and soon regains full quality.
  for (std::size_t i = 0; i < picture.gray.size(); ++i) {
    picture.gray[i] = static_cast<std::uint8_t>(i % 1024 / 4);
  }
  for (int k = 0; k < 20; ++k) encoder.Encode(picture, kMostPictureBytes);
  const std::vector<std::uint8_t> back =
      DecodeJpeg(encoder.Encode(picture, kMostPictureBytes).bytes);
  REQUIRE(back.size() == picture.gray.size());
  int worst = 0;
  for (std::size_t i = 0; i < back.size(); ++i) {
    worst =
        std::max(worst, std::abs(static_cast<int>(back[i]) - static_cast<int>(picture.gray[i])));
  }
  CHECK(worst <= 4);
}

TEST_CASE("Live, pictures are published while the pedal is down, then held", "[effects]") {
  torquer::test::NeedPrivateNetwork();
  SceneOf scene(kFork + kSmallXray + "pictures_per_s = 20\n");
  torquer::simulator::ExchangeableSimulation session(*scene);
  torquer::bus::Bus simulator_bus;
  torquer::bus::Bus hand_bus;
  std::vector<torquer_lcm::picture_t> pictures;
  hand_bus.Subscribe<torquer_lcm::picture_t>(
      torquer::protocol::kPictureChannel,
      [&](const torquer_lcm::picture_t& picture) { pictures.push_back(picture); }, 0);
  std::atomic<bool> stop{false};
  std::thread simulator([&] { torquer::simulator::RunLive(session, simulator_bus, stop); });
  torquer_lcm::instrument_command_t command{};
  command.instrument = torquer::protocol::kGuidewire;
  command.clock_id = torquer::bus::ClockId();
  command.lao_rad = 0.5;
  const auto run_until = [&](bool xray, auto&& done) {
    command.xray = static_cast<std::int8_t>(xray);
    for (int k = 0; k < 1000 && !done(); ++k) {
      ++command.sequence;
      command.origin_us = command.publish_us = torquer::bus::MonotonicUs();
      hand_bus.Publish(torquer::protocol::kInstrumentCommandChannel, command);
      hand_bus.Handle(10);
    }
    CHECK(done());
  };
  run_until(true, [&] { return pictures.size() >= 3; });
  run_until(false, [&] { return pictures.back().held != 0; });
  const torquer_lcm::picture_t held = pictures.back();
  const torquer_lcm::picture_t before = pictures[pictures.size() - 2];
  stop = true;
  simulator.join();
  CHECK(held.number == before.number);
  CHECK(held.data == before.data);
  CHECK(held.width == 96);
  CHECK(held.height == 64);
  CHECK(held.lao_rad == 0.5);
  CHECK(held.encoding == "jpeg");
  CHECK(held.clock_id == torquer::bus::ClockId());
  CHECK(DecodeJpeg(held.data).size() == 96 * 64);
  CHECK(pictures[1].number == pictures[0].number + 1);
}
