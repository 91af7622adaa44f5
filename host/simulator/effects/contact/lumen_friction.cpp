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
  for (auto& sides : held_) {
    for (std::vector<Held>& held : sides) held.resize(segments * static_cast<std::size_t>(pieces));
  }
}

std::array<LumenFriction::Side, LumenFriction::kSides> LumenFriction::SidesOf(
    const PointSet& points) {
  auto& held = held_[static_cast<std::size_t>(points.among.curve)];
  const auto pieces = static_cast<std::size_t>(points.segments() * points.between.per_segment);
  return {{{points.between.lumen, held[0], pieces}, {points.between.beside, held[1], pieces}}};
}

// True if the surfaces are still those of the part's start.
bool LumenFriction::Holds(const Held& held, const LumenContact& contact) {
  return held.limit_N > 0 && contact.inner == held.from.inner && contact.outer == held.from.outer;
}

Vector2d LumenFriction::SlidMm(const Held& held, const LumenContact& contact) {
  Vector2d slid_mm = held.slid_mm;
  slid_mm[0] += contact.ahead_mm - held.from.ahead_mm;
  if (Changed(held, contact)) return slid_mm;
  slid_mm[1] += held.around.dot(contact.offset_mm - held.from.offset_mm) +
                contact.lever_mm * Within(contact.turn_rad - held.from.turn_rad);
  return slid_mm;
}

void LumenFriction::BeginSide(const Side& side, double coefficient) {
  const std::size_t places = side.contacts.size();
  // Places beyond the last one, or in the sheath, return in another position, so their memory is
  // cleared.
  const std::size_t first = places == 0 ? side.held.size() : side.MemoryOf(places - 1);
  const std::size_t last = places == 0 ? 0 : side.MemoryOf(0);
  for (std::size_t k = 0; k < side.held.size(); ++k) {
    if (k < first || k > last) side.held[k] = Held();
  }
  for (std::size_t place = 0; place < places; ++place) {
    const LumenContact& contact = side.contacts[place];
    Held& held = side.HeldAt(place);
    held.limit_N = coefficient * contact.force_N;
    held.from = contact;
    const Vector2d outwards = contact.offset_mm.normalized();
    held.around << -outwards[1], outwards[0];
  }
}

void LumenFriction::Begin(const PointSet& points) {
  for (const Side& side : SidesOf(points)) BeginSide(side, coefficient_);
}

// Load of a place without its number. Returns the energy, mJ.
double LumenFriction::AddPlace(const Held& held, const LumenContact& contact,
                               SlideLoad& load) const {
  const Vector2d slid_mm = SlidMm(held, contact);
  const StickSlip law(held.limit_N, slip_mm_, slid_mm.squaredNorm());
  load.around = held.around;
  load.gradient = law.secant_N_mm * slid_mm;
  load.hessian = law.secant_N_mm * Eigen::Matrix2d::Identity() -
                 law.softening_N_mm3 * slid_mm * slid_mm.transpose();
  if (Changed(held, contact)) {
    load.gradient[1] = 0;
    load.hessian.row(1).setZero();
    load.hessian.col(1).setZero();
  }
  return law.energy_mJ;
}

double LumenFriction::Add(const PointSet& points, PointDerivatives& out) const {
  const auto pieces = static_cast<std::size_t>(points.segments() * points.between.per_segment);
  const auto& held_by_side = held_[static_cast<std::size_t>(points.among.curve)];
  double energy_mJ = 0;
  for (std::size_t side = 0; side < kSides; ++side) {
    const std::vector<LumenContact>& contacts =
        side == 0 ? points.between.lumen : points.between.beside;
    std::vector<SlideLoad>& loads = side == 0 ? out.in_lumen : out.beside;
    for (std::size_t place = 0; place < contacts.size(); ++place) {
      const Held& held = held_by_side[side][pieces - 1 - place];
      if (!Holds(held, contacts[place])) continue;
      SlideLoad& load = loads.emplace_back();
      load.place = static_cast<int>(place);
      energy_mJ += AddPlace(held, contacts[place], load);
    }
  }
  return energy_mJ;
}

// Surfaces that do not twist turn with their hands.
void LumenFriction::MoveSurfaces(const PointSet& points,
                                 const std::array<SurfaceMove, kMostInstruments>& moves) {
  for (const Side& side : SidesOf(points)) {
    for (std::size_t place = 0; place < side.contacts.size(); ++place) {
      Held& held = side.HeldAt(place);
      if (held.limit_N == 0) continue;
      const SurfaceMove& inner = moves[static_cast<std::size_t>(held.from.inner)];
      const SurfaceMove& outer = moves[static_cast<std::size_t>(held.from.outer)];
      held.slid_mm[1] += held.from.lever_mm * inner.turn_rad - held.from.lumen_mm * outer.turn_rad;
    }
  }
}

void LumenFriction::End(const PointSet& points) {
  for (const Side& side : SidesOf(points)) {
    for (std::size_t place = 0; place < side.contacts.size(); ++place) {
      const LumenContact& contact = side.contacts[place];
      Held& held = side.HeldAt(place);
      held.slid_mm = Holds(held, contact) ? SlidMm(held, contact) : Vector2d(Vector2d::Zero());
      const double distance = held.slid_mm.norm();
      if (distance > slip_mm_) held.slid_mm *= slip_mm_ / distance;
      held.from = contact;
    }
  }
}

void LumenFriction::Reset() {
  for (auto& sides : held_) {
    for (std::vector<Held>& held : sides) held.assign(held.size(), Held());
  }
}

std::uint64_t LumenFriction::Hash(std::uint64_t seed) const {
  for (const auto& sides : held_) {
    for (const std::vector<Held>& all : sides) {
      for (const Held& held : all) {
        if (held.limit_N == 0) continue;
        for (const double value : {held.limit_N, held.slid_mm[0], held.slid_mm[1]}) {
          seed = HashDouble(value, seed);
        }
      }
    }
  }
  return seed;
}

}  // namespace torquer::effects
