// Entries of instruments: moved across their direction, and one of an instrument beside others.
#include "host/simulator/scene/entry.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using Eigen::Vector2d;
using Eigen::Vector3d;
using torquer::test::SceneText;
using namespace torquer::scene;

namespace {

// Wire beside the guidewire of SceneText, whose radius is 0.2 mm too.
std::string Buddy(const std::string& entry, const std::string& more = "",
                  const std::string& name = "buddy") {
  return "[[instrument]]\nname = \"" + name +
         "\"\nmax_length_mm = 200\nradius_mm = 0.2\nrigidity_N_mm2 = 6.35e-3\n" + more +
         "[instrument.entry]\n" + entry;
}

const std::string kMain = "centerline = \"main\"\nat_mm = 1\n";
const std::string kBeside = kMain + "offset_mm = [0.6, -0.8]\n";

std::string Guide(const std::string& inner_radius_mm) {
  return "[[instrument]]\nname = \"guide\"\nmax_length_mm = 100\nradius_mm = 2\n"
         "rigidity_N_mm2 = 0.05\ninner_radius_mm = " +
         inner_radius_mm + "\n";
}

SceneSpec Parsed(const std::string& more) { return ParseScene(SceneText(more), "small.toml", {}); }

// Error message for a scene that SceneText begins; "" if it can be built.
std::string EntryRefusal(const std::string& more) {
  try {
    const Scene scene(Parsed(more));
  } catch (const torquer::UserError& error) {
    return error.what();
  }
  return "";
}

// Curve that turns by half a turn in one plane, and then leaves the plane.
torquer::vessel::CenterlineNetwork BentNetwork() {
  std::vector<Vector3d> points_mm;
  for (int k = 0; k <= 60; ++k) {
    const double angle = k * 0.05;
    points_mm.emplace_back(20 * std::sin(angle), 20 - 20 * std::cos(angle),
                           k < 30 ? 0 : 0.02 * (k - 30) * (k - 30));
  }
  const std::vector<double> radii_mm(points_mm.size(), 4);
  return torquer::vessel::CenterlineNetwork({{"bent", points_mm, radii_mm}});
}

}  // namespace

TEST_CASE("An entry moves across its direction, along the first and second normal", "[scene]") {
  const torquer::vessel::CenterlineNetwork none;
  const auto entry = [&](const Vector3d& direction, const Vector2d& offset_mm) {
    EntrySpec spec;
    spec.point_mm = Vector3d(1, 2, 3);
    spec.direction = direction;
    spec.offset_mm = offset_mm;
    return FindEntry(spec, none);
  };
  // Along x, the least component is the first of the equal ones, y; the second normal is z.
  CHECK(entry({5, 0, 0}, {0, 0}).sheath.point_mm == Vector3d(1, 2, 3));
  CHECK(entry({5, 0, 0}, {0.5, 0}).sheath.point_mm.isApprox(Vector3d(1, 2.5, 3), 1e-14));
  CHECK(entry({5, 0, 0}, {0, 0.5}).sheath.point_mm.isApprox(Vector3d(1, 2, 3.5), 1e-14));
  CHECK(entry({5, 0, 0}, {0, 0.5}).sheath.direction == Vector3d(1, 0, 0));

  const Vector3d direction = Vector3d(2, -3, 1).normalized();
  const Vector3d first = entry(direction, {1, 0}).sheath.point_mm - Vector3d(1, 2, 3);
  const Vector3d second = entry(direction, {0, 1}).sheath.point_mm - Vector3d(1, 2, 3);
  const Vector3d both = entry(direction, {0.6, -2}).sheath.point_mm - Vector3d(1, 2, 3);
  CHECK(first.norm() == Approx(1).epsilon(1e-14));
  CHECK(std::abs(first.dot(direction)) < 1e-14);
  CHECK(first[2] > 0.9);  // the direction's least component is along z
  CHECK(second.isApprox(direction.cross(first), 1e-14));
  CHECK(both.isApprox(0.6 * first - 2 * second, 1e-14));
}

TEST_CASE("A wire's first normal is that along which its entry moves", "[scene]") {
  const Scene plain(Parsed(""));
  SceneSpec moved_spec = Parsed("");
  moved_spec.entry.offset_mm = {0.3, 1.1};
  const Scene moved(moved_spec);
  const Vector3d normal = plain.stack().empty_rod().sheath_normal();
  const Vector3d direction = plain.stack().empty_rod().sheath().direction;
  const Vector3d by =
      moved.stack().empty_rod().sheath().point_mm - plain.stack().empty_rod().sheath().point_mm;
  CHECK(by.isApprox(0.3 * normal + 1.1 * direction.cross(normal), 1e-12));
  CHECK(moved.stack().empty_rod().sheath().direction == direction);
  CHECK(moved.content_hash() != plain.content_hash());
}

TEST_CASE("A start path that moves with its entry stays across the centerline", "[scene]") {
  const torquer::vessel::CenterlineNetwork network = BentNetwork();
  const torquer::vessel::Centerline& curve = network.curves().front();
  EntrySpec spec;
  spec.centerline = "bent";
  spec.at_mm = 2;
  const Entry plain = FindEntry(spec, network);
  spec.offset_mm = {0.9, -1.2};
  const Entry moved = FindEntry(spec, network);
  REQUIRE(plain.start_path_mm.size() > 100);
  REQUIRE(moved.start_path_mm.size() == plain.start_path_mm.size());
  CHECK(moved.start_path_mm.front().isApprox(moved.sheath.point_mm, 1e-12));
  Vector3d last = moved.sheath.point_mm - plain.sheath.point_mm;
  Vector3d last_tangent = plain.sheath.direction;
  for (std::size_t k = 0; k < plain.start_path_mm.size(); ++k) {
    const Vector3d tangent = curve.At(2 + 0.5 * static_cast<double>(k)).tangent;
    const Vector3d by = moved.start_path_mm[k] - plain.start_path_mm[k];
    CHECK(by.norm() == Approx(1.5).epsilon(1e-9));
    CHECK(std::abs(by.dot(tangent)) < 1e-9);
    // It turns with the tangent, and not about it.
    const Vector3d mean = tangent + last_tangent;
    CHECK(std::abs((by - last).dot(mean.cross(by + last))) < 1e-9);
    last = by;
    last_tangent = tangent;
  }
}

TEST_CASE("An entry at a point has a path into a branch, without centerlines", "[scene]") {
  // The stem of the phantom lies along x; the crossbar leaves it at x = 100, here downward.
  std::string text = SceneText();
  const std::string at = "centerline = \"main\"\nat_mm = 1\n";
  const std::string point = "point_mm = [1, 0, 0]\ndirection = [2, 0, 0]\n";
  const auto refusal = [&](const std::string& entry) {
    std::string changed = text;
    changed.replace(changed.find(at), at.size(), entry);
    try {
      const Scene scene(ParseScene(changed, "small.toml", {}));
    } catch (const torquer::UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string path = "path_mm = [[98, 0, 0], [89.6, -38.6, 0]]\n";
  CHECK_THAT(refusal(point), Contains("inserted_at_start_mm") && Contains("entry.path_mm"));
  CHECK(refusal(point + path).empty());
  CHECK_THAT(refusal(at + path), Contains("small.toml:8: entry.path_mm") && Contains("point_mm"));
  CHECK_THAT(refusal(point + "path_mm = [[98, 0, 0], [98, 9, 1]]\n"),
             Contains("entry.path_mm") && Contains("point 2 of 2, (98, 9, 1)"));
  CHECK_THAT(refusal(point + "path_mm = []\n"), Contains("entry.path_mm"));

  const auto tip = [&](const std::string& entry) {
    std::string changed = text;
    changed.replace(changed.find(at), at.size(), entry);
    Scene scene(ParseScene(changed, "small.toml", {}));
    CHECK(WriteScene(ParseScene(WriteScene(scene.spec()), "again", {})) ==
          WriteScene(scene.spec()));
    const auto relaxation = scene.MakeRelaxation();
    return scene.MakeStart(*relaxation).tip();
  };
  CHECK(tip(point + path)[1] < -10);
  CHECK(tip(point + "path_mm = [[98, 0, 0], [105, 19, 0]]\n")[1] > 10);
}

TEST_CASE("A path of points moves with its entry, across each of its legs", "[scene]") {
  EntrySpec spec;
  spec.point_mm = Vector3d(0, 0, 0);
  spec.direction = Vector3d(3, 0, 0);
  spec.path_mm = {{10, 0, 0}, {10, 10, 0}};
  const torquer::vessel::CenterlineNetwork none;
  CHECK(FindEntry(spec, none).start_path_mm == spec.path_mm);
  spec.offset_mm = {0.5, 2};  // along y, which turns to -x at the corner, and along z
  const Entry moved = FindEntry(spec, none);
  CHECK(moved.sheath.point_mm.isApprox(Vector3d(0, 0.5, 2), 1e-14));
  REQUIRE(moved.start_path_mm.size() == 2);
  CHECK(moved.start_path_mm[0].isApprox(Vector3d(10, 0.5, 2), 1e-14));
  CHECK(moved.start_path_mm[1].isApprox(Vector3d(9.5, 10, 2), 1e-14));
}

TEST_CASE("An instrument beside the others is the same after it was written and read", "[scene]") {
  const SceneSpec spec = Parsed(Buddy(kBeside, "inserted_at_start_mm = 40\n"));
  REQUIRE(spec.instruments[1].entry);
  CHECK_FALSE(spec.instruments[0].entry);
  CHECK(spec.instruments[1].entry->centerline == "main");
  CHECK(spec.instruments[1].entry->offset_mm == Vector2d(0.6, -0.8));
  const std::string written = WriteScene(spec);
  CHECK_THAT(written, Contains("\n[instrument.entry]\ncenterline = \"main\"\nat_mm = 1\n"
                               "offset_mm = [0.6, -0.8]\n"));
  const SceneSpec again = ParseScene(written, "again", {});
  CHECK(WriteScene(again) == written);
  CHECK(again.instruments[1].entry->offset_mm == Vector2d(0.6, -0.8));
  // The entry of all has no offset, so none is written.
  CHECK(written.find("offset_mm") == written.rfind("offset_mm"));

  // An instrument of the library has one by the same table.
  const SceneSpec device = Parsed(
      "[[instrument]]\nname = \"buddy\"\ndevice = \"sion_blue\"\nmax_length_mm = 150\n"
      "[instrument.entry]\npoint_mm = [1, 1, 0]\ndirection = [1, 0, 0]\n");
  CHECK(device.instruments[1].entry->point_mm == Vector3d(1, 1, 0));
  CHECK(WriteScene(ParseScene(WriteScene(device), "again", {})) == WriteScene(device));
}

TEST_CASE("An entry beside others is refused with place, value and remedy", "[scene]") {
  struct Case {
    std::string text;
    std::vector<std::string> said;
  };
  const Case cases[] = {
      {Buddy(kMain),
       {"small.toml:21: instrument[1].entry.offset_mm", "0 mm from that of guidewire",
        "at least 0.4 mm", "offset_mm"}},
      {Buddy(kMain + "offset_mm = [0.3, 0]\n"),
       {":24: instrument[1].entry.offset_mm = ", "0.3 mm from that of guidewire"}},
      {Buddy(kMain + "offset_mm = [3.9, 0]\n"),
       {":24: instrument[1].entry.offset_mm = ", "does not fit"}},
      {Buddy("centerline = \"mian\"\n"), {":22: instrument[1].entry.centerline", "main"}},
      {Buddy("point_mm = [0, 50, 0]\ndirection = [1, 0, 0]\n"),
       {":22: instrument[1].entry.point_mm", "outside the lumen"}},
      {Buddy(kMain + "direction = [1, 0, 0]\n"), {"instrument[1].entry.direction", "point_mm"}},
      {Buddy("at_mm = 1\n"), {"instrument[1].entry.centerline: is missing"}},
      {Buddy(kMain + "offset_mm = [60, 0]\n"), {"instrument[1].entry.offset_mm", "-50 to 50"}},
      {Buddy(kMain + "offset_mm = [nan, 0]\n"), {"instrument[1].entry.offset_mm", "give"}},
      {Buddy(kMain + "offset_mm = 1\n"), {"instrument[1].entry.offset_mm = 1", "has 1", "[a, b]"}},
      {Buddy(kMain + "offset_mm = [1, 2, 3]\n"), {"must have two numbers, and has 3"}},
      {Buddy(kMain + "offset = 1\n"), {"instrument[1].entry.offset = 1", "did you mean offset_mm"}},
      {Buddy("point_mm = [1, 1, 0]\ndirection = [1, 0, 0]\n", "inserted_at_start_mm = 40\n"),
       {"instrument[1].inserted_at_start_mm = 40", "entry.centerline"}},
      {Buddy(kBeside) + Buddy(kMain + "offset_mm = [-1, 0]\n", "", "third"),
       {"instrument[2].entry", "buddy has an entry too", "at most one", "remove"}},
      {Buddy(kBeside) + torquer::test::kPaperMethod, {"instrument[1].name", "single instrument"}},
      {Buddy(kBeside) + Guide("0.4"),
       {"instrument[2].inner_radius_mm = 0.4",
        "0.4 mm, the sum of the radii of guidewire and buddy", "list buddy last"}},
      {Buddy(kBeside) + Guide("1.5"),
       {"instrument[2].name", "beside each other and needs room", "effects.clearance.around"}},
      {Buddy(kBeside) + "[effects.clearance]\n",
       {"instrument[1].entry", "lumen of buddy", "effects.clearance.around"}},
  };
  for (const Case& one : cases) {
    INFO(one.text);
    const std::string said = EntryRefusal(one.text);
    for (const std::string& part : one.said) CHECK_THAT(said, Contains(part));
  }
  // The first instrument enters at [entry].
  const std::string first = "[instrument.entry]\n" + kBeside;
  CHECK_THAT(EntryRefusal(first),
             Contains(":16: instrument[0].entry = ") &&
                 Contains("the first instrument enters at [entry]; remove [instrument.entry], or "
                          "list the instrument later"));
  CHECK_THAT(EntryRefusal(first + torquer::test::kPaperMethod), Contains("instrument[0].entry"));
}

TEST_CASE("A scene has an instrument beside the others, in a sheath of another place", "[scene]") {
  Scene scene(Parsed(Buddy(kBeside, "inserted_at_start_mm = 40\n")));
  const torquer::InstrumentStack& stack = scene.stack();
  REQUIRE(stack.size() == 2);
  CHECK(stack.curves() == 2);
  const torquer::Sheath& main = stack.instrument(0).sheath();
  const torquer::Sheath& beside = stack.instrument(1).sheath();
  CHECK((beside.point_mm - main.point_mm).norm() == Approx(1));
  CHECK(std::abs((beside.point_mm - main.point_mm).dot(main.direction)) < 1e-9);
  CHECK(beside.direction == main.direction);
  CHECK(stack.clearance().is_beside[1]);
  CHECK_FALSE(stack.clearance().is_beside[0]);
  CHECK(stack.clearance().start_path_mm[1].size() > 50);
  CHECK(stack.clearance().stiffness_N_mm2 == 0.01);

  const auto relaxation = scene.MakeRelaxation();
  const torquer::WireState state = scene.MakeStart(*relaxation);
  REQUIRE(state.curves() == 2);
  CHECK(state.curve(0).nodes().front() == main.point_mm);
  CHECK(state.curve(1).nodes().front() == beside.point_mm);
  CHECK(state.curve(1).insertion_mm() == Approx(40));
}
