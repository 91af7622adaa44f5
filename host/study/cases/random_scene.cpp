#include "host/study/cases/random_scene.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace torquer::study {
namespace {

using Eigen::Vector3d;

// One scene file in the making.
class Draw {
 public:
  explicit Draw(std::mt19937& random) : random_(random) {}

  std::string Scene() {
    Add("name = \"random\"\n\n");
    AddVessel();
    Add("[entry]\ncenterline = \"main\"\nat_mm = 1\n\n");
    AddInstruments();
    Add("[relaxation]\nsegment_mm = {}\ncontact_points_per_segment = {}\n\n", Between(0.6, 2),
        2 + random_() % 2);
    AddEnergyTerms();
    AddMotions();
    AddObservers();
    return text_;
  }

 private:
  struct Drawn {
    std::string name;
    bool is_beside = false;
    bool needs_room = false;  // lies around instruments beside each other
  };

  template <class... Values>
  void Add(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  // Evenly over the decades.
  double Evenly(double low, double high) {
    return std::exp(Between(std::log(low), std::log(high)));
  }
  bool Chance(double probability) { return Between(0, 1) < probability; }
  Vector3d Direction() {
    std::normal_distribution<double> normal;
    const double x = normal(random_);
    const double y = normal(random_);
    return Vector3d(x, y, normal(random_)).normalized();
  }

  void AddTube(const char* name, const std::vector<Vector3d>& points, double bend_radius_mm,
               double radius_mm, double last_radius_mm) {
    Add("[[vessel.tube]]\nname = \"{}\"\nbend_radius_mm = {}\npoints_mm = [", name, bend_radius_mm);
    for (const Vector3d& p : points) Add("[{}, {}, {}], ", p[0], p[1], p[2]);
    Add("]\nradii_mm = [");
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double at = static_cast<double>(k) / static_cast<double>(points.size() - 1);
      Add("{}, ", radius_mm + at * (last_radius_mm - radius_mm));
    }
    Add("]\n\n");
  }

  // Corners of an axis: legs that turn by at most a right angle.
  std::vector<Vector3d> Corners(const Vector3d& from, Vector3d along, int legs) {
    std::vector<Vector3d> points = {from};
    for (int leg = 0; leg < legs; ++leg) {
      if (leg > 0) {
        const Vector3d axis = along.cross(Direction()).normalized();
        along = Eigen::AngleAxisd(Between(0, 1.5), axis) * along;
      }
      points.emplace_back(points.back() + Between(20, 45) * along);
    }
    return points;
  }

  void AddVessel() {
    Add("[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = {}\nunion_width_mm = {}\n\n",
        rigidity_ * Evenly(1, 20), Between(0.2, 2));
    const auto main = Corners({0, 0, 0}, Vector3d::UnitZ(), 3 + static_cast<int>(random_() % 3));
    const double radius_mm = Between(3.2, 5);
    AddTube("main", main, Evenly(8, 40), radius_mm, Between(1.5, radius_mm));
    if (!Chance(0.5)) return;
    const Vector3d from = (main[1] + main[2]) / 2;
    const Vector3d along = (main[2] - main[1]).normalized();
    const Vector3d aside = along.cross(Direction()).normalized();
    AddTube("branch",
            Corners(from, (along + Between(0.3, 1.5) * aside).normalized(),
                    1 + static_cast<int>(random_() % 2)),
            15, Between(1, 2), Between(0.8, 1.5));
  }

  void AddInstruments() {
    const bool has_beside = Chance(0.35);
    const int count = 1 + has_beside + static_cast<int>(random_() % (has_beside ? 3 : 4));
    const int beside = has_beside ? 1 + static_cast<int>(random_() % (count - 1)) : -1;
    double outer_mm = 0;  // radius that the instruments so far take around the axis of the entry
    for (int k = 0; k < count; ++k) {
      const std::string name = fmt::format("instrument_{}", k);
      Add("[[instrument]]\nname = \"{}\"\nmax_length_mm = {}\n", name, Between(60, 130));
      double radius_mm = Evenly(0.12, 0.35);
      if (k > 0 && k != beside) {
        const double lumen_mm = outer_mm * Between(1.08, 1.45) + 0.02;
        radius_mm = lumen_mm + Between(0.05, 0.25);
        Add("inner_radius_mm = {}\n", lumen_mm);
      }
      Add("radius_mm = {}\n", radius_mm);
      if (k == beside) {
        const double offset_mm = outer_mm + radius_mm + Between(0.01, 0.1);
        Add("entry = {{centerline = \"main\", at_mm = 1, offset_mm = [{}, 0]}}\n", offset_mm);
        outer_mm = offset_mm + radius_mm;
      } else {
        outer_mm = radius_mm;
      }
      AddBuild(rigidity_ * Evenly(0.3, 3) * (k + 1));
      instruments_.push_back({name, k == beside, beside >= 0 && k > beside});
    }
  }

  void AddBuild(double rigidity) {
    const bool stepped = Chance(0.5);
    if (stepped) {
      Add("from_tip_mm = [0, 7.3, 7.3, 30]\nrigidity_N_mm2 = [{0}, {0}, {1}, {2}]\n",
          rigidity * Evenly(0.1, 1), rigidity * Evenly(0.5, 1), rigidity);
    } else {
      Add("rigidity_N_mm2 = {}\n", rigidity);
    }
    if (Chance(0.6)) Add("tip_mm = {}\ntip_angle_deg = {}\n", Between(3, 12), Between(10, 120));
    if (Chance(0.5)) Add("torsional_rigidity_ratio = {}\n", Evenly(0.3, 2));
    if (stepped && Chance(0.3)) {
      Add("friction_coefficient = [{0}, {0}, {1}, {2}]\n", Between(0, 0.1), Between(0, 0.5),
          Between(0, 0.5));
    } else {
      if (Chance(0.3)) Add("coating_mm = 20\ncoating_coefficient = {}\n", Between(0, 0.1));
      if (Chance(0.3)) Add("friction_coefficient = {}\n", Between(0, 0.5));
    }
    if (Chance(0.4)) Add("inserted_at_start_mm = {}\n", Between(2, 25));
    Add("linear_density_g_m = {}\n\n", Evenly(0.2, 3));
  }

  void AddEnergyTerms() {
    std::string around;
    for (std::size_t k = 1; k < instruments_.size(); ++k) {
      const Drawn& drawn = instruments_[k];
      if (drawn.is_beside || !(drawn.needs_room || Chance(0.5))) continue;
      around += fmt::format("{}\"{}\"", around.empty() ? "" : ", ", drawn.name);
    }
    // A stack with instruments beside each other needs the contact between them without room too.
    if (!around.empty()) {
      Add("[effects.clearance]\naround = [{}]\n", around);
      Add("stiffness_N_mm2 = {}\n\n", rigidity_ * Evenly(2, 20));
    }
    if (Chance(0.5)) Add("[effects.torsion]\n\n");
    const bool touches_itself = Chance(0.3);
    if (touches_itself) Add("[effects.self_contact]\n\n");
    if (Chance(0.6)) Add("[effects.friction]\ncoefficient = {}\n\n", Between(0, 0.3));
    if ((touches_itself || instruments_.size() > 1) && Chance(0.5)) {
      Add("[effects.friction_between]\ncoefficient = {}\n\n", Between(0, 0.3));
    }
    if (Chance(0.3)) Add("[effects.gravity]\n\n");
    if (Chance(0.3)) Add("[effects.inertia]\n\n");
    if (Chance(0.2)) {
      const Vector3d d = Direction();
      Add("[effects.point_load]\nforce_mN = {}\nforce_direction = [{}, {}, {}]\n\n", Evenly(0.1, 5),
          d[0], d[1], d[2]);
    }
    if (Chance(0.3)) {
      Add("[[effects.compliance.region]]\ncenterline = \"main\"\nfrom_mm = 20\nto_mm = 40\n"
          "radius_mm = 8\nfactor = {}\n\n",
          Evenly(0.1, 10));
    }
  }

  void AddMotions() {
    for (const char* name : {"heartbeat", "breathing"}) {
      if (!Chance(0.15)) continue;
      const Vector3d d = Direction();
      Add("[effects.{}]\namplitude_mm = {}\ndirection = [{}, {}, {}]\n"
          "[[effects.{}.region]]\nside_of_mm = [0, 0, 10]\nside = [0, 0, 1]\nedge_mm = 20\n\n",
          name, Between(0.5, 4), d[0], d[1], d[2], name);
    }
  }

  void AddObservers() {
    const bool assessment = Chance(0.3);
    if (assessment || Chance(0.3)) Add("[effects.wall_force]\nthreshold_mN = 30\n\n");
    if (Chance(0.5)) Add("[effects.internal_forces]\n\n");
    // Uses no random number, so that the rest of the scene does not change.
    const unsigned draw = std::mt19937(random_)() % 4;
    if (draw == 0) Add("[effects.outlets]\n\n");
    // Segments twice as long may be too long for a bent tip.
    const bool bent = text_.find("tip_angle_deg") != std::string::npos;
    if (draw == 1 && !bent) Add("[effects.segment_error]\n\n");
    if (assessment) {
      Add("[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 50\n"
          "force_limit_mN = 100\n\n");
    }
    if (!Chance(0.2)) return;
    Add("[effects.flow]\ninlet = \"main\"\ninlet_mL_s = {}\nrate_per_min = 72\nobstruction = {}\n\n"
        "[effects.contrast]\nrate_mL_s = 2\nat = \"tip\"\n\n",
        Evenly(0.5, 20), Chance(0.5));
    // A heartbeat of these scenes has another rate than the flow.
    if (text_.find("[effects.heartbeat]") != std::string::npos) return;
    Add("[effects.patient_monitor]\nat = \"entry\"\n\n");
  }

  std::mt19937& random_;
  // A long wire under axial force F breaks through a wall of stiffness k if F exceeds 2 sqrt(k EI).
  // Walls and lumens are therefore stiff by comparison.
  const double rigidity_ = Evenly(0.05, 30);
  std::string text_;
  std::vector<Drawn> instruments_;
};

}  // namespace

std::string RandomScene(std::mt19937& random) { return Draw(random).Scene(); }

}  // namespace torquer::study
