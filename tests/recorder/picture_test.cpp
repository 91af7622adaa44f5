#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <utility>

#include "host/recorder/session_picture.h"

using namespace torquer;

namespace {

// Unit cube at the origin, wound so that normals point outward.
PictureVessel Cube() {
  const auto corner = [](int i) { return Eigen::Vector3d(i & 1, (i >> 1) & 1, (i >> 2) & 1); };
  constexpr int kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  PictureVessel cube;
  for (const auto& face : kFaces) {
    cube.triangles_mm.push_back({corner(face[0]), corner(face[1]), corner(face[2])});
    cube.triangles_mm.push_back({corner(face[0]), corner(face[2]), corner(face[3])});
  }
  return cube;
}

const PatientAxes kAxes{Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(),
                        Eigen::Vector3d::UnitZ()};

ShadingDetail Undivided() {
  ShadingDetail detail;
  detail.side_mm = 10;
  detail.fine_side_mm = 10;
  detail.most_triangles = 1000;
  return detail;
}

double Area(const std::vector<ShadedTriangle>& wall) {
  double area = 0;
  for (const ShadedTriangle& triangle : wall) {
    const Eigen::Vector2d ab = triangle.corners_mm[1] - triangle.corners_mm[0];
    const Eigen::Vector2d ac = triangle.corners_mm[2] - triangle.corners_mm[0];
    area += 0.5 * std::abs(ab.x() * ac.y() - ab.y() * ac.x());
  }
  return area;
}

}  // namespace

TEST_CASE("The patient's left is on the right, the head is up, the back is far") {
  const Eigen::Vector3d seen = SeenFromTheFront(kAxes, {1, 2, 3});
  CHECK(seen == Eigen::Vector3d(1, 3, 2));
}

TEST_CASE("Near and far wall are distinguished for any winding") {
  PictureVessel cube = Cube();
  const bool reversed = GENERATE(false, true);
  if (reversed) {
    for (auto& corners : cube.triangles_mm) std::swap(corners[1], corners[2]);
  }
  const ShadedVessel shaded = ShadeVessel(cube, kAxes, Undivided());
  // Two of the cube's six faces are not seen edge-on.
  CHECK(Area(shaded.near_wall) == Approx(1));
  CHECK(Area(shaded.far_wall) == Approx(1));
}

TEST_CASE("Division keeps the area and respects its limits") {
  ShadingDetail detail = Undivided();
  detail.side_mm = 0.3;
  detail.fine_side_mm = 0.1;
  detail.fine_region_mm = Eigen::AlignedBox2d(Eigen::Vector2d(0, 0), Eigen::Vector2d(0.2, 0.2));
  detail.most_triangles = 100000;
  const ShadedVessel shaded = ShadeVessel(Cube(), kAxes, detail);
  CHECK(Area(shaded.near_wall) == Approx(1));
  for (const ShadedTriangle& triangle : shaded.near_wall) {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& corner : triangle.corners_mm) box.extend(corner);
    const bool fine = detail.fine_region_mm.intersects(box);
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector2d side = triangle.corners_mm[i] - triangle.corners_mm[(i + 1) % 3];
      CHECK(side.norm() <= (fine ? 0.1 : 0.3) + 1e-12);
    }
    CHECK(triangle.light >= 0);
    CHECK(triangle.light <= 1);
  }
  detail.most_triangles = 50;
  const ShadedVessel coarse = ShadeVessel(Cube(), kAxes, detail);
  CHECK(coarse.near_wall.size() + coarse.far_wall.size() <= 50);
  CHECK(Area(coarse.far_wall) == Approx(1));
}

TEST_CASE("A picture holds the wire, its contacts and the letters, with text escaped") {
  PictureWire wire;
  for (int i = 0; i <= 20; ++i) wire.nodes_mm.emplace_back(i, 0, 2 * i);
  wire.contacts.push_back({wire.nodes_mm[5], 3.0});
  const std::string svg = DrawSession(Cube(), kAxes, wire, {"a<b", "c&d", {{"name", "\"v\""}}});
  CHECK_THAT(svg, Catch::Contains(">a&lt;b<") && Catch::Contains(">c&amp;d<") &&
                      Catch::Contains(">&quot;v&quot;<"));
  CHECK_THAT(svg, Catch::Contains(">R<") && Catch::Contains(">L<") && Catch::Contains(">H<") &&
                      Catch::Contains(">F<"));
  // Coordinates in 0.01 mm, up is negative: the first node and the tip.
  CHECK_THAT(svg, Catch::Contains("M0 0L100 -200 200 -400") &&
                      Catch::Contains("cx=\"2000\" cy=\"-4000\""));
  CHECK_THAT(svg, Catch::Contains("cx=\"500\" cy=\"-1000\""));
  CHECK(svg.find("nan") == std::string::npos);
}

TEST_CASE("Several instruments are drawn as far as each reaches, and named") {
  PictureWire wire;
  for (int i = 0; i <= 4; ++i) wire.nodes_mm.emplace_back(0, 0, i);
  wire.instruments = {{"wire", 4}, {"catheter", 2.5}, {"guide & co", 1}};
  const std::string svg = DrawSession({}, kAxes, wire, {});
  // Each of the two panels has a dark outline and a colored line; the farthest tip also has a mark.
  const auto count = [&svg](const std::string& text) {
    int found = 0;
    for (std::size_t at = 0; (at = svg.find(text, at)) != std::string::npos; ++at) ++found;
    return found;
  };
  CHECK(count("d=\"M0 0L0 -100 0 -200 0 -300 0 -400\"") == 6);
  CHECK(count("d=\"M0 0L0 -100 0 -200 0 -250\"") == 4);
  CHECK(count("d=\"M0 0L0 -100\"") == 4);
  CHECK_THAT(svg, Catch::Contains(">wire 4.0 mm<") && Catch::Contains(">catheter 2.5 mm<") &&
                      Catch::Contains(">guide &amp; co 1.0 mm<"));
  wire.instruments.resize(1);
  CHECK(DrawSession({}, kAxes, wire, {}).find("wire 4.0 mm") == std::string::npos);
}

TEST_CASE("An instrument with nodes to itself is drawn along them, and lies in the picture") {
  PictureWire wire;
  wire.nodes_mm = {{0, 0, 0}, {0, 0, 4}};
  wire.instruments = {{"wire", 4}, {"buddy", 5, {{1, 0, 0}, {1, 0, 3}, {40, 0, 3}}}};
  const std::string svg = DrawSession({}, kAxes, wire, {});
  CHECK_THAT(svg, Catch::Contains("d=\"M100 0L100 -300 4000 -300\" stroke"));
  CHECK_THAT(svg, Catch::Contains("contacts of wire alone"));
  // The overview is centered between the first node of the wire and the tip of the buddy.
  const std::string alone = DrawSession({}, kAxes, {wire.nodes_mm, {{"wire", 4}}, {}}, {});
  CHECK(alone.find("contacts of") == std::string::npos);
  const auto overview = [](const std::string& text) {
    const std::size_t at = text.find("transform=\"matrix(");
    return text.substr(at, text.find(')', at) - at);
  };
  CHECK(overview(svg) != overview(alone));
}

TEST_CASE("Without a vessel the wire alone is drawn") {
  PictureWire wire;
  wire.nodes_mm = {{0, 0, 0}, {0, 0, 1}};
  const std::string svg = DrawSession({}, kAxes, wire, {});
  CHECK_THAT(svg, Catch::EndsWith("</svg>\n"));
  CHECK(svg.find("nan") == std::string::npos);
}
