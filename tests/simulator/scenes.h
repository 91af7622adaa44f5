// Small scenes for tests of the simulator.
#pragma once

#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace torquer::test {

/// A scene file in a folder of its own: the T-Y phantom with a wire of 120 mm lying in.
class SceneFile {
 public:
  explicit SceneFile(const std::string& more = "") {
    std::ofstream(path_) << "name = \"small\"\n"
                            "[vessel]\nkind = \"phantom\"\nphantom = \"ty\"\n"
                            "wall_stiffness_N_mm2 = 0.01\n"
                            "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
                            "[wire]\nsegment_mm = 1\nmax_length_mm = 200\nradius_mm = 0.2\n"
                            "tip_mm = 10\ntip_angle_deg = 30\nrigidity_N_mm2 = 6.35e-3\n"
                            "inserted_at_start_mm = 120\n"
                         << more;
  }
  const std::string& path() const { return path_; }
  std::string Beside(const std::string& name) const { return folder_.Path() + "/" + name; }

 private:
  TemporaryFolder folder_;
  std::string path_ = folder_.Path() + "/small.toml";
};

inline constexpr char kPaperMethod[] = "[relaxation]\nmethod = \"paper\"\n";
inline constexpr char kCatheter[] =
    "[effects.catheter]\nmax_length_mm = 150\ninserted_at_start_mm = 60\ninner_radius_mm = 0.3\n"
    "radius_mm = 0.5\nrigidity_N_mm2 = 0.01\ntip_mm = 10\ntip_angle_deg = 20\n";
inline constexpr char kFriction[] = "[effects.friction]\ncoefficient = 0.1\n";

}  // namespace torquer::test
