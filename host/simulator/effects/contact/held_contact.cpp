#include "host/simulator/effects/contact/held_contact.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "host/simulator/core/hash.h"
#include "host/simulator/effects/contact/stick_slip.h"

namespace torquer::effects {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Reduces an angle to within half a turn of zero.
double WithinHalfATurn(double angle_rad) { return std::remainder(angle_rad, 2 * std::numbers::pi); }

}  // namespace

bool HeldContact::Holds(const LumenContact& contact) const {
  return limit_N_ > 0 && contact.inner == from_.inner && contact.outer == from_.outer;
}

// From the inner axis to the contact, in the axes of the outer surface, at the part's start.
Vector3d HeldContact::LeverMm() const {
  return from_.lever_mm * Vector3d(0, around_[1], -around_[0]);
}

// The same now: it has turned with the inner surface.
Vector3d HeldContact::LeverMm(const LumenContact& contact) const {
  return contact.inner_axes * (from_.inner_axes.transpose() * LeverMm());
}

// (52). The place may have moved along the inner material since the part's start.
Vector2d HeldContact::SlidBesideMm(const LumenContact& contact) const {
  const Vector3d inward = from_.inner_axes.col(0);
  const double moved_mm = contact.inner_mm - from_.inner_mm;
  Vector2d slid_mm = slid_mm_;
  slid_mm[0] += contact.ahead_mm - from_.ahead_mm + (1 - inward[0]) * moved_mm;
  if (Changed(contact)) return slid_mm;
  const Vector3d turned_mm = LeverMm(contact) - LeverMm();
  const Vector2d across_mm =
      contact.offset_mm - from_.offset_mm + turned_mm.tail<2>() - moved_mm * inward.tail<2>();
  slid_mm[0] += turned_mm[0];
  slid_mm[1] += around_.dot(across_mm);
  return slid_mm;
}

Vector2d HeldContact::SlidMm(const LumenContact& contact) const {
  if (IsBeside()) return SlidBesideMm(contact);
  Vector2d slid_mm = slid_mm_;
  slid_mm[0] += contact.ahead_mm - from_.ahead_mm;
  if (Changed(contact)) return slid_mm;
  slid_mm[1] += around_.dot(contact.offset_mm - from_.offset_mm) +
                contact.lever_mm * WithinHalfATurn(contact.turn_rad - from_.turn_rad);
  return slid_mm;
}

void HeldContact::Begin(const LumenContact& contact, double coefficient) {
  limit_N_ = coefficient * contact.force_N;
  from_ = contact;
  const Vector2d outwards = contact.offset_mm.normalized();
  around_ << -outwards[1], outwards[0];
}

double HeldContact::Add(const LumenContact& contact, double slip_mm, SlideLoad& load) const {
  const Vector2d slid_mm = SlidMm(contact);
  const StickSlip law(limit_N_, slip_mm, slid_mm.squaredNorm());
  load.around = around_;
  load.gradient = law.secant_N_mm * slid_mm;
  load.hessian = law.secant_N_mm * Eigen::Matrix2d::Identity() -
                 law.softening_N_mm3 * slid_mm * slid_mm.transpose();
  const bool changed = Changed(contact);
  load.lever_mm = IsBeside() && !changed ? LeverMm(contact) : Vector3d(Vector3d::Zero());
  if (changed) {
    load.gradient[1] = 0;
    load.hessian.row(1).setZero();
    load.hessian.col(1).setZero();
  }
  return law.energy_mJ;
}

void HeldContact::MoveSurfaces(const std::array<SurfaceMove, kMostInstruments>& moves) {
  if (limit_N_ == 0) return;
  const double inner_rad = moves[static_cast<std::size_t>(from_.inner)].turn_rad;
  const double outer_rad = moves[static_cast<std::size_t>(from_.outer)].turn_rad;
  if (IsBeside()) {
    const Vector3d inner_mm = inner_rad * from_.inner_axes.col(0).cross(LeverMm());
    slid_mm_[0] += inner_mm[0];
    slid_mm_[1] += around_.dot(inner_mm.tail<2>()) - from_.lumen_mm * outer_rad;
    return;
  }
  slid_mm_[1] += from_.lever_mm * inner_rad - from_.lumen_mm * outer_rad;
}

void HeldContact::End(const LumenContact& contact, double slip_mm) {
  slid_mm_ = Holds(contact) ? SlidMm(contact) : Vector2d(Vector2d::Zero());
  const double distance = slid_mm_.norm();
  if (distance > slip_mm) slid_mm_ *= slip_mm / distance;
  from_ = contact;
}

std::uint64_t HeldContact::Hash(std::uint64_t seed) const {
  if (limit_N_ == 0) return seed;
  for (const double value : {limit_N_, slid_mm_[0], slid_mm_[1]}) seed = HashDouble(value, seed);
  return seed;
}

}  // namespace torquer::effects
