// Front: the minimum cost of all segments beyond the cuts of its curves, eliminated segment by
// segment (README, section 6).
//
// A front has a slot for each curve. Slot of a curve at cut i, between segments i - 1 and i:
//   dx      displacement of node i                                3 rows
//   eta     step of segment i - 1                                 2 rows
//   roll    turn of segment i - 1 that follows from the steps     1 row, or
//           spin of segment i - 1, of each instrument             kSpins rows
// The curves' cuts are independent. Advance moves one curve to the cut before; Touch couples two
// curves.
#pragma once

#include <Eigen/Core>
#include <array>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/pair.h"
#include "host/simulator/core/stack/between_curves.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// Rows of a slot with `spins` free spins; without any, one row holds the dependent roll.
constexpr int SlotRows(int spins) { return 5 + (spins > 0 ? spins : 1); }
/// Unknowns of a segment: the control.
constexpr int SlotControls(int spins) { return 2 + spins; }

/// Four curves, each with a roll or a spin.
inline constexpr int kMostFrontRows = 6 * kMostInstruments;
inline constexpr int kMostControls = 2 + kMostInstruments;

/// A segment of a curve, with its joint and its loads.
struct FrontSegment {
  double length_mm;
  const Frame& frame;
  const Eigen::Vector3d& tangent;
  const JointTerms& joint;
  const LoadTerms* load = nullptr;  ///< null without load
  const TurnTerms* turn = nullptr;  ///< for a dependent roll; null if all instruments rest straight
  const StackTerms* spins = nullptr;  ///< for free spins
  double bend_weight_mJ = 0;          ///< proximal weight on the step
  PerInstrument spin_weight_mJ = {};  ///< same, on each spin
};

/// Gain of a segment: its control is -(of_slots z + constant), z being the slots at the cut before
/// it.
struct FrontGain {
  double of_slots[kMostControls][kMostFrontRows];
  double constant[kMostControls];
};

/// Inverse of the pivot S of (17).
struct PivotInverse {
  double of[kMostControls][kMostControls];
};

/// Minimum cost of everything beyond the cuts: the quadratic function V(z) = z'P z/2 + g'z of the
/// slots z. `kRows` is the sum of the slots' rows.
template <int kRows>
struct Front {
  static constexpr int kColumns = (kRows + 1) / 2 * 2;  // so that rows are aligned
  alignas(16) double p[kRows][kColumns] = {};
  alignas(16) double g[kColumns] = {};
  /// By slot: sum of the gradients of the loads beyond the cut.
  double force_N[kMostInstruments][3] = {};
  double decrease_mJ = 0;

  /// Eliminates segment i of the curve whose slot, number kSlot, begins at row kAt. The slot moves
  /// from cut i + 1 to cut i. Returns false if the pivot is not positive definite. `inverse`: if
  /// not null, receives the inverse of the pivot.
  template <int kSlot, int kAt, int kSpins>
  bool Advance(const FrontSegment& segment, FrontGain& gain, PivotInverse* inverse = nullptr);

  /// Slots of the inner and the outer of two curves, and their first rows.
  struct Slots {
    int inner;
    int outer;
    int inner_at;
    int outer_at;
  };
  /// Adds the coupling of two curves, each at the cut behind its segment.
  void Touch(const BetweenCurves::Terms& terms, const Slots& slots);

  /// Adds the coupling of spins with steps and with each other. `rows`: row of each instrument's
  /// spin, -1 without.
  void Touch(const BetweenCurves::SpinTerms& terms, const Slots& slots,
             const std::array<int, kMostInstruments>& rows);

  /// Copies the front of one curve, whose slot, number kSlot, begins at row kAt here.
  template <int kSlot, int kAt, int kSlotRows>
  void Take(const Front<kSlotRows>& alone);

 private:
  // Couplings of a segment's control before it is eliminated.
  template <int kControls>
  struct Couplings {
    alignas(16) double f[kControls][kColumns];  // with the slots
    double s[kControls][kControls];             // with itself: the pivot
    double c[kControls];                        // gradient
  };
  // Parts of Advance, separate for readability; inlined, since calls would cost a third of its
  // time.
  template <int kAt, int kSpins>
  [[gnu::always_inline]] inline void Substitute(const FrontSegment& segment,
                                                Couplings<SlotControls(kSpins)>& w) const;
  template <int kAt, int kSpins>
  [[gnu::always_inline]] inline void Renew(const FrontSegment& segment,
                                           Couplings<SlotControls(kSpins)>& w);
  template <int kAt, int kControls>
  [[gnu::always_inline]] inline void AddLoad(const FrontSegment& segment, Couplings<kControls>& w);
  template <int kAt, int kControls>
  [[gnu::always_inline]] inline void AddJoint(const FrontSegment& segment, Couplings<kControls>& w);
  template <int kAt>
  [[gnu::always_inline]] inline void AddTurn(const RestSpinTerms& rest, Couplings<2>& w);
  template <int kAt, int kSpins>
  [[gnu::always_inline]] inline void AddSpins(const FrontSegment& segment,
                                              Couplings<SlotControls(kSpins)>& w);
  template <int kControls>
  static void Invert(const double (&s)[kControls][kControls], const double (&scale)[kControls],
                     PivotInverse& inverse);
  template <int kControls>
  [[gnu::always_inline]] inline bool Eliminate(Couplings<kControls>& w, FrontGain& gain,
                                               PivotInverse* inverse);
};

template <int kRows>
void Front<kRows>::Touch(const BetweenCurves::Terms& terms, const Slots& slots) {
  const int at[2] = {slots.inner_at, slots.outer_at};
  for (int c = 0; c < 2; ++c) {
    for (int a = 0; a < 5; ++a) {
      g[at[c] + a] += terms.gradient[5 * c + a];
      for (int d = 0; d < 2; ++d) {
        for (int b = 0; b < 5; ++b) {
          p[at[c] + a][at[d] + b] += terms.hessian(5 * d + b, 5 * c + a);
        }
      }
    }
  }
  for (int d = 0; d < 3; ++d) {
    force_N[slots.inner][d] += terms.force[d];
    force_N[slots.outer][d] += terms.force[5 + d];
  }
}

template <int kRows>
void Front<kRows>::Touch(const BetweenCurves::SpinTerms& terms, const Slots& slots,
                         const std::array<int, kMostInstruments>& rows) {
  const int at[2] = {slots.inner_at, slots.outer_at};
  for (int k = 0; k < kMostInstruments; ++k) {
    const int row = rows[k];
    if (row < 0) continue;
    for (int c = 0; c < 2; ++c) {
      for (int a = 0; a < 5; ++a) {
        p[row][at[c] + a] += terms.with_steps(k, 5 * c + a);
        p[at[c] + a][row] += terms.with_steps(k, 5 * c + a);
      }
    }
    for (int m = 0; m < kMostInstruments; ++m) {
      const int other = rows[m];
      if (other >= 0) p[row][other] += terms.hessian(k, m);
    }
  }
}

template <int kRows>
template <int kSlot, int kAt, int kSlotRows>
void Front<kRows>::Take(const Front<kSlotRows>& alone) {
  for (int a = 0; a < kSlotRows; ++a) {
    for (int b = 0; b < kSlotRows; ++b) p[kAt + a][kAt + b] = alone.p[a][b];
    g[kAt + a] = alone.g[a];
  }
  for (int d = 0; d < 3; ++d) force_N[kSlot][d] = alone.force_N[0][d];
  decrease_mJ += alone.decrease_mJ;
}

template <int kRows>
template <int kSlot, int kAt, int kSpins>
bool Front<kRows>::Advance(const FrontSegment& segment, FrontGain& gain, PivotInverse* inverse) {
  Couplings<SlotControls(kSpins)> w;
  Substitute<kAt, kSpins>(segment, w);
  Renew<kAt, kSpins>(segment, w);
  double(&beyond_N)[3] = force_N[kSlot];
  double along = 0;  // (14)
  for (int d = 0; d < 3; ++d) along += segment.length_mm * beyond_N[d] * segment.tangent[d];
  if (segment.load != nullptr) {
    AddLoad<kAt>(segment, w);
    along += segment.load->f1.dot(segment.tangent);
    for (int d = 0; d < 3; ++d) beyond_N[d] += segment.load->f0[d];
  }
  for (int a = 0; a < 2; ++a) w.s[a][a] += segment.bend_weight_mJ - along;
  AddJoint<kAt>(segment, w);
  if constexpr (kSpins > 0) {
    AddSpins<kAt, kSpins>(segment, w);
  } else {
    if (segment.turn != nullptr) AddTurn<kAt>(segment.turn->rest, w);
  }
  return Eliminate(w, gain, inverse);
}

// Computes f = B'P, s = B'P B and c = B'g. B puts the control into the slot at cut i + 1. By (15) a
// step moves node i + 1, is the step before the cut, and turns the frame by (36).
template <int kRows>
template <int kAt, int kSpins>
void Front<kRows>::Substitute(const FrontSegment& segment,
                              Couplings<SlotControls(kSpins)>& w) const {
  constexpr int kEta = kAt + 3;
  constexpr int kRoll = kAt + 5;
  constexpr int kControls = SlotControls(kSpins);
  const double* const frame = segment.frame.data();  // by rows
  Pair lever[3];
  for (int d = 0; d < 3; ++d) lever[d] = Both(segment.length_mm) * Load(&frame[2 * d]);
  for (int k = 0; k < kColumns; k += 2) {
    const Pair moved[3] = {Load(&p[kAt][k]), Load(&p[kAt + 1][k]), Load(&p[kAt + 2][k])};
    for (int a = 0; a < 2; ++a) {
      Store(Both(lever[0][a]) * moved[0] + Both(lever[1][a]) * moved[1] +
                Both(lever[2][a]) * moved[2] + Load(&p[kEta + a][k]),
            &w.f[a][k]);
    }
  }
  Store(lever[0] * Both(g[kAt]) + lever[1] * Both(g[kAt + 1]) + lever[2] * Both(g[kAt + 2]) +
            Pair{g[kEta], g[kEta + 1]},
        w.c);
  const bool rolls = kSpins == 0 && segment.turn != nullptr;
  if (rolls) {
    for (int a = 0; a < 2; ++a) {
      const double turn = segment.turn->distal[a];
      for (int k = 0; k < kColumns; k += 2) {
        Store(Load(&w.f[a][k]) + Both(turn) * Load(&p[kRoll][k]), &w.f[a][k]);
      }
      w.c[a] += turn * g[kRoll];
    }
  }
  for (int k = 0; k < kSpins; ++k) {
    for (int m = 0; m < kColumns; m += 2) Store(Load(&p[kRoll + k][m]), &w.f[2 + k][m]);
    w.c[2 + k] = g[kRoll + k];
  }
  for (int a = 0; a < kControls; ++a) {
    const double* const f = w.f[a];
    Store(lever[0] * Both(f[kAt]) + lever[1] * Both(f[kAt + 1]) + lever[2] * Both(f[kAt + 2]) +
              Pair{f[kEta], f[kEta + 1]},
          w.s[a]);
    for (int k = 0; k < kSpins; ++k) w.s[a][2 + k] = f[kRoll + k];
    if (!rolls) continue;
    for (int b = 0; b < 2; ++b) w.s[a][b] += segment.turn->distal[b] * f[kRoll];
  }
}

// Renews the slot at cut i, without the segment's own terms. Node i takes node i + 1 along, and a
// dependent roll continues. No row depends on other steps or spins yet.
template <int kRows>
template <int kAt, int kSpins>
void Front<kRows>::Renew(const FrontSegment& segment, Couplings<SlotControls(kSpins)>& w) {
  constexpr int kEta = kAt + 3;
  constexpr int kRoll = kAt + 5;
  if (kSpins == 0 && segment.turn != nullptr) {
    const Eigen::Vector2d& turn = segment.turn->proximal;
    for (int b = 0; b < 2; ++b) {
      for (int a = 0; a < SlotControls(kSpins); ++a) w.f[a][kEta + b] = turn[b] * w.f[a][kRoll];
      for (int k = 0; k < kRows; ++k) p[kEta + b][k] = p[k][kEta + b] = turn[b] * p[kRoll][k];
      g[kEta + b] = turn[b] * g[kRoll];
    }
    for (int b = 0; b < 2; ++b) {
      for (int d = 0; d < 2; ++d) p[kEta + b][kEta + d] = turn[b] * turn[d] * p[kRoll][kRoll];
    }
    return;
  }
  constexpr int kEnd = kRoll + kSpins;
  for (int a = 0; a < SlotControls(kSpins); ++a) {
    for (int k = kEta; k < kEnd; ++k) w.f[a][k] = 0;
  }
  for (int k = kEta; k < kEnd; ++k) {
    for (int m = 0; m < kRows; ++m) p[k][m] = p[m][k] = 0;
    g[k] = 0;
  }
}

template <int kRows>
template <int kAt, int kControls>
void Front<kRows>::AddLoad(const FrontSegment& segment, Couplings<kControls>& w) {
  const double* const frame = segment.frame.data();
  const LoadTerms& load = *segment.load;
  for (int d = 0; d < 3; ++d) {
    for (int a = 0; a < 2; ++a) {
      w.f[a][kAt + d] +=
          load.h1(d, 0) * frame[a] + load.h1(d, 1) * frame[2 + a] + load.h1(d, 2) * frame[4 + a];
      w.c[a] += frame[2 * d + a] * load.g1[d];
      for (int b = 0; b < 2; ++b) {
        w.s[a][b] += frame[2 * d + a] * (load.h2(d, 0) * frame[b] + load.h2(d, 1) * frame[2 + b] +
                                         load.h2(d, 2) * frame[4 + b]);
      }
    }
    for (int e = 0; e < 3; ++e) p[kAt + d][kAt + e] += load.h0(d, e);
    g[kAt + d] += load.g0[d];
  }
}

template <int kRows>
template <int kAt, int kControls>
void Front<kRows>::AddJoint(const FrontSegment& segment, Couplings<kControls>& w) {
  constexpr int kEta = kAt + 3;
  const JointTerms& joint = segment.joint;
  for (int a = 0; a < 2; ++a) {
    w.c[a] += joint.gradient_distal[a];
    g[kEta + a] += joint.gradient_proximal[a];
    for (int b = 0; b < 2; ++b) {
      w.s[a][b] += joint.hessian_distal(a, b);
      w.f[a][kEta + b] += joint.hessian_cross(b, a);
      p[kEta + a][kEta + b] += joint.hessian_proximal(a, b);
    }
  }
}

// A joint that rests curved depends on the roll before it. The gradient of that is in the gradients
// of the steps.
template <int kRows>
template <int kAt>
void Front<kRows>::AddTurn(const RestSpinTerms& rest, Couplings<2>& w) {
  constexpr int kEta = kAt + 3;
  constexpr int kRoll = kAt + 5;
  for (int a = 0; a < 2; ++a) {
    w.f[a][kRoll] += rest.with_distal[a];
    p[kEta + a][kRoll] += rest.with_proximal[a];
    p[kRoll][kEta + a] += rest.with_proximal[a];
  }
  p[kRoll][kRoll] += rest.hessian;
}

template <int kRows>
template <int kAt, int kSpins>
void Front<kRows>::AddSpins(const FrontSegment& segment, Couplings<SlotControls(kSpins)>& w) {
  constexpr int kEta = kAt + 3;
  constexpr int kRoll = kAt + 5;
  const StackTerms& spins = *segment.spins;
  // Reads these values before it writes p and g. Otherwise the compiled code tests if they overlap.
  double rest[kSpins][kSpins];
  double with_step[kSpins][2];
  double gradient[kSpins];
  for (int k = 0; k < kSpins; ++k) {
    gradient[k] = spins.gradient_proximal[k];
    for (int a = 0; a < 2; ++a) with_step[k][a] = spins.proximal_proximal(k, a);
    for (int m = 0; m < kSpins; ++m) rest[k][m] = spins.hessian_proximal(k, m);
    w.c[2 + k] += spins.gradient_distal[k];
    w.s[2 + k][2 + k] += segment.spin_weight_mJ[k];
    w.f[2 + k][kRoll + k] += spins.hessian_cross[k];
    for (int d = 0; d < 3; ++d) w.f[2 + k][kAt + d] += spins.distal_displacement(k, d);
    for (int a = 0; a < 2; ++a) {
      w.s[2 + k][a] += spins.distal_distal(k, a);
      w.f[2 + k][kEta + a] += spins.distal_proximal(k, a);
      w.f[a][kRoll + k] += spins.proximal_distal(k, a);
    }
    for (int m = 0; m < kSpins; ++m) w.s[2 + k][2 + m] += spins.hessian_distal(k, m);
  }
  for (int k = 0; k < kSpins; ++k) {
    g[kRoll + k] += gradient[k];
    for (int a = 0; a < 2; ++a) {
      p[kRoll + k][kEta + a] += with_step[k][a];
      p[kEta + a][kRoll + k] += with_step[k][a];
    }
    for (int m = 0; m < kSpins; ++m) p[kRoll + k][kRoll + m] += rest[k][m];
  }
}

// Inverts L D L'; `s` has L D below its diagonal, `scale` the inverse of D.
template <int kRows>
template <int kControls>
void Front<kRows>::Invert(const double (&s)[kControls][kControls], const double (&scale)[kControls],
                          PivotInverse& inverse) {
  for (int column = 0; column < kControls; ++column) {
    double unit[kControls] = {};
    unit[column] = 1;
    for (int k = 0; k < kControls; ++k) {
      for (int m = 0; m < k; ++m) unit[k] -= s[k][m] * scale[m] * unit[m];
    }
    for (int k = kControls - 1; k >= 0; --k) {
      unit[k] *= scale[k];
      for (int m = k + 1; m < kControls; ++m) unit[k] -= s[m][k] * scale[k] * unit[m];
      inverse.of[k][column] = unit[k];
    }
  }
}

// Finds the optimal control (20), and the remaining cost (21), (22). The pivot is L D L', and s
// keeps L D below its diagonal.
template <int kRows>
template <int kControls>
bool Front<kRows>::Eliminate(Couplings<kControls>& w, FrontGain& gain, PivotInverse* inverse) {
  constexpr int kPairs = kColumns / 2;
  Pair solved[kControls][kPairs];
  double scale[kControls];
  for (int k = 0; k < kControls; ++k) {
    Pair row[kPairs];
    for (int r = 0; r < kPairs; ++r) row[r] = Load(&w.f[k][2 * r]);
    double pivot = w.s[k][k];
    for (int m = 0; m < k; ++m) {
      const double factor = w.s[k][m] * scale[m];
      pivot -= factor * w.s[k][m];
      for (int r = k + 1; r < kControls; ++r) w.s[r][k] -= factor * w.s[r][m];
      for (int r = 0; r < kPairs; ++r) row[r] -= Both(factor) * Load(&w.f[m][2 * r]);
      w.c[k] -= factor * w.c[m];
    }
    // A relative test: it rejects a pivot that is zero up to rounding.
    if (!(w.s[k][k] > 0) || !(pivot > 1e-12 * w.s[k][k])) return false;
    scale[k] = 1 / pivot;
    for (int r = 0; r < kPairs; ++r) {
      Store(row[r], &w.f[k][2 * r]);
      solved[k][r] = Both(scale[k]) * row[r];
    }
    gain.constant[k] = scale[k] * w.c[k];
    decrease_mJ += w.c[k] * gain.constant[k] / 2;
  }
  // Updates the whole matrix, not only its upper half: g++ 12 miscompiles the copy from one half to
  // the other.
  for (int r = 0; r < kRows; ++r) {
    for (int m = 0; m < kPairs; ++m) {
      Pair sum = Both(w.f[0][r]) * solved[0][m];
      for (int k = 1; k < kControls; ++k) sum += Both(w.f[k][r]) * solved[k][m];
      Store(Load(&p[r][2 * m]) - sum, &p[r][2 * m]);
    }
  }
  for (int r = 0; r < kColumns; r += 2) {
    Pair left = Load(&g[r]);
    for (int k = 0; k < kControls; ++k) left -= Load(&w.f[k][r]) * Both(gain.constant[k]);
    Store(left, &g[r]);
  }
  for (int k = kControls - 1; k >= 0; --k) {
    for (int m = k + 1; m < kControls; ++m) {
      const double factor = w.s[m][k] * scale[k];
      for (int r = 0; r < kPairs; ++r) solved[k][r] -= Both(factor) * solved[m][r];
      gain.constant[k] -= factor * gain.constant[m];
    }
    for (int r = 0; r < kPairs; ++r) Store(solved[k][r], &gain.of_slots[k][2 * r]);
  }
  if (inverse != nullptr) Invert<kControls>(w.s, scale, *inverse);
  return true;
}

}  // namespace torquer
