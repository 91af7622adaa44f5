#include "host/simulator/vessel/centerline.h"

#include <sys/stat.h>

#include <cmath>
#include <ctime>
#include <fstream>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/lumen_check.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::Vector3d;
using test::TemporaryFolder;

Centerline Circle(double radius_mm, int points) {
  std::vector<Vector3d> at;
  std::vector<double> radii;
  for (int i = 0; i <= points; ++i) {
    const double angle = M_PI * i / points;
    at.emplace_back(radius_mm * std::cos(angle), radius_mm * std::sin(angle), 0);
    radii.push_back(2 + i);
  }
  return Centerline("half circle", at, radii);
}

Centerline Straight(const std::string& name, const Vector3d& from, const Vector3d& to) {
  return Centerline(name, {from, (from + to) / 2, to}, {1, 1, 1});
}

TEST_CASE("a curve is followed by arc length, with unit tangents") {
  const Centerline curve = Circle(30, 24);
  CHECK(curve.length_mm() == Approx(M_PI * 30).epsilon(1e-4));
  Vector3d before = curve.At(0).position_mm;
  for (int i = 1; i <= 1000; ++i) {
    const double s = curve.length_mm() * i / 1000;
    const CenterlineSample at = curve.At(s);
    CHECK((at.position_mm - before).norm() == Approx(curve.length_mm() / 1000).epsilon(2e-4));
    CHECK(at.position_mm.norm() == Approx(30).epsilon(2e-4));
    CHECK(at.tangent.norm() == Approx(1));
    CHECK(at.tangent.dot(at.position_mm) / 30 == Approx(0).margin(0.02));
    before = at.position_mm;
  }
  CHECK(curve.At(0).radius_mm == 2);
  CHECK(curve.At(1e9).radius_mm == 26);
  CHECK(curve.At(-5).position_mm == curve.At(0).position_mm);
  CHECK(curve.NearestTo({0, 50, 0}).s_mm == Approx(M_PI * 15).epsilon(1e-3));
  CHECK(curve.NearestTo({0, 50, 0}).distance_mm == Approx(20).epsilon(1e-3));
}

TEST_CASE("a curve's tangent is continuous across its points") {
  const Centerline curve("zigzag", {{0, 0, 0}, {10, 3, 0}, {18, -2, 5}, {30, 0, 0}}, {1, 1, 1, 1});
  for (const double s : curve.arc_lengths_mm()) {
    CHECK((curve.At(s - 1e-7).tangent - curve.At(s + 1e-7).tangent).norm() < 1e-5);
  }
}

TEST_CASE("a part of a curve runs where the curve runs, backward too") {
  const Centerline curve = Circle(30, 24);
  const Centerline part = curve.Part(70, 20, "back");
  CHECK(part.length_mm() == Approx(50).epsilon(1e-4));
  CHECK((part.At(0).position_mm - curve.At(70).position_mm).norm() < 1e-9);
  CHECK((part.At(10).position_mm - curve.At(60).position_mm).norm() < 1e-3);
  CHECK((part.At(10).tangent + curve.At(60).tangent).norm() < 1e-3);
}

TEST_CASE("curves join where an end meets another curve, and ways lead over the joints") {
  const CenterlineNetwork network(
      {Straight("trunk", {0, 0, 0}, {100, 0, 0}), Straight("branch", {60, 0, 0}, {60, 50, 0}),
       Straight("twig", {60, 90, 0}, {60, 50.2, 0}), Straight("stray", {0, 0, 500}, {50, 0, 500})});
  REQUIRE(network.joints().size() == 2);
  const Centerline way = network.Path(network.Place("trunk", 10.0), network.Place("twig", "start"));
  CHECK(way.length_mm() == Approx(140).margin(3));
  CHECK((way.At(0).position_mm - Vector3d(10, 0, 0)).norm() < 1e-9);
  CHECK((way.At(1e9).position_mm - Vector3d(60, 90, 0)).norm() < 1e-9);
  CHECK(network.Path(network.Place("trunk", 80.0), network.Place("trunk", 30.0)).length_mm() ==
        Approx(50));
  CHECK_THROWS_WITH(network.Path(network.Place("trunk", 0.0), network.Place("stray", "end")),
                    Contains("trunk") && Contains("stray") && Contains("do not meet"));
  CHECK_THROWS_WITH(network.Place("trunk", 101.0), Contains("101") && Contains("0 to 100"));
  CHECK_THROWS_WITH(network.Place("trunk", "middle"), Contains("\"start\" or \"end\""));
  CHECK_THROWS_WITH(network.Find("trnk"), Contains("trnk") && Contains("\"trunk\""));
  double distance = 0;
  CHECK(network.NearestTo({61, 20, 0}, &distance).curve == 1);
  CHECK(distance == Approx(1));
}

TEST_CASE("more centerlines than a vessel can have are refused") {
  std::vector<Centerline> curves;
  for (int k = 0; k < 1000; ++k) {
    curves.push_back(Straight("c" + std::to_string(k), {0, 9.0 * k, 0}, {40, 9.0 * k, 0}));
  }
  CHECK(CenterlineNetwork(curves).joints().empty());
  curves.push_back(Straight("more", {0, -9, 0}, {1, -9, 0}));
  CHECK_THROWS_WITH(CenterlineNetwork(curves), Contains("1001 centerlines of 40001 mm in all") &&
                                                   Contains("at most 1000 of 50000 mm"));
  CHECK_THROWS_WITH(CenterlineNetwork({Straight("long", {0, 0, 0}, {50'001, 0, 0})}),
                    Contains("1 centerlines of 50001 mm") && Contains("check their unit"));

  const TemporaryFolder folder;
  for (int k = 0; k <= 1000; ++k) std::ofstream(folder.Path(std::to_string(k) + ".mrk.json"));
  CHECK_THROWS_WITH(ReadCurveFiles(folder.Path("")),
                    Contains(folder.Path("")) && Contains("1001 .mrk.json files"));
}

TEST_CASE("a name as long as a file is looked for as soon as a short one") {
  const std::string name(50'000, 'a'), other(50'000, 'b');
  const CenterlineNetwork network({Straight(name, {0, 0, 0}, {50, 0, 0})});
  const std::clock_t before = std::clock();
  CHECK_THROWS_WITH(network.Find(other), Contains(other.substr(0, 400)) &&
                                             Contains(name.substr(0, 400)) &&
                                             !Contains(other.substr(0, 600)));
  CHECK(std::clock() - before < CLOCKS_PER_SEC);
}

TEST_CASE("the neuro arch's centerlines form one network from groin to neck") {
  const CenterlineNetwork network = ParseSlicerCurves(
      ReadCurveFiles(torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/centerlines")));
  CHECK(network.curves().size() == 25);
  CHECK(network.curves()[network.Find("curve_02")].length_mm() == Approx(373).margin(2));
  for (const char* to : {"lcca", "rcca", "lva", "rva", "curve_17", "curve_23"}) {
    const Centerline way = network.Path(network.Place("curve_07", "end"), network.Place(to, "end"));
    CHECK(way.length_mm() > 450);
    CHECK(way.length_mm() < 850);
    CHECK((way.At(0).position_mm - Vector3d(-16.1, 7.26, 1.37)).norm() < 0.01);
  }
}

TEST_CASE("points of the neuro arch's centerlines lie in the lumen, or are reported") {
  const std::string folder = torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/");
  MeshVesselOptions options;
  options.cache_folder.clear();
  options.field.voxel_mm = 1;
  const auto vessel = MeshVessel::Open(folder + "surface.obj", options);
  const CenterlineNetwork network = ParseSlicerCurves(ReadCurveFiles(folder + "centerlines"));
  double outside = 0;
  for (const OutsideStretch& stretch : FindStretchesOutside(network, vessel->surface())) {
    CHECK(stretch.worst_clearance_mm <= 0);
    outside += stretch.to_mm - stretch.from_mm;
  }
  double length = 0;
  for (const Centerline& curve : network.curves()) length += curve.length_mm();
  CHECK(outside > 10);  // the file's curves do extend past the surface
  CHECK(outside < 0.05 * length);
  // In the thoracic aorta the clearance is about equal to the radius.
  const Centerline& aorta = network.curves()[network.Find("curve_02")];
  for (const double s : Steps(70, 130, 5)) {
    const CenterlineSample at = aorta.At(s);
    CHECK(vessel->field().Clearance(at.position_mm) == Approx(at.radius_mm).epsilon(0.35));
  }
  for (const char* to : {"lcca", "rcca", "lva", "rva"}) {
    const CenteredCurve centered = CenteredInLumen(
        network.Path(network.Place("curve_04", "end"), network.Place(to, "end")), vessel->field());
    CHECK(centered.largest_shift_mm < 6.01);
    for (const double s : Steps(0, centered.curve.length_mm(), 0.5)) {
      CHECK(vessel->field().Clearance(centered.curve.At(s).position_mm) > 0.3);
    }
  }
}

TEST_CASE("a curve off the middle is centered, and its ends outside are cut") {
  const TubeVessel tube = MakeStraightTube(60, 3);
  const Centerline off = Straight("off", {-8, 1.5, 0.5}, {60, 1.5, 0.5});
  const CenteredCurve centered = CenteredInLumen(off, *tube.field);
  CHECK(centered.cut_at_start_mm == Approx(5).margin(1.5));
  CHECK(centered.cut_at_end_mm < 1.01);
  for (const double s : Steps(5, 55, 1)) {
    CHECK(std::hypot(centered.curve.At(s).position_mm.y(), centered.curve.At(s).position_mm.z()) <
          0.5);
  }
  CHECK_THROWS_WITH(CenteredInLumen(Straight("far", {0, 50, 0}, {60, 50, 0}), *tube.field),
                    Contains("\"far\"") && Contains("belongs to this surface"));
}

TEST_CASE("a place is checked for a wire to begin") {
  const TubeVessel tube = MakeStraightTube(60, 3);
  const auto check = [&](const Vector3d& point, const Vector3d& direction, double radius,
                         bool centerlines = true) {
    return CheckPlace(*tube.field, centerlines ? tube.centerlines : CenterlineNetwork(), point,
                      direction, radius);
  };
  const LumenReport good = check({1, 0, 0}, {1, 0, 0}, 0.2);
  CHECK(good.problem.empty());
  CHECK(good.inside);
  CHECK(good.wire_fits);
  CHECK(good.free_way_mm == Approx(61.8).margin(0.1));
  const LumenReport outside = check({20, 5, 0}, {1, 0, 0}, 0.2);
  CHECK_FALSE(outside.inside);
  CHECK_THAT(outside.problem, Contains("2 mm outside the lumen") && Contains("(20.0, 0.0, 0.0)"));
  const LumenReport climbed = check({20, 5, 0}, {1, 0, 0}, 0.2, false);
  CHECK(tube.field->Clearance(climbed.suggestion_mm) > 0.2);
  const LumenReport thick = check({20, 0, 0}, {1, 0, 0}, 4, false);
  CHECK(thick.inside);
  CHECK_FALSE(thick.wire_fits);
  CHECK_THAT(thick.problem, Contains("radius 4 mm does not fit") && Contains("thinner wire"));
  const LumenReport blocked = check({20, 2.5, 0}, {0, 1, 0}, 0.2);
  CHECK_THAT(blocked.problem, Contains("into the wall after 0.3 mm"));
}

CurveFile MarkupsFile(const std::string& contents) { return {"curve.mrk.json", contents}; }

std::string Markups(const std::string& points, const std::string& radii,
                    const std::string& extra = R"("type": "Curve",)") {
  return R"({"markups": [{)" + extra + R"("controlPoints": [)" + points +
         R"(], "measurements": [{"name": "length"}, {"name": "Radius", "controlPointValues": [)" +
         radii + "]}]}]}";
}

constexpr const char* kTwoPoints = R"({"position": [0, 0, 0]}, {"position": [0, 0, 9]})";

TEST_CASE("a Slicer curve is read with its radii") {
  const CurveFile file = MarkupsFile(
      Markups(std::string(kTwoPoints) + R"(, {"position": [5,5,5], "positionStatus": "undefined"})",
              "1.5, 2.5, 0"));
  const Centerline curve = ParseSlicerCurve(file);
  CHECK(curve.name() == "curve");
  CHECK(curve.length_mm() == Approx(9));
  CHECK(curve.At(9).radius_mm == Approx(2.5));
}

TEST_CASE("the units that a Slicer curve names are taken") {
  const std::string in_cm =
      Markups(kTwoPoints, "0.1, 0.2", R"("type": "Curve", "coordinateUnits": "cm",)");
  const Centerline curve = ParseSlicerCurve(MarkupsFile(in_cm));
  CHECK(curve.length_mm() == Approx(90));
  CHECK(curve.At(90).radius_mm == Approx(2));
  const auto named = [&](const std::string& unit) {
    std::string file = Markups(kTwoPoints, "0.1, 0.2");
    return MarkupsFile(
        file.replace(file.find(R"("controlPointV)"), 0, R"("units": ")" + unit + "\", "));
  };
  CHECK(ParseSlicerCurve(named("cm")).At(9).radius_mm == Approx(2));
  CHECK(ParseSlicerCurve(named("mm")).At(9).radius_mm == Approx(0.2));
  CHECK_THROWS_WITH(ParseSlicerCurve(named("px")),
                    Contains("measurements[\"Radius\"].units is \"px\", not a known unit"));
}

TEST_CASE("curves are brought into the space that a surface file names") {
  const auto in = [](const std::string& name, const std::string& space) {
    return CurveFile{name + ".mrk.json",
                     Markups(R"({"position": [1, 2, 3]}, {"position": [1, 2, 9]})", "1, 2",
                             R"("type": "Curve", "coordinateSystem": ")" + space + "\",")};
  };
  std::vector<std::string> findings;
  const auto start = [&](const std::string& curve_space, const std::string& surface) {
    return ParseSlicerCurves({in("a", curve_space)}, SpaceOfSurface(surface), &findings)
        .curves()[0]
        .At(0)
        .position_mm;
  };
  const Eigen::Vector3d same(1, 2, 3), turned(-1, -2, 3);
  CHECK(start("LPS", "# 3D Slicer output. SPACE=LPS\nv 0 0 0\n") == same);
  CHECK(start("LPS", "v 0 0 0\n") == same);
  CHECK(start("RAS", "v 0 0 0\n") == same);
  CHECK(findings.empty());
  CHECK(start("LPS", "# 3D Slicer output. SPACE=RAS\nv 0 0 0\n") == turned);
  CHECK(start("RAS", "3D Slicer output. SPACE=LPS") == turned);
  REQUIRE(findings.size() == 2);
  CHECK(findings[1] ==
        "centerline a is in RAS and the surface in LPS: the signs of its x and y are changed");
  CHECK_THROWS_WITH(
      ParseSlicerCurves({in("a", "LPS"), in("b", "RAS")}),
      Contains("b.mrk.json: field markups[0].coordinateSystem is \"RAS\", but \"LPS\" in a"));
  CHECK_THROWS_WITH(ParseSlicerCurve(in("a", "IJK")), Contains("coordinateSystem is \"IJK\""));
}

TEST_CASE("a centerline file that nests deeper than the stack is refused") {
  constexpr std::size_t kDepth = 200000;
  const std::string deep = std::string(kDepth, '[') + std::string(kDepth, ']');
  const auto refuses = [](const std::string& markup, const std::string& what) {
    CHECK_THROWS_WITH(
        ParseSlicerCurve(MarkupsFile(R"({"markups":[{)" + markup + R"(,"measurements":[]}]})")),
        Contains(what));
  };
  refuses(R"("controlPoints":[],"type":)" + deep, "type is nested");
  refuses(R"("type":"Curve","controlPoints":[],"coordinateUnits":)" + deep, "Units is nested");
  refuses(R"("type":"Curve","controlPoints":[{"position":)" + deep + "}]", "position is nested");
  refuses(R"("type":"Curve","controlPoints":[{"position":[1,2,)" + deep + "]}]", "is nested");
}

TEST_CASE("broken centerline files are refused by file, field, value and remedy") {
  const auto refused = [](const std::string& content, const std::string& part) {
    const CurveFile file = MarkupsFile(content);
    INFO(content);
    CHECK_THROWS_AS(ParseSlicerCurve(file), UserError);
    CHECK_THROWS_WITH(ParseSlicerCurve(file), Contains("curve.mrk.json") && Contains(part));
  };
  const std::string good = Markups(kTwoPoints, "1, 2");
  refused(good.substr(0, good.size() / 2), "not valid JSON");
  refused("", "not valid JSON");
  refused("[]", "markups is missing");
  refused(R"({"markups": []})", "0 curves");
  refused(R"({"markups": [3]})", "markups[0].type is missing");
  refused(Markups(kTwoPoints, "1, 2", R"("type": "Fiducial",)"), "\"Fiducial\"");
  refused(Markups(kTwoPoints, "1, 2", R"("type": "Curve", "coordinateUnits": "km",)"), "\"km\"");
  refused(Markups(kTwoPoints, "1"), "1 entries for 2");
  refused(Markups(kTwoPoints, "1, -2"), "controlPointValues[1] is -2");
  refused(Markups(kTwoPoints, "1, null"), "controlPointValues[1] is null");
  refused(Markups(R"({"position": [0, 0, "x"]}, {"position": [0, 0, 9]})", "1, 2"),
          "controlPoints[0].position[2] is \"x\"");
  refused(Markups(R"({"position": [0, 0]}, {"position": [0, 0, 9]})", "1, 2"),
          "controlPoints[0].position is [0,0]");
  refused(Markups(R"({"position": [0, 0, 9]})", "1"), "needs two");
  refused(R"({"markups": [{"type": "Curve", "controlPoints": [], "measurements": []}]})",
          "no \"Radius\"");
  refused(R"({"markups": [{"type": "Curve", "controlPoints": [7], "measurements": []}]})",
          "controlPoints[0].position is missing");
  // Measurements with an invalid name: beside the required one, and alone.
  std::string numbered = good;
  const std::size_t list = numbered.find("\"measurements\"");
  numbered.insert(numbered.find('[', list) + 1, R"({"name": 7}, {"name": null}, )");
  CHECK(ParseSlicerCurve(MarkupsFile(numbered)).length_mm() > 0);
  refused(R"({"markups": [{"type": "Curve", "controlPoints": [], "measurements": [{"name": 7}]}]})",
          "no \"Radius\"");
  const TemporaryFolder pipes;
  REQUIRE(mkfifo(pipes.Path("main.mrk.json").c_str(), 0600) == 0);
  CHECK_THROWS_WITH(ReadCurveFiles(pipes.Path()), Contains("it is a pipe"));
  const TemporaryFolder empty;
  CHECK_THROWS_WITH(ReadCurveFiles(empty.Path("")), Contains("holds no .mrk.json"));
  CHECK_THROWS_WITH(ReadCurveFiles("/nowhere"), Contains("cannot be read"));
}

}  // namespace
}  // namespace torquer::vessel
