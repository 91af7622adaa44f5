// Small scenes for tests of the simulator.
#pragma once

#include <fstream>
#include <string>

#include "tests/support/temporary_folder.h"

namespace torquer::test {

/// Three nested instruments, which extend SceneFile's guidewire.
inline constexpr char kMicrocatheter[] =
    "[[instrument]]\nname = \"microcatheter\"\nmax_length_mm = 150\ninserted_at_start_mm = 60\n"
    "inner_radius_mm = 0.3\nradius_mm = 0.5\nrigidity_N_mm2 = 0.01\ntip_mm = 10\n"
    "tip_angle_deg = 20\n";
inline constexpr char kGuidingCatheter[] =
    "[[instrument]]\nname = \"guide\"\nmax_length_mm = 100\ninserted_at_start_mm = 30\n"
    "inner_radius_mm = 0.7\nradius_mm = 0.9\nrigidity_N_mm2 = 0.05\n";

/// Wire that lies beside SceneFile's guidewire, 1 mm from it at the entry.
inline constexpr char kBuddyWire[] =
    "[[instrument]]\nname = \"buddy_wire\"\nmax_length_mm = 200\nradius_mm = 0.2\n"
    "rigidity_N_mm2 = 6.35e-3\ninserted_at_start_mm = 50\n"
    "[instrument.entry]\ncenterline = \"main\"\nat_mm = 1\noffset_mm = [0.6, -0.8]\n";

inline constexpr char kPaperMethod[] = "[relaxation]\nmethod = \"paper\"\n";
inline constexpr char kFriction[] = "[effects.friction]\ncoefficient = 0.1\n";

/// Text of a scene: the T-Y phantom with a guidewire inserted by 120 mm.
inline std::string SceneText(const std::string& more = "") {
  return "name = \"small\"\n"
         "[vessel]\nkind = \"ty_phantom\"\nwall_stiffness_N_mm2 = 0.01\n"
         "[entry]\ncenterline = \"main\"\nat_mm = 1\n"
         "[[instrument]]\nname = \"guidewire\"\nmax_length_mm = 200\nradius_mm = 0.2\n"
         "tip_mm = 10\ntip_angle_deg = 30\nrigidity_N_mm2 = 6.35e-3\n"
         "inserted_at_start_mm = 120\n" +
         more;
}

/// Scene of SceneText as a file in a temporary folder.
class SceneFile {
 public:
  explicit SceneFile(const std::string& more = "") { std::ofstream(path_) << SceneText(more); }
  const std::string& path() const { return path_; }
  std::string Beside(const std::string& name) const { return folder_.Path() + "/" + name; }

 private:
  TemporaryFolder folder_;
  std::string path_ = folder_.Path() + "/small.toml";
};

}  // namespace torquer::test
