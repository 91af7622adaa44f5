// Value, gradient and Hessian of a quadratic B-spline from its 27 coefficients about a cell.
//
// One axis has coefficients a, b, c of three neighboring cells. The place t in [-1/2, 1/2] counts
// from the middle cell's center. With p = a - b and q = c - b:
//   s = b + p (1/2 - t)^2 / 2 + q (1/2 + t)^2 / 2,  s' = p (t - 1/2) + q (t + 1/2),  s'' = p + q.
#pragma once

#include <cstring>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace torquer::vessel::kernel {

/// Coefficients of a brick: kCells^3 cells and one more on every side, x fastest.
inline constexpr int kCells = 8;
inline constexpr int kRow = kCells + 2;
inline constexpr int kPlane = kRow * kRow;
/// Padded, because the last row is read one past its end.
inline constexpr int kCoefficients = kRow * kRow * kRow + 2;

/// Value and derivatives with respect to cell widths, filled up to kOrder of Evaluate.
struct Jet {
  double value;
  double d[3];   // x, y, z
  double dd[6];  // xx, yy, zz, xy, xz, yz
};

// Four lanes in two SSE registers: without AVX, the compiler keeps each Pair in one register.
using Pair = double __attribute__((vector_size(16)));
using FloatPair = float __attribute__((vector_size(8)));

struct Quad {
  Pair low, high;
};

inline Pair Widen(const float* two) {
#ifdef __SSE2__
  // GCC 12 compiles the portable form to two scalar conversions and a shuffle.
  return _mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(two))));
#else
  FloatPair floats;
  std::memcpy(&floats, two, sizeof floats);
  return __builtin_convertvector(floats, Pair);
#endif
}

inline Quad LoadRow(const float* row) { return {Widen(row), Widen(row + 2)}; }

struct AxisWeights {
  explicit AxisWeights(double t)
      : first_p(t - 0.5),
        first_q(t + 0.5),
        value_p(0.5 * first_p * first_p),
        value_q(0.5 * first_q * first_q) {}
  double first_p, first_q, value_p, value_q;
};

// Contracts one axis for all lanes of a vector, up to a derivative.
template <typename Vector>
inline void Contract(const Vector& a, const Vector& b, const Vector& c, const AxisWeights& w,
                     Vector& value) {
  value = b + (a - b) * w.value_p + (c - b) * w.value_q;
}
template <typename Vector>
inline void Contract(const Vector& a, const Vector& b, const Vector& c, const AxisWeights& w,
                     Vector& value, Vector& first) {
  const Vector p = a - b, q = c - b;
  value = b + p * w.value_p + q * w.value_q;
  first = p * w.first_p + q * w.first_q;
}
template <typename Vector>
inline void Contract(const Vector& a, const Vector& b, const Vector& c, const AxisWeights& w,
                     Vector& value, Vector& first, Vector& second) {
  const Vector p = a - b, q = c - b;
  value = b + p * w.value_p + q * w.value_q;
  first = p * w.first_p + q * w.first_q;
  second = p + q;
}

inline Pair Lows(const Pair& a, const Pair& b) { return Pair{a[0], b[0]}; }
inline Pair Highs(const Pair& a, const Pair& b) { return Pair{a[1], b[1]}; }

// Contracts the x axis of two rows at once, lane by lane.
inline void ContractRows(const Quad& one, const Quad& two, const AxisWeights& w, Pair& value) {
  Contract(Lows(one.low, two.low), Highs(one.low, two.low), Lows(one.high, two.high), w, value);
}
inline void ContractRows(const Quad& one, const Quad& two, const AxisWeights& w, Pair& value,
                         Pair& first) {
  Contract(Lows(one.low, two.low), Highs(one.low, two.low), Lows(one.high, two.high), w, value,
           first);
}

/// `corner`: coefficient of the previous cell in x, y and z. `tx`, `ty`, `tz`: place in the cell,
/// -1/2 to 1/2.
template <int kOrder>
inline void Evaluate(const float* corner, double tx, double ty, double tz, Jet& jet) {
  const AxisWeights wx(tx), wy(ty), wz(tz);
  Quad v[3], vz[3], vzz[3];
  for (int y = 0; y < 3; ++y) {
    const float* row = corner + y * kRow;
    const Quad a = LoadRow(row), b = LoadRow(row + kPlane), c = LoadRow(row + 2 * kPlane);
    if constexpr (kOrder == 0) {
      Contract(a.low, b.low, c.low, wz, v[y].low);
      Contract(a.high, b.high, c.high, wz, v[y].high);
    } else if constexpr (kOrder == 1) {
      Contract(a.low, b.low, c.low, wz, v[y].low, vz[y].low);
      Contract(a.high, b.high, c.high, wz, v[y].high, vz[y].high);
    } else {
      Contract(a.low, b.low, c.low, wz, v[y].low, vz[y].low, vzz[y].low);
      Contract(a.high, b.high, c.high, wz, v[y].high, vz[y].high, vzz[y].high);
    }
  }
  Quad s, sy, sz;
  if constexpr (kOrder == 0) {
    Contract(v[0].low, v[1].low, v[2].low, wy, s.low);
    Contract(v[0].high, v[1].high, v[2].high, wy, s.high);
    Contract(s.low[0], s.low[1], s.high[0], wx, jet.value);
  } else if constexpr (kOrder == 1) {
    Contract(v[0].low, v[1].low, v[2].low, wy, s.low, sy.low);
    Contract(v[0].high, v[1].high, v[2].high, wy, s.high, sy.high);
    Contract(vz[0].low, vz[1].low, vz[2].low, wy, sz.low);
    Contract(vz[0].high, vz[1].high, vz[2].high, wy, sz.high);
    Contract(s.low[0], s.low[1], s.high[0], wx, jet.value, jet.d[0]);
    Pair yz;
    ContractRows(sy, sz, wx, yz);
    jet.d[1] = yz[0];
    jet.d[2] = yz[1];
  } else {
    Quad syy, syz, szz;
    Contract(v[0].low, v[1].low, v[2].low, wy, s.low, sy.low, syy.low);
    Contract(v[0].high, v[1].high, v[2].high, wy, s.high, sy.high, syy.high);
    Contract(vz[0].low, vz[1].low, vz[2].low, wy, sz.low, syz.low);
    Contract(vz[0].high, vz[1].high, vz[2].high, wy, sz.high, syz.high);
    Contract(vzz[0].low, vzz[1].low, vzz[2].low, wy, szz.low);
    Contract(vzz[0].high, vzz[1].high, vzz[2].high, wy, szz.high);
    Contract(s.low[0], s.low[1], s.high[0], wx, jet.value, jet.d[0], jet.dd[0]);
    Pair yz, xy_xz, yy_zz;
    ContractRows(sy, sz, wx, yz, xy_xz);
    ContractRows(syy, szz, wx, yy_zz);
    jet.d[1] = yz[0];
    jet.d[2] = yz[1];
    jet.dd[1] = yy_zz[0];
    jet.dd[2] = yy_zz[1];
    jet.dd[3] = xy_xz[0];
    jet.dd[4] = xy_xz[1];
    Contract(syz.low[0], syz.low[1], syz.high[0], wx, jet.dd[5]);
  }
}

}  // namespace torquer::vessel::kernel
