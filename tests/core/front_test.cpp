// Front of one or two curves, compared with the dense system assembled from its segments and
// contacts.
#include "host/simulator/core/newton/front.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

namespace torquer::test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Random coefficients of a segment: positive definite joint and load, a frame, any turn.
struct RandomSegment {
  double length_mm;
  Frame frame;
  Vector3d tangent;
  JointTerms joint;
  LoadTerms load;
  TurnTerms turn;
  StackTerms spins;
  double weight_mJ;

  RandomSegment(std::mt19937& random, int spin_count) {
    std::uniform_real_distribution<double> any(-1, 1);
    const auto fill = [&](auto&& m) {
      for (Eigen::Index r = 0; r < m.rows(); ++r) {
        for (Eigen::Index c = 0; c < m.cols(); ++c) m(r, c) = any(random);
      }
    };
    const auto definite = [&](Eigen::Index n) -> MatrixXd {
      MatrixXd root(n, n);
      fill(root);
      return root * root.transpose() + MatrixXd::Identity(n, n);
    };
    length_mm = 1 + 0.5 * any(random);
    Matrix3d axes;
    fill(axes);
    const Matrix3d rotation = Eigen::HouseholderQR<Matrix3d>(axes).householderQ();
    frame = rotation.leftCols<2>();
    tangent = rotation.col(2);
    weight_mJ = 3;

    // The blocks of (xi before, spins before, xi, spins) are positive definite together.
    const Eigen::Index half = 2 + spin_count;
    const MatrixXd joints = definite(2 * half);
    joint.hessian_proximal = joints.topLeftCorner<2, 2>();
    joint.hessian_distal = joints.block<2, 2>(half, half);
    joint.hessian_cross = joints.block<2, 2>(0, half);
    fill(joint.gradient_proximal);
    fill(joint.gradient_distal);
    spins.gradient_proximal.setZero();
    spins.gradient_distal.setZero();
    spins.hessian_proximal.setZero();
    spins.hessian_distal.setZero();
    spins.hessian_cross.setZero();
    spins.proximal_proximal.setZero();
    spins.proximal_distal.setZero();
    spins.distal_proximal.setZero();
    spins.distal_distal.setZero();
    spins.distal_displacement.setZero();
    for (Eigen::Index k = 0; k < spin_count; ++k) {
      spins.gradient_proximal[k] = any(random);
      spins.gradient_distal[k] = any(random);
      // StackTerms couples each proximal spin only with the same spin of the segment.
      spins.hessian_cross[k] = 0.1 * any(random);
      spins.proximal_proximal.row(k) = joints.block<1, 2>(2 + k, 0);
      spins.distal_distal.row(k) = joints.block<1, 2>(half + 2 + k, half);
      spins.proximal_distal.row(k) = 0.1 * joints.block<1, 2>(2 + k, half);
      spins.distal_proximal.row(k) = 0.1 * joints.block<1, 2>(half + 2 + k, 0);
      for (int d = 0; d < 3; ++d) spins.distal_displacement(k, d) = 0.1 * any(random);
      for (Eigen::Index m = 0; m < spin_count; ++m) {
        spins.hessian_proximal(k, m) = joints(2 + k, 2 + m);
        spins.hessian_distal(k, m) = joints(half + 2 + k, half + 2 + m);
      }
    }
    const MatrixXd loads = definite(3);
    load.h0 = loads;
    load.h1 = 0.5 * length_mm * loads;
    load.h2 = 0.3 * length_mm * length_mm * loads;
    fill(load.g0);
    load.g1 = 0.5 * length_mm * load.g0;
    fill(load.f0);
    load.f1 = 0.4 * length_mm * load.f0;
    fill(turn.proximal);
    fill(turn.distal);
    turn.rest.hessian = 1 + any(random);
    turn.rest.gradient = 0;
    fill(turn.rest.with_proximal);
    fill(turn.rest.with_distal);
  }

  FrontSegment Given(int spin_count, bool loaded, bool turns) const {
    FrontSegment given{.length_mm = length_mm, .frame = frame, .tangent = tangent, .joint = joint};
    if (loaded) given.load = &load;
    if (turns && spin_count == 0) given.turn = &turn;
    if (spin_count > 0) given.spins = &spins;
    given.bend_weight_mJ = weight_mJ;
    given.spin_weight_mJ.fill(weight_mJ);
    return given;
  }
};

BetweenCurves::Terms RandomTerms(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  BetweenCurves::Terms terms;
  terms.any = true;
  BetweenCurves::Matrix root;
  for (double& x : root.reshaped()) x = 0.3 * any(random);
  terms.hessian = root * root.transpose();
  for (double& x : terms.gradient) x = any(random);
  for (double& x : terms.force) x = any(random);
  return terms;
}

// Couples the spins of all `instruments` with the steps and with each other.
BetweenCurves::SpinTerms RandomSpinTerms(std::mt19937& random, int instruments) {
  std::uniform_real_distribution<double> any(-1, 1);
  BetweenCurves::SpinTerms terms;
  terms.any = true;
  terms.with_steps.setZero();
  terms.hessian.setZero();
  for (int k = 0; k < instruments; ++k) {
    for (int a = 0; a < 10; ++a) terms.with_steps(k, a) = 0.05 * any(random);
    for (int m = 0; m <= k; ++m) terms.hessian(k, m) = terms.hessian(m, k) = 0.1 * any(random);
    terms.hessian(k, k) += 0.5;
  }
  return terms;
}

// Dense system of all controls; each row of a slot is given as a function of the controls.
class Dense {
 public:
  explicit Dense(Eigen::Index unknowns)
      : hessian(MatrixXd::Zero(unknowns, unknowns)), gradient(VectorXd::Zero(unknowns)) {}

  // Adds a quadratic form in the rows.
  void Add(const MatrixXd& rows, const MatrixXd& h, const VectorXd& g) {
    hessian += rows.transpose() * h * rows;
    gradient += rows.transpose() * g;
  }

  MatrixXd hessian;
  VectorXd gradient;
};

// Rows of one curve from the sheath on, as functions of the controls, at every cut.
struct Rows {
  std::vector<MatrixXd> displacement;  // 3 rows
  std::vector<MatrixXd> step;          // 2 rows, of the previous segment
  std::vector<MatrixXd> roll;          // 1 row or its spins, of the previous segment
};

Rows RowsOf(const std::vector<FrontSegment>& segments, int spins, Eigen::Index first,
            Eigen::Index unknowns) {
  Rows rows;
  const Eigen::Index each = SlotControls(spins);
  const Eigen::Index rolls = std::max(1, spins);
  rows.displacement.emplace_back(MatrixXd::Zero(3, unknowns));
  rows.step.emplace_back(MatrixXd::Zero(2, unknowns));
  rows.roll.emplace_back(MatrixXd::Zero(rolls, unknowns));
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Eigen::Index at = first + each * static_cast<Eigen::Index>(i);
    MatrixXd xi = MatrixXd::Zero(2, unknowns);
    xi.block<2, 2>(0, at).setIdentity();
    MatrixXd roll = MatrixXd::Zero(rolls, unknowns);
    if (spins > 0) {
      roll.block(0, at + 2, spins, spins).setIdentity();
    } else if (segments[i].turn != nullptr) {
      roll = rows.roll.back() + segments[i].turn->proximal.transpose() * rows.step.back() +
             segments[i].turn->distal.transpose() * xi;
    }
    rows.displacement.emplace_back(rows.displacement.back() +
                                   segments[i].length_mm * segments[i].frame * xi);
    rows.step.push_back(xi);
    rows.roll.push_back(roll);
  }
  return rows;
}

MatrixXd Stacked(std::initializer_list<MatrixXd> parts) {
  Eigen::Index count = 0;
  for (const MatrixXd& part : parts) count += part.rows();
  MatrixXd all(count, parts.begin()->cols());
  Eigen::Index at = 0;
  for (const MatrixXd& part : parts) {
    all.middleRows(at, part.rows()) = part;
    at += part.rows();
  }
  return all;
}

// Adds the terms of one curve alone: joints, loads, weights.
void AddCurve(const std::vector<FrontSegment>& segments, const Rows& rows, int spins,
              Dense& dense) {
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const FrontSegment& s = segments[i];
    const MatrixXd joint = Stacked({rows.step[i], rows.step[i + 1]});
    MatrixXd h(4, 4);
    h << s.joint.hessian_proximal, s.joint.hessian_cross, s.joint.hessian_cross.transpose(),
        s.joint.hessian_distal + s.bend_weight_mJ * Eigen::Matrix2d::Identity();
    VectorXd g(4);
    g << s.joint.gradient_proximal, s.joint.gradient_distal;
    dense.Add(joint, h, g);
    if (s.load != nullptr) {
      MatrixXd load(6, 6);
      load << s.load->h0, s.load->h1, s.load->h1.transpose(), s.load->h2;
      VectorXd of(6);
      of << s.load->g0, s.load->g1;
      dense.Add(Stacked({rows.displacement[i], s.frame * rows.step[i + 1]}), load, of);
    }
    if (s.turn != nullptr) {
      const RestSpinTerms& rest = s.turn->rest;
      MatrixXd turn = MatrixXd::Zero(5, 5);
      turn(0, 0) = rest.hessian;
      turn.block<1, 2>(0, 1) = rest.with_proximal.transpose();
      turn.block<1, 2>(0, 3) = rest.with_distal.transpose();
      turn.block<2, 1>(1, 0) = rest.with_proximal;
      turn.block<2, 1>(3, 0) = rest.with_distal;
      dense.Add(Stacked({rows.roll[i], joint}), turn, VectorXd::Zero(5));
    }
    if (spins == 0) continue;
    // (displacement, step before, spins before, step, spins)
    const StackTerms& t = *s.spins;
    const Eigen::Index before = 5;
    const Eigen::Index step = 5 + spins;
    const Eigen::Index own = step + 2;
    MatrixXd all = MatrixXd::Zero(own + spins, own + spins);
    VectorXd of = VectorXd::Zero(own + spins);
    all.block(before, before, spins, spins) = t.hessian_proximal.topLeftCorner(spins, spins);
    all.block(own, own, spins, spins) = t.hessian_distal.topLeftCorner(spins, spins);
    all.block(own, own, spins, spins).diagonal().array() += s.spin_weight_mJ[0];
    all.block(before, own, spins, spins).diagonal() = t.hessian_cross.head(spins);
    all.block(before, 3, spins, 2) = t.proximal_proximal.topRows(spins);
    all.block(before, step, spins, 2) = t.proximal_distal.topRows(spins);
    all.block(own, 3, spins, 2) = t.distal_proximal.topRows(spins);
    all.block(own, step, spins, 2) = t.distal_distal.topRows(spins);
    all.block(own, 0, spins, 3) = t.distal_displacement.topRows(spins);
    of.segment(before, spins) = t.gradient_proximal.head(spins);
    of.segment(own, spins) = t.gradient_distal.head(spins);
    const MatrixXd lower = all.triangularView<Eigen::StrictlyLower>();
    const MatrixXd upper = all.triangularView<Eigen::StrictlyUpper>();
    MatrixXd whole = all.diagonal().asDiagonal();
    // Symmetric blocks are already on both sides.
    for (Eigen::Index r = 0; r < all.rows(); ++r) {
      for (Eigen::Index c = 0; c < r; ++c) {
        whole(r, c) = whole(c, r) = lower(r, c) != 0 ? lower(r, c) : upper(c, r);
      }
    }
    dense.Add(Stacked({rows.displacement[i], rows.step[i], rows.roll[i], rows.step[i + 1],
                       rows.roll[i + 1]}),
              whole, of);
  }
}

// Equation (14): second-order displacement by a step of everything beyond it.
void AddGeometric(const std::vector<FrontSegment>& segments,
                  const std::vector<BetweenCurves::Terms>& terms, Eigen::Index part,
                  const Rows& rows, Dense& dense) {
  Vector3d beyond = Vector3d::Zero();
  for (std::size_t i = segments.size(); i-- > 0;) {
    const FrontSegment& s = segments[i];
    if (i < terms.size()) beyond += terms[i].force.segment<3>(part);
    double along = s.length_mm * beyond.dot(s.tangent);
    if (s.load != nullptr) {
      along += s.load->f1.dot(s.tangent);
      beyond += s.load->f0;
    }
    dense.Add(rows.step[i + 1], -along * Eigen::Matrix2d::Identity(), VectorXd::Zero(2));
  }
}

constexpr int kSegments = 6;
constexpr int kBoth = 4;

// Two curves; `long_slot` has two more segments than the other.
template <int kSpins, int kOtherSpins>
void CheckTwo(int long_slot, unsigned seed) {
  CAPTURE(kSpins, kOtherSpins, long_slot, seed);
  constexpr int kOther = SlotRows(kSpins);
  std::mt19937 random(seed);
  const int count[2] = {long_slot == 0 ? kSegments : kBoth, long_slot == 1 ? kSegments : kBoth};
  const int spins[2] = {kSpins, kOtherSpins};
  std::vector<RandomSegment> numbers[2];
  std::vector<FrontSegment> segments[2];
  Eigen::Index first[2];
  Eigen::Index unknowns = 0;
  for (int c = 0; c < 2; ++c) {
    first[c] = unknowns;
    unknowns += count[c] * SlotControls(spins[c]);
    numbers[c].reserve(kSegments);
    for (int i = 0; i < count[c]; ++i) {
      const RandomSegment& one = numbers[c].emplace_back(random, spins[c]);
      segments[c].push_back(one.Given(spins[c], i % 2 == 0, c == 0));
    }
  }
  std::vector<BetweenCurves::Terms> terms;
  for (int i = 0; i < kBoth; ++i) terms.push_back(RandomTerms(random));
  // Spins of the first slot, then those of the second.
  constexpr int kAllSpins = kSpins + kOtherSpins;
  std::array<int, kMostInstruments> spin_rows;
  spin_rows.fill(-1);
  for (int k = 0; k < kAllSpins; ++k) {
    spin_rows[static_cast<std::size_t>(k)] = k < kSpins ? 5 + k : kOther + 5 + k - kSpins;
  }
  std::vector<BetweenCurves::SpinTerms> spin_terms;
  for (int i = 0; i < kBoth; ++i) spin_terms.push_back(RandomSpinTerms(random, kAllSpins));

  Dense dense(unknowns);
  Rows rows[2];
  for (int c = 0; c < 2; ++c) {
    rows[c] = RowsOf(segments[c], spins[c], first[c], unknowns);
    AddCurve(segments[c], rows[c], spins[c], dense);
    AddGeometric(segments[c], terms, 5 * c, rows[c], dense);
  }
  for (std::size_t i = 0; i < kBoth; ++i) {
    dense.Add(Stacked({rows[0].displacement[i + 1], rows[0].step[i + 1],
                       rows[1].displacement[i + 1], rows[1].step[i + 1]}),
              terms[i].hessian, terms[i].gradient);
    if (kAllSpins == 0) continue;
    MatrixXd coupled = MatrixXd::Zero(10 + kAllSpins, 10 + kAllSpins);
    coupled.bottomLeftCorner(kAllSpins, 10) = spin_terms[i].with_steps.topRows(kAllSpins);
    coupled.topRightCorner(10, kAllSpins) = spin_terms[i].with_steps.topRows(kAllSpins).transpose();
    coupled.bottomRightCorner(kAllSpins, kAllSpins) =
        spin_terms[i].hessian.topLeftCorner(kAllSpins, kAllSpins);
    dense.Add(
        Stacked({rows[0].displacement[i + 1], rows[0].step[i + 1], rows[1].displacement[i + 1],
                 rows[1].step[i + 1], rows[0].roll[i + 1].topRows(kSpins),
                 rows[1].roll[i + 1].topRows(kOtherSpins)}),
        coupled, VectorXd::Zero(10 + kAllSpins));
  }
  const Eigen::LLT<MatrixXd> factor(dense.hessian);
  REQUIRE(factor.info() == Eigen::Success);
  const double decrease = dense.gradient.dot(factor.solve(dense.gradient)) / 2;

  using AnyFront = Front<kOther + SlotRows(kOtherSpins)>;
  AnyFront front;
  FrontGain gain;
  if (long_slot == 0) {
    Front<SlotRows(kSpins)> alone;
    for (int i = kSegments - 1; i >= kBoth; --i) {
      REQUIRE(alone.template Advance<0, 0, kSpins>(segments[0][static_cast<std::size_t>(i)], gain));
    }
    front.template Take<0, 0>(alone);
  } else {
    Front<SlotRows(kOtherSpins)> alone;
    for (int i = kSegments - 1; i >= kBoth; --i) {
      REQUIRE(alone.template Advance<0, 0, kOtherSpins>(segments[1][static_cast<std::size_t>(i)],
                                                        gain));
    }
    front.template Take<1, kOther>(alone);
  }
  for (std::size_t i = kBoth; i-- > 0;) {
    const typename AnyFront::Slots slots{0, 1, 0, kOther};
    front.Touch(terms[i], slots);
    front.Touch(spin_terms[i], slots, spin_rows);
    REQUIRE(front.template Advance<0, 0, kSpins>(segments[0][i], gain));
    REQUIRE(front.template Advance<1, kOther, kOtherSpins>(segments[1][i], gain));
  }
  // Minimum of the quadratic model: it contains all pivots and all gradients.
  CHECK(front.decrease_mJ == Approx(decrease).epsilon(1e-11));
}

TEST_CASE("A front of two curves finds the least of the dense system") {
  const int long_slot = GENERATE(0, 1);
  const unsigned seed = GENERATE(1u, 2u, 3u);
  CheckTwo<0, 0>(long_slot, seed);
  CheckTwo<1, 1>(long_slot, seed);
  CheckTwo<1, 2>(long_slot, seed);
  CheckTwo<1, 3>(long_slot, seed);
  CheckTwo<2, 2>(long_slot, seed);
}

}  // namespace
}  // namespace torquer::test
