#include "host/simulator/core/wire_sections.h"

#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector2d;

namespace {

// A step between sections has a short length. If it begins at a joint, the next hat contains only
// this small part. Then the next joint rests straight.
constexpr double kStraightRad = 1e-12;

Vector2d CurvatureOf(const WireSection& section) {
  return {section.curvature_1_per_mm, section.curvature_2_per_mm};
}

// First section end of an instrument beyond a place, at most `before_mm`. Its tip is at
// `behind_mm`.
double NextEnd(const std::vector<WireSection>& sections, double behind_mm, double from_mm,
               double before_mm) {
  const auto next = std::upper_bound(
      sections.begin(), sections.end(), from_mm,
      [&](double mm, const WireSection& s) { return mm < behind_mm + s.from_tip_mm; });
  return next == sections.end() ? before_mm : std::min(behind_mm + next->from_tip_mm, before_mm);
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

// Calls `each` with the pieces of the hat of a joint. `next_kink(from, before)` returns the first
// place beyond `from` at which a property has a kink or a step, at most `before`.
template <class NextKink, class Each>
void ForPieces(double joint_mm, double segment_mm, const NextKink& next_kink, const Each& each) {
  double from_mm = joint_mm - segment_mm;
  double weight_from = 0;
  for (const bool rises : {true, false}) {
    const double half_mm = rises ? joint_mm : joint_mm + segment_mm;
    while (from_mm < half_mm) {
      const double to_mm = next_kink(from_mm, half_mm);
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
  // Integrals of 1 / (1 + r t) and t / (1 + r t) over t = 0 .. 1, r = to / from - 1.
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

// A member in a piece: EI and rest curvature, linear from one end to the other.
struct Linear {
  double rigidity_from;
  double rigidity_to;
  Vector2d curvature_from;
  Vector2d curvature_to;

  bool Curved() const { return !curvature_from.isZero(0) || !curvature_to.isZero(0); }
  bool Constant() const { return rigidity_from == rigidity_to && curvature_from == curvature_to; }
};

// The members that reach a piece.
struct Present {
  std::array<Linear, kMostInstruments> of;
  std::size_t count = 0;
  double sum_from = 0;  // of EI
  double sum_to = 0;
  bool curved = false;
  bool constant = true;

  void Add(const WireSection& from, const WireSection& to) {
    const Linear added{from.rigidity_N_mm2, to.rigidity_N_mm2, CurvatureOf(from), CurvatureOf(to)};
    of[count++] = added;
    sum_from += added.rigidity_from;
    sum_to += added.rigidity_to;
    curved = curved || added.Curved();
    constant = constant && added.Constant();
  }
};

// Adds the integrands at the fraction `t` of a piece. `weight_mm`: of the hat times length.
void AddAt(const Present& present, double t, double weight_mm, JointIntegrals& out) {
  const double sum = present.sum_from + t * (present.sum_to - present.sum_from);
  std::array<double, kMostInstruments> rigidity;
  std::array<Vector2d, kMostInstruments> curvature;
  for (std::size_t m = 0; m < present.count; ++m) {
    const Linear& own = present.of[m];
    rigidity[m] = own.rigidity_from + t * (own.rigidity_to - own.rigidity_from);
    const double part_mm = weight_mm * (rigidity[m] / sum);
    out.share[m] += part_mm;
    if (!present.curved) continue;
    curvature[m] = own.curvature_from + t * (own.curvature_to - own.curvature_from);
    out.bend_rad[m] += part_mm * curvature[m];
    for (std::size_t k = 0; k < m; ++k) {
      const double both = part_mm * rigidity[k];
      const Vector2d& a = curvature[k];
      const Vector2d& b = curvature[m];
      JointIntegrals::Pair& pair = out.pairs[k][m];
      pair.constant_mJ += both * (a.squaredNorm() + b.squaredNorm()) / 2;
      pair.along_mJ += both * a.dot(b);
      pair.across_mJ += both * (a[1] * b[0] - a[0] * b[1]);
      pair.of_a_mJ_mm += both * a;
      pair.of_b_mJ_mm += both * b;
    }
  }
}

// Adds a piece. Constant members need one place; others get Gauss-Legendre with four, which is
// exact for one member.
void AddPiece(const Present& present, const Piece& piece, JointIntegrals& out) {
  if (present.constant) {
    AddAt(present, 0, piece.Weight(), out);
    return;
  }
  constexpr double kPlaces[] = {0.0694318442029737124, 0.330009478207571868, 0.669990521792428132,
                                0.930568155797026288};
  constexpr double kWeights[] = {0.173927422568726929, 0.326072577431273071, 0.326072577431273071,
                                 0.173927422568726929};
  for (std::size_t g = 0; g < 4; ++g) {
    const double t = kPlaces[g];
    const double weight = piece.weight_from + t * (piece.weight_to - piece.weight_from);
    AddAt(present, t, piece.LengthMm() * kWeights[g] * weight, out);
  }
}

}  // namespace

WireSection SectionAt(const std::vector<WireSection>& sections, double from_tip_mm) {
  if (from_tip_mm <= sections.front().from_tip_mm) return sections.front();
  if (from_tip_mm >= sections.back().from_tip_mm) return sections.back();
  const auto b =
      std::lower_bound(sections.begin(), sections.end(), from_tip_mm,
                       [](const WireSection& s, double mm) { return s.from_tip_mm < mm; });
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

RodJoints::RodJoints(const std::vector<WireSection>& sections, double segment_mm)
    : RodJoints({Member{&sections, 0}}, 1, segment_mm) {}

RodJoints::RodJoints(const std::array<Member, kMostInstruments>& members, int count,
                     double segment_mm)
    : members_(members),
      count_(static_cast<std::size_t>(count)),
      segment_mm_(segment_mm),
      uniform_from_mm_(0),
      none_ends_until_mm_(HUGE_VAL),
      none_ends_from_mm_(0) {
  members_[0].until_mm = HUGE_VAL;
  for (std::size_t m = 0; m < count_; ++m) {
    const Member& member = members_[m];
    uniform_from_mm_ =
        std::max(uniform_from_mm_, member.behind_mm + member.sections->back().from_tip_mm);
    if (std::isinf(member.until_mm)) continue;
    none_ends_until_mm_ = std::min(none_ends_until_mm_, member.until_mm);
    none_ends_from_mm_ = std::max(none_ends_from_mm_, member.until_mm);
  }
}

double RodJoints::NextKink(double from_mm, double before_mm) const {
  for (std::size_t m = 0; m < count_; ++m) {
    const Member& member = members_[m];
    if (member.until_mm <= std::max(from_mm, member.behind_mm)) continue;
    if (m > 0 && member.behind_mm > from_mm) return std::min(before_mm, member.behind_mm);
    before_mm =
        NextEnd(*member.sections, member.behind_mm, from_mm, std::min(before_mm, member.until_mm));
  }
  return before_mm;
}

const JointIntegrals& RodJoints::At(int from_tip) {
  const double joint_mm = from_tip * segment_mm_;
  const bool uniform = joint_mm - segment_mm_ >= uniform_from_mm_ &&
                       (joint_mm + segment_mm_ <= none_ends_until_mm_ ||
                        joint_mm - segment_mm_ >= none_ends_from_mm_);
  if (uniform && uniform_) return joint_;
  uniform_ = uniform;
  joint_ = JointIntegrals();
  joint_.bend_rad.fill(Vector2d::Zero());
  HarmonicMean mean;
  const auto next_kink = [this](double from_mm, double before_mm) {
    return NextKink(from_mm, before_mm);
  };
  ForPieces(joint_mm, segment_mm_, next_kink, [&](const Piece& piece) {
    Present present;
    for (std::size_t m = 0; m < count_; ++m) {
      const Member& member = members_[m];
      // The first member continues beyond the rod's end, for the half hat of the last joint.
      if (m > 0 && member.behind_mm > piece.from_mm) break;
      if (member.until_mm <= piece.from_mm) continue;
      present.Add(SectionAt(*member.sections, piece.from_mm - member.behind_mm),
                  SectionAt(*member.sections, piece.to_mm - member.behind_mm));
    }
    mean.Add(piece, present.sum_from, present.sum_to);
    AddPiece(present, piece, joint_);
  });
  joint_.rigidity_N_mm2 = mean.Of(segment_mm_);
  for (double& share : joint_.share) share /= segment_mm_;
  for (Vector2d& bend_rad : joint_.bend_rad) {
    if (bend_rad.norm() < kStraightRad) bend_rad.setZero();
  }
  return joint_;
}

double EndInSheath(double behind_mm, double inserted_mm, double segment_mm) {
  return inserted_mm < 2 * segment_mm ? behind_mm + 2 * inserted_mm : HUGE_VAL;
}

double JointTorsionalRigidity(const std::vector<WireSection>& sections, double from_tip_mm,
                              double segment_mm) {
  const WireSection& last = sections.back();
  if (last.torsional_rigidity_N_mm2 == 0 || from_tip_mm - segment_mm >= last.from_tip_mm) {
    return last.torsional_rigidity_N_mm2;
  }
  HarmonicMean mean;
  const auto next_kink = [&](double from_mm, double before_mm) {
    return NextEnd(sections, 0, from_mm, before_mm);
  };
  ForPieces(from_tip_mm, segment_mm, next_kink, [&](const Piece& piece) {
    mean.Add(piece, SectionAt(sections, piece.from_mm).torsional_rigidity_N_mm2,
             SectionAt(sections, piece.to_mm).torsional_rigidity_N_mm2);
  });
  return mean.Of(segment_mm);
}

}  // namespace torquer
