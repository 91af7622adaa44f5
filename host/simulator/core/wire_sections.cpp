#include "host/simulator/core/wire_sections.h"

#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector2d;

namespace {

Vector2d CurvatureOf(const WireSection& section) {
  return {section.curvature_1_per_mm, section.curvature_2_per_mm};
}

// First section end of an instrument beyond a distance from its tip; `otherwise` if there is none.
double NextEnd(const std::vector<WireSection>& sections, double from_tip_mm, double otherwise) {
  for (const WireSection& section : sections) {
    if (section.from_tip_mm > from_tip_mm) return std::min(section.from_tip_mm, otherwise);
  }
  return otherwise;
}

// A piece of a joint's hat, in which all properties and the weight are linear in s.
struct Piece {
  double from_mm;
  double to_mm;
  double weight_from;
  double weight_to;

  double LengthMm() const { return to_mm - from_mm; }
  // Integral of the weight, mm.
  double Weight() const { return LengthMm() * (weight_from + weight_to) / 2; }
};

// Calls `each` with the pieces of the hat of a joint.
template <class Each>
void ForPieces(const std::vector<WireSection>& sections, double joint_mm, double segment_mm,
               const Each& each) {
  double from_mm = joint_mm - segment_mm;
  double weight_from = 0;
  for (const bool rises : {true, false}) {
    const double half_mm = rises ? joint_mm : joint_mm + segment_mm;
    while (from_mm < half_mm) {
      const double to_mm = NextEnd(sections, from_mm, half_mm);
      const double away = std::abs(to_mm - joint_mm) / segment_mm;
      const double weight_to = to_mm < half_mm ? 1 - away : rises ? 1 : 0;
      each(Piece{from_mm, to_mm, weight_from, weight_to});
      from_mm = to_mm;
      weight_from = weight_to;
    }
  }
}

// Integral over a piece of the weight over a rigidity that is linear from `from` to `to`.
double Compliance(const Piece& piece, double from, double to) {
  if (from == to) return piece.Weight() / from;
  // With r = to / from - 1: integrals of 1 / (1 + r t) and t / (1 + r t) for t from 0 to 1.
  const double r = to / from - 1;
  double whole = 0;
  double first = 0;
  if (std::abs(r) < 1e-2) {
    for (int power = 8; power >= 0; --power) {
      whole = 1.0 / (power + 1) - r * whole;
      first = 1.0 / (power + 2) - r * first;
    }
  } else {
    whole = std::log1p(r) / r;
    first = (1 - whole) / r;
  }
  const double slope = piece.weight_to - piece.weight_from;
  return piece.LengthMm() * (piece.weight_from * whole + slope * first) / from;
}

// Rigidity of a joint as the harmonic mean of its pieces. A constant rigidity is returned exactly.
class HarmonicMean {
 public:
  void Add(const Piece& piece, double from, double to) {
    compliance_ += Compliance(piece, from, to);
    lowest_ = std::min({lowest_, from, to});
    highest_ = std::max({highest_, from, to});
  }
  double Of(double segment_mm) const {
    return lowest_ == highest_ ? lowest_ : segment_mm / compliance_;
  }

 private:
  double compliance_ = 0;
  double lowest_ = HUGE_VAL;
  double highest_ = 0;
};

// Integral over a piece of the weight times a curvature that is linear from `from` to `to`.
Vector2d RestAngle(const Piece& piece, const Vector2d& from, const Vector2d& to) {
  if (from == to) return piece.Weight() * from;
  const double weight_from = 2 * piece.weight_from + piece.weight_to;
  const double weight_to = piece.weight_from + 2 * piece.weight_to;
  return piece.LengthMm() / 6 * (weight_from * from + weight_to * to);
}

}  // namespace

WireSection SectionAt(const std::vector<WireSection>& sections, double from_tip_mm) {
  if (from_tip_mm <= sections.front().from_tip_mm) return sections.front();
  if (from_tip_mm >= sections.back().from_tip_mm) return sections.back();
  const auto b = std::find_if(sections.begin(), sections.end(),
                              [&](const WireSection& s) { return s.from_tip_mm >= from_tip_mm; });
  const auto a = b - 1;
  const double t = (from_tip_mm - a->from_tip_mm) / (b->from_tip_mm - a->from_tip_mm);
  const auto mix = [t](double p, double q) { return p + t * (q - p); };
  return {from_tip_mm,
          mix(a->rigidity_N_mm2, b->rigidity_N_mm2),
          mix(a->radius_mm, b->radius_mm),
          mix(a->curvature_1_per_mm, b->curvature_1_per_mm),
          mix(a->curvature_2_per_mm, b->curvature_2_per_mm),
          mix(a->torsional_rigidity_N_mm2, b->torsional_rigidity_N_mm2)};
}

JointOfSections IntegrateJoint(const std::vector<WireSection>& sections, double from_tip_mm,
                               double segment_mm) {
  HarmonicMean rigidity;
  HarmonicMean torsional;
  JointOfSections joint;
  const bool twists = sections.front().torsional_rigidity_N_mm2 > 0;
  ForPieces(sections, from_tip_mm, segment_mm, [&](const Piece& piece) {
    const WireSection from = SectionAt(sections, piece.from_mm);
    const WireSection to = SectionAt(sections, piece.to_mm);
    rigidity.Add(piece, from.rigidity_N_mm2, to.rigidity_N_mm2);
    joint.rest_rad += RestAngle(piece, CurvatureOf(from), CurvatureOf(to));
    if (twists) torsional.Add(piece, from.torsional_rigidity_N_mm2, to.torsional_rigidity_N_mm2);
  });
  joint.rigidity_N_mm2 = rigidity.Of(segment_mm);
  if (twists) joint.torsional_rigidity_N_mm2 = torsional.Of(segment_mm);
  return joint;
}

}  // namespace torquer
