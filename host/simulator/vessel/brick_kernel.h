// Value, gradient and Hessian of a quadratic B-spline from its 27 coefficients about a cell.
//
// Along one axis, with coefficients a, b, c of three neighboring cells and t in [-1/2, 1/2] from
// the middle cell's center:
//   s(t) = b + (c - a) t/2 + (a - 2b + c)(t^2/2 + 1/8),  s' = (c - a)/2 + (a - 2b + c) t,
//   s'' = a - 2b + c.
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
/// The last row is read one past its end.
inline constexpr int kCoefficients = kRow * kRow * kRow + 2;

/// Value and derivatives by cell widths; which ones are filled is the caller's order.
struct Jet {
  double value;
  double d[3];   // x, y, z
  double dd[6];  // xx, yy, zz, xy, xz, yz
};

// Four lanes as two SSE registers: without AVX the compiler keeps each in one.
using Pair = double __attribute__((vector_size(16)));
using FloatPair = float __attribute__((vector_size(8)));

struct Quad {
  Pair low, high;
};

inline Pair Widen(const float* two) {
#ifdef __SSE2__
  // GCC 12 makes two scalar conversions and a shuffle of the portable form.
  return _mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(two))));
#else
  FloatPair floats;
  std::memcpy(&floats, two, sizeof floats);
  return __builtin_convertvector(floats, Pair);
#endif
}

inline Quad LoadRow(const float* row) { return {Widen(row), Widen(row + 2)}; }

// One axis at once for all lanes; second may be left out by passing nothing for it.
struct AxisWeights {
  explicit AxisWeights(double at) : t(at), half_t(0.5 * at), curve(0.5 * at * at + 0.125) {}
  double t, half_t, curve;
};

inline Pair Value(const Pair& a, const Pair& b, const Pair& c, const AxisWeights& w) {
  return b + (c - a) * w.half_t + (a - 2.0 * b + c) * w.curve;
}
inline void First(const Pair& a, const Pair& b, const Pair& c, const AxisWeights& w, Pair& value,
                  Pair& first) {
  const Pair difference = c - a, second = a - 2.0 * b + c;
  value = b + difference * w.half_t + second * w.curve;
  first = 0.5 * difference + second * w.t;
}
inline void Second(const Pair& a, const Pair& b, const Pair& c, const AxisWeights& w, Pair& value,
                   Pair& first, Pair& second) {
  const Pair difference = c - a;
  second = a - 2.0 * b + c;
  value = b + difference * w.half_t + second * w.curve;
  first = 0.5 * difference + second * w.t;
}

inline double Value(const Quad& q, const AxisWeights& w) {
  const double a = q.low[0], b = q.low[1], c = q.high[0];
  return b + (c - a) * w.half_t + (a - 2.0 * b + c) * w.curve;
}
inline double First(const Quad& q, const AxisWeights& w) {
  const double a = q.low[0], b = q.low[1], c = q.high[0];
  return 0.5 * (c - a) + (a - 2.0 * b + c) * w.t;
}
inline double Second(const Quad& q) { return q.low[0] - 2.0 * q.low[1] + q.high[0]; }

/// corner: the coefficient of the cell before in x, y and z; tx, ty, tz in [-1/2, 1/2].
template <int kOrder>
inline void Evaluate(const float* corner, double tx, double ty, double tz, Jet& jet) {
  const AxisWeights wx(tx), wy(ty), wz(tz);
  Quad v[3], vz[3], vzz[3];
  for (int y = 0; y < 3; ++y) {
    const float* row = corner + y * kRow;
    const Quad a = LoadRow(row), b = LoadRow(row + kPlane), c = LoadRow(row + 2 * kPlane);
    if constexpr (kOrder == 0) {
      v[y].low = Value(a.low, b.low, c.low, wz);
      v[y].high = Value(a.high, b.high, c.high, wz);
    } else if constexpr (kOrder == 1) {
      First(a.low, b.low, c.low, wz, v[y].low, vz[y].low);
      First(a.high, b.high, c.high, wz, v[y].high, vz[y].high);
    } else {
      Second(a.low, b.low, c.low, wz, v[y].low, vz[y].low, vzz[y].low);
      Second(a.high, b.high, c.high, wz, v[y].high, vz[y].high, vzz[y].high);
    }
  }
  Quad s, sy, sz, syy, syz, szz;
  if constexpr (kOrder == 0) {
    s.low = Value(v[0].low, v[1].low, v[2].low, wy);
    s.high = Value(v[0].high, v[1].high, v[2].high, wy);
  } else if constexpr (kOrder == 1) {
    First(v[0].low, v[1].low, v[2].low, wy, s.low, sy.low);
    First(v[0].high, v[1].high, v[2].high, wy, s.high, sy.high);
    sz.low = Value(vz[0].low, vz[1].low, vz[2].low, wy);
    sz.high = Value(vz[0].high, vz[1].high, vz[2].high, wy);
  } else {
    Second(v[0].low, v[1].low, v[2].low, wy, s.low, sy.low, syy.low);
    Second(v[0].high, v[1].high, v[2].high, wy, s.high, sy.high, syy.high);
    First(vz[0].low, vz[1].low, vz[2].low, wy, sz.low, syz.low);
    First(vz[0].high, vz[1].high, vz[2].high, wy, sz.high, syz.high);
    szz.low = Value(vzz[0].low, vzz[1].low, vzz[2].low, wy);
    szz.high = Value(vzz[0].high, vzz[1].high, vzz[2].high, wy);
  }
  jet.value = Value(s, wx);
  if constexpr (kOrder >= 1) {
    jet.d[0] = First(s, wx);
    jet.d[1] = Value(sy, wx);
    jet.d[2] = Value(sz, wx);
  }
  if constexpr (kOrder >= 2) {
    jet.dd[0] = Second(s);
    jet.dd[1] = Value(syy, wx);
    jet.dd[2] = Value(szz, wx);
    jet.dd[3] = First(sy, wx);
    jet.dd[4] = First(sz, wx);
    jet.dd[5] = Value(syz, wx);
  }
}

}  // namespace torquer::vessel::kernel
