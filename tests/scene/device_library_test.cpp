// Devices of host/devices: their sources' figures give their rigidities, and a scene uses their
// values.
#include "host/simulator/scene/device_library.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using namespace torquer::scene;
using Kind = DeviceSpec::Kind;

namespace {

constexpr double kMmPerInch = 25.4;

// EI from a source's figures, by the textbook formula.
double RigidityOf(const DeviceSource& source) {
  if (source.measured_N_mm2) return *source.measured_N_mm2;
  if (source.flexural_modulus_GPa) {
    const double outer_mm = *source.outer_diameter_mm / 2;
    const double inner_mm = source.inner_diameter_mm / 2;
    return 1e3 * *source.flexural_modulus_GPa * std::numbers::pi / 4 *
           (std::pow(outer_mm, 4) - std::pow(inner_mm, 4));
  }
  if (source.span_mm) {
    // A beam on two supports sinks by F L^3 / (48 EI) at its middle.
    return *source.force_N * std::pow(*source.span_mm, 3) / (48 * *source.deflection_mm);
  }
  // Clamped at one end, pinned at the other: the first root of tan x = x is 4.4934.
  const double force_N = 9.80665e-3 * *source.tip_load_gf;
  return force_N * std::pow(*source.free_length_mm / 4.493409458, 2);
}

double RigidityAt(const InstrumentSpec& spec, double from_tip_mm) {
  const auto sections = MakeSections(spec);
  double last_s = 0;
  double last = sections.front().rigidity_N_mm2;
  for (const auto& section : sections) {
    if (section.from_tip_mm >= from_tip_mm) {
      const double width = section.from_tip_mm - last_s;
      if (width <= 0) return section.rigidity_N_mm2;
      const double t = (from_tip_mm - last_s) / width;
      return last + t * (section.rigidity_N_mm2 - last);
    }
    last_s = section.from_tip_mm;
    last = section.rigidity_N_mm2;
  }
  return last;
}

std::string LibraryRefusal(const std::string& text) {
  try {
    ParseScene(text, "small.toml", {});
  } catch (const torquer::UserError& error) {
    return error.what();
  }
  return "";
}

const std::string kLibraryCatheter =
    "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ndevice = \"microcatheter_2_7f\"\n";

}  // namespace

TEST_CASE("The rigidity of every device follows from the figures of its sources", "[scene]") {
  int guidewires = 0;
  int catheters = 0;
  double thinnest_mm = 10;
  double thickest_mm = 0;
  for (const std::string& name : DeviceNames()) {
    INFO(name);
    const DeviceSpec device = ReadDevice(name);
    (device.kind == Kind::kWire ? guidewires : catheters) += 1;
    for (const DeviceSource& source : device.sources) {
      INFO(source.citation << ": " << source.figure);
      // Files store three digits.
      CHECK(RigidityAt(device.instrument, source.from_tip_mm) ==
            Approx(RigidityOf(source)).epsilon(0.006));
      if (!source.outer_diameter_mm) continue;
      const double diameter_mm = 2 * device.instrument.radius_mm.back();
      // The core of a wire may be thinner than its jacket.
      const bool core = device.kind == Kind::kWire && *source.outer_diameter_mm < diameter_mm;
      CHECK((core || diameter_mm == Approx(*source.outer_diameter_mm)));
      CHECK(2 * device.instrument.inner_radius_mm == Approx(source.inner_diameter_mm));
    }
    if (device.kind == Kind::kWire) {
      thinnest_mm = std::min(thinnest_mm, 2 * OuterRadius(device.instrument));
      thickest_mm = std::max(thickest_mm, 2 * OuterRadius(device.instrument));
    }
  }
  CHECK(guidewires >= 10);
  CHECK(catheters >= 5);
  CHECK(thinnest_mm == Approx(0.014 * kMmPerInch));
  CHECK(thickest_mm == Approx(0.038 * kMmPerInch));
}

TEST_CASE("An instrument has the values of its device, except those in the scene", "[scene]") {
  const DeviceSpec device = ReadDevice("microcatheter_2_7f");
  const auto read = [](const std::string& more) {
    return ParseScene(torquer::test::SceneText(kLibraryCatheter + more), "small.toml", {});
  };
  const SceneSpec plain = read("");
  CHECK(plain.instruments[1].rigidity_N_mm2 == device.instrument.rigidity_N_mm2);
  CHECK(plain.instruments[1].from_tip_mm == device.instrument.from_tip_mm);
  CHECK(plain.instruments[1].inner_radius_mm == device.instrument.inner_radius_mm);
  // Linear density is back at its default value, which the writer must still write.
  const SceneSpec other = read("rigidity_N_mm2 = 3\nlinear_density_g_m = 0\n");
  CHECK(other.instruments[1].rigidity_N_mm2 == std::vector<double>{3});
  CHECK(other.instruments[1].radius_mm == device.instrument.radius_mm);
  for (const SceneSpec& spec : {plain, other}) {
    const std::string written = WriteScene(spec);
    CHECK_THAT(written, Contains("device = \"microcatheter_2_7f\"\n") && !Contains("inner_radius"));
    const SceneSpec again = ParseScene(written, "again", {});
    CHECK(WriteScene(again) == written);
    CHECK(again.instruments[1].linear_density_g_m == spec.instruments[1].linear_density_g_m);
    CHECK(again.instruments[1].rigidity_N_mm2 == spec.instruments[1].rigidity_N_mm2);
  }
  CHECK(Scene(plain).content_hash() != Scene(other).content_hash());
}

TEST_CASE("A scene cannot bend the tip of a device that is bent already", "[scene]") {
  const auto scene = [](const std::string& more) {
    return torquer::test::SceneText(
        "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\n"
        "device = \"diagnostic_5f_cobra_2\"\n" +
        more);
  };
  CHECK_THAT(LibraryRefusal(scene("tip_mm = 10\ntip_angle_deg = 30\n")),
             Contains("instrument[1].tip_angle_deg = 30") &&
                 Contains("which the device diagnostic_5f_cobra_2 bends too"));
  const SceneSpec straight = ParseScene(
      scene("tip_mm = 10\ntip_angle_deg = 30\ncurvature_1_per_mm = 0\n"), "small.toml", {});
  CHECK(straight.instruments[1].curvature_1_per_mm == std::vector<double>{0});
}

TEST_CASE("An unknown device is refused with the known ones", "[scene]") {
  const auto scene = [](const std::string& device) {
    return torquer::test::SceneText(
        "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninner_radius_mm = 0.3\n"
        "device = \"" +
        device + "\"\n");
  };
  CHECK_THAT(LibraryRefusal(scene("microcatheter_2_7")),
             Contains("small.toml:") && Contains("instrument[1].device = 'microcatheter_2_7'") &&
                 Contains("did you mean \"microcatheter_2_7f\"?") && Contains("sion_blue"));
  CHECK_THAT(LibraryRefusal(scene("../scenes/coronary")), Contains("there is no such device"));
  CHECK_THAT(LibraryRefusal(torquer::test::SceneText(
                 "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\n")),
             Contains("instrument[1].rigidity_N_mm2: is missing; give it, or a device"));
  CHECK_THAT(LibraryRefusal(torquer::test::SceneText(kLibraryCatheter + "from_tip_mm = [0, 10]\n")),
             Contains("instrument[1].rigidity_N_mm2") && Contains("has 4 values"));
}
