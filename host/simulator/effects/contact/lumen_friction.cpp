#include "host/simulator/effects/contact/lumen_friction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/simulator/core/hash.h"
#include "host/simulator/effects/contact/stick_slip.h"

namespace torquer::effects {

using Eigen::Vector2d;

namespace {

// Reduces an angle to within half a turn of zero.
double Within(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

}  // namespace

LumenFriction::LumenFriction(double coefficient, double slip_mm, const EffectContext& context)
    : coefficient_(coefficient),
      slip_mm_(slip_mm),
      held_(static_cast<std::size_t>(context.stack->curves())) {
  const auto segments = static_cast<std::size_t>(context.wire.max_segments()) + 1;
  const int pieces = LumenPairs::PiecesPerSegment(context.wall.points_per_segment);
  for (std::vector<Held>& held : held_) held.resize(segments * static_cast<std::size_t>(pieces));
}

std::size_t LumenFriction::MemoryOf(const PointSet& points, std::size_t place) {
  return static_cast<std::size_t>(points.segments() * points.lumen_per_segment) - 1 - place;
}

// True if the surfaces are still those of the part's start.
bool LumenFriction::Holds(const Held& held, const LumenContact& contact) {
  return held.limit_N > 0 && contact.inner == held.from.inner && contact.outer == held.from.outer;
}

Vector2d LumenFriction::WayMm(const Held& held, const LumenContact& contact) {
  Vector2d way_mm = held.way_mm;
  way_mm[0] += contact.ahead_mm - held.from.ahead_mm;
  if (Changed(held, contact)) return way_mm;
  way_mm[1] += held.around.dot(contact.offset_mm - held.from.offset_mm) +
               contact.radius_mm * Within(contact.turn_rad - held.from.turn_rad);
  return way_mm;
}

void LumenFriction::Begin(const PointSet& points) {
  const auto in_lumen = points.lumen.size();
  std::vector<Held>& all = HeldOn(points);
  // Places beyond the lumen, or in the sheath, return in another position, so their memory is
  // cleared.
  const std::size_t first = in_lumen == 0 ? all.size() : MemoryOf(points, in_lumen - 1);
  const std::size_t last = in_lumen == 0 ? 0 : MemoryOf(points, 0);
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (k < first || k > last) all[k] = Held();
  }
  for (std::size_t place = 0; place < in_lumen; ++place) {
    const LumenContact& contact = points.lumen[place];
    Held& held = all[MemoryOf(points, place)];
    held.limit_N = coefficient_ * contact.force_N;
    held.from = contact;
    const Vector2d outwards = contact.offset_mm.normalized();
    held.around << -outwards[1], outwards[0];
  }
}

double LumenFriction::Add(const PointSet& points, PointDerivatives& out) const {
  double energy_mJ = 0;
  const std::vector<Held>& all = held_[static_cast<std::size_t>(points.curve)];
  for (std::size_t place = 0; place < points.lumen.size(); ++place) {
    const LumenContact& contact = points.lumen[place];
    const Held& held = all[MemoryOf(points, place)];
    if (!Holds(held, contact)) continue;
    const Vector2d way_mm = WayMm(held, contact);
    const StickSlip law(held.limit_N, slip_mm_, way_mm.squaredNorm());
    energy_mJ += law.energy_mJ;
    SlideLoad load{.place = static_cast<int>(place),
                   .around = held.around,
                   .gradient = law.secant_N_mm * way_mm,
                   .hessian = law.secant_N_mm * Eigen::Matrix2d::Identity() -
                              law.softening_N_mm3 * way_mm * way_mm.transpose()};
    if (Changed(held, contact)) {
      load.gradient[1] = 0;
      load.hessian.row(1).setZero();
      load.hessian.col(1).setZero();
    }
    out.in_lumen.push_back(load);
  }
  return energy_mJ;
}

// Surfaces that do not twist turn with their hands.
void LumenFriction::MoveSurfaces(const PointSet& points,
                                 const std::array<SurfaceMove, kMostInstruments>& moves) {
  std::vector<Held>& all = HeldOn(points);
  for (std::size_t place = 0; place < points.lumen.size(); ++place) {
    Held& held = all[MemoryOf(points, place)];
    if (held.limit_N == 0) continue;
    const SurfaceMove& inner = moves[static_cast<std::size_t>(held.from.inner)];
    const SurfaceMove& outer = moves[static_cast<std::size_t>(held.from.outer)];
    held.way_mm[1] += held.from.radius_mm * inner.turn_rad - held.from.lumen_mm * outer.turn_rad;
  }
}

void LumenFriction::End(const PointSet& points) {
  std::vector<Held>& all = HeldOn(points);
  for (std::size_t place = 0; place < points.lumen.size(); ++place) {
    const LumenContact& contact = points.lumen[place];
    Held& held = all[MemoryOf(points, place)];
    held.way_mm = Holds(held, contact) ? WayMm(held, contact) : Vector2d(Vector2d::Zero());
    const double distance = held.way_mm.norm();
    if (distance > slip_mm_) held.way_mm *= slip_mm_ / distance;
    held.from = contact;
  }
}

void LumenFriction::Reset() {
  for (std::vector<Held>& held : held_) held.assign(held.size(), Held());
}

std::uint64_t LumenFriction::Hash(std::uint64_t seed) const {
  for (const std::vector<Held>& all : held_) {
    for (const Held& held : all) {
      if (held.limit_N == 0) continue;
      for (const double value : {held.limit_N, held.way_mm[0], held.way_mm[1]}) {
        seed = HashDouble(value, seed);
      }
    }
  }
  return seed;
}

}  // namespace torquer::effects
