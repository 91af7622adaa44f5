// Scenes whose body is a scan: keys, contents, and pictures that repeat.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "host/simulator/effects/imaging/ct_carving.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/effects/imaging/lateral_plane.h"
#include "host/simulator/simulation.h"
#include "host/support/angles.h"
#include "tests/effects/vascular_scene.h"
#include "tests/support/ct_phantom.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using Eigen::Vector3d;
using torquer::effects::CtVolume;
using torquer::effects::Fluoroscopy;
using torquer::effects::ImageSource;
using torquer::effects::LateralPlane;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::Refusal;
using torquer::test::ScanOf;
using torquer::test::SceneOf;
using torquer::test::ShareAt;
using torquer::test::TemporaryFolder;
using torquer::test::WriteMeta;

namespace {

// A trunk of tissue about the vessel of kStraight, with a bone above it and agent in the vessel.
CtVolume Trunk() {
  return ScanOf({44, 28, 28}, 5, Vector3d(-8, -65, -65), [](const Vector3d& at) {
    const double from_axis = at.tail<2>().norm();
    double hu = -1000 + 1050 * ShareAt(60 - from_axis, 5);
    hu += 700 * ShareAt(8 - (at.tail<2>() - Eigen::Vector2d(0, 25)).norm(), 5);
    return hu + 300 * ShareAt(2 - from_axis, 5);
  });
}

std::string WithScan(const std::string& path, const std::string& more = "") {
  return kStraight +
         "[patient_axes]\nleft = \"+y\"\nposterior = \"+z\"\nsuperior = \"+x\"\n"
         "[effects.fluoroscopy]\nbody = \"ct\"\nct_file = \"" +
         path + "\"\nwidth_px = 256\nheight_px = 256\n" + more;
}

// The file has the axes of the patient: +x of the vessel is superior.
std::string WriteTrunk(const TemporaryFolder& folder, std::int16_t first_value = -1000) {
  CtVolume trunk = Trunk();
  trunk.values.front() = first_value;
  std::string header = torquer::test::MetaHeader(trunk);
  const std::string straight = "1 0 0 0 1 0 0 0 1";
  header.replace(header.find(straight), straight.size(), "0 0 1 1 0 0 0 1 0");
  header.replace(header.find("-8 -65 -65"), 10, "-65 -65 -8");
  std::string path = folder.Path("trunk.mha");
  std::ofstream(path, std::ios::binary) << header << torquer::test::BytesOf(trunk);
  return path;
}

Command WithPedal(double time_s, double lao_rad) {
  Command command;
  command.target[0].insertion_mm = 40;
  command.time_s = time_s;
  command.controls.xray = true;
  command.controls.lao_rad = lao_rad;
  return command;
}

// The last picture of a session whose C-arm turns, rests, and turns away and back for one picture.
// `rendered` decides by number which pictures are rendered.
std::vector<std::uint8_t> LastPicture(torquer::scene::Scene& scene, bool (*rendered)(int)) {
  Simulation session(scene);
  ImageSource::Picture picture;
  constexpr int kPictures = 12;
  for (int n = 0; n < kPictures; ++n) {
    torquer::CountedBudget budget(100);
    session.Tick(WithPedal(0.001 + n / 15.0, n < 2 ? 0.1 * n : n == 7 ? 0.3 : 0.2), budget);
    REQUIRE(session.picture_due());
    if (rendered(n)) session.image()->Render(picture);
  }
  return picture.gray;
}

}  // namespace

TEST_CASE("Pictures of a scan repeat, also if some are dropped", "[effects]") {
  const TemporaryFolder folder;
  SceneOf scene(WithScan(WriteTrunk(folder)));
  const auto all = LastPicture(*scene, [](int) { return true; });
  CHECK(LastPicture(*scene, [](int) { return true; }) == all);
  CHECK(LastPicture(*scene, [](int n) { return n != 7; }) == all);
  CHECK(LastPicture(*scene, [](int n) { return n == 11; }) == all);
  CHECK(LastPicture(*scene, [](int n) { return n == 6 || n == 11; }) == all);
}

TEST_CASE("A subtracted picture of a scan is even while the scan gets finer", "[effects]") {
  const TemporaryFolder folder;
  SceneOf scene(WithScan(WriteTrunk(folder), "mode = \"subtraction\"\nphotons = 10000000\n"));
  const std::vector<std::uint8_t> gray = LastPicture(*scene, [](int) { return true; });
  const auto [least, most] = std::minmax_element(gray.begin(), gray.end());
  CHECK(*most - *least <= 2);
}

TEST_CASE("A vessel that moves leaves no trace in the picture of a scan", "[effects]") {
  const TemporaryFolder folder;
  const std::string breath =
      "[effects.breathing]\namplitude_mm = 8\ndirection = [0, 1, 0]\n"
      "[[effects.breathing.region]]\ncenter_mm = [100, 0, 0]\nradius_mm = 80\n";
  std::string text = WithScan(WriteTrunk(folder));
  const std::string wire = "radius_mm = 0.3\n";
  text.insert(text.find(wire) + wire.size(), "attenuation_1_mm = 0\n");
  SceneOf resting(text);
  SceneOf moving(text + breath);
  CHECK(LastPicture(*moving, [](int) { return true; }) ==
        LastPicture(*resting, [](int) { return true; }));
}

TEST_CASE("The body in the picture is the scan, with blood in the lumen", "[effects]") {
  const TemporaryFolder folder;
  SceneOf scene(WithScan(WriteTrunk(folder)));
  const auto& xray = scene.Get<Fluoroscopy>();
  const torquer::effects::CtBody& body = *xray.settings().scan;
  const auto& settings = xray.settings();
  const auto integral = [&](double lao_rad) {
    return settings.scan->MiddleIntegral(torquer::effects::Projection(settings.arm, lao_rad, 0));
  };
  // Through 120 mm of tissue and, along posterior, through 16 mm of bone.
  const torquer::effects::CtAttenuation of(60, 70);
  const double tissue = 120 * of.Of(50);
  CHECK(integral(torquer::kRadPerDeg * 90) == Approx(tissue).epsilon(0.01));
  CHECK(integral(0) == Approx(tissue + 16 * (of.Of(750) - of.Of(50))).epsilon(0.03));
  CHECK(body.tissue_1_mm() == Approx(of.Of(50)));
}

TEST_CASE("A scan is a part of the scene's contents, and twins share it", "[effects]") {
  const TemporaryFolder folder;
  const std::string text = WithScan(WriteTrunk(folder), "[effects.lateral_plane]\n");
  SceneOf scene(text);
  const auto* const scan = scene.Get<Fluoroscopy>().settings().scan.get();
  CHECK(scene.Get<LateralPlane>().plane().settings().scan.get() == scan);
  const auto twin = (*scene).MakeTwin();
  CHECK(twin->content_hash() == scene->content_hash());
  const torquer::scene::Scene stiffer(With(scene->spec(), {{"vessel.wall_stiffness_N_mm2", 2.0}}),
                                      *scene);
  const torquer::scene::Scene other_energy(
      With(scene->spec(), {{"effects.fluoroscopy.energy_keV", 80.0}}), *scene);
  const auto scan_of = [](const torquer::scene::Scene& other) {
    return dynamic_cast<const Fluoroscopy&>(*other.effects().front()).settings().scan.get();
  };
  CHECK(scan_of(*twin) == scan);
  CHECK(scan_of(stiffer) == scan);
  CHECK(scan_of(other_energy) != scan);
  const std::uint64_t hash = scene->content_hash();
  CHECK(torquer::scene::Scene(scene->spec()).content_hash() == hash);
  WriteTrunk(folder, -999);
  CHECK(torquer::scene::Scene(scene->spec()).content_hash() != hash);
}

TEST_CASE("The exposure follows the thickness of a scan", "[effects]") {
  const TemporaryFolder folder;
  const std::string path = WriteTrunk(folder);
  SceneOf thin(WithScan(path));
  Simulation session(*thin);
  torquer::CountedBudget budget(100);
  session.Tick(WithPedal(0.001, torquer::kRadPerDeg * 90), budget);
  // 120 mm of tissue instead of 200 mm, at 600 mm from the source.
  const torquer::effects::CtAttenuation of(60, 70);
  const double expected = 0.06 * 10 * 8e-3 / 0.36 * std::exp(-80 * of.Of(50));
  CHECK(Reading(session, "air_kerma_mGy") == Approx(expected).epsilon(0.03));
}

TEST_CASE("Keys of a scan that do not fit are refused", "[effects]") {
  const TemporaryFolder folder;
  const std::string path = WriteTrunk(folder);
  const std::string xray = "[effects.fluoroscopy]\n";
  CHECK_THAT(Refusal(kStraight + xray + "body = \"ct\"\n"), Contains("needs ct_file"));
  CHECK_THAT(Refusal(kStraight + xray + "ct_file = \"a.mha\"\n"), Contains("is for body = \"ct\""));
  CHECK_THAT(Refusal(kStraight + xray + "ct_keV = 70\n"), Contains("is for body = \"ct\""));
  CHECK_THAT(Refusal(WithScan(path, "body_width_mm = 300\n")), Contains("is for body = \"model\""));
  CHECK_THAT(Refusal(WithScan(path, "body_region = \"heart\"\n")),
             Contains("is for body = \"model\""));
  CHECK_THAT(Refusal(WithScan(folder.Path("none.mha"))),
             Contains("ct_file") && Contains("No such file"));
  CtVolume elsewhere = Trunk();
  elsewhere.first_mm[1] += 5000;
  WriteMeta(folder.Path("far.mha"), elsewhere);
  CHECK_THAT(Refusal(WithScan(folder.Path("far.mha"))),
             Contains("outside the scan") && Contains("patient_axes"));
}
