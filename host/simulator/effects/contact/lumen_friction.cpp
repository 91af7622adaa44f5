#include "host/simulator/effects/contact/lumen_friction.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace torquer::effects {

namespace {

// Distance of a place from a memory in the order of both: negative if the place comes first.
int OrderOf(const LumenContact& contact, const LumenContact& of_memory) {
  if (contact.pair != of_memory.pair) return contact.pair - of_memory.pair;
  return of_memory.inner_from_tip - contact.inner_from_tip;
}

// Memory of a place that crosses, or null. It is at most `reach` pieces away on the inner curve,
// and one segment on the outer one. The nearest one is taken.
const HeldContact* FindMemory(const std::vector<HeldContact>& held, const LumenContact& contact,
                              int reach) {
  const HeldContact* found = nullptr;
  int least = 3;
  LumenContact first = contact;
  first.inner_from_tip += reach;
  auto memory = std::lower_bound(
      held.begin(), held.end(), first,
      [](const HeldContact& of, const LumenContact& to) { return OrderOf(to, of.from()) > 0; });
  for (; memory != held.end(); ++memory) {
    const LumenContact& from = memory->from();
    const int pieces = std::abs(from.inner_from_tip - contact.inner_from_tip);
    if (from.pair != contact.pair || pieces > reach) break;
    const int segments = std::abs(from.outer_from_tip - contact.outer_from_tip);
    if (segments > 1 || pieces + segments >= least || !memory->Holds(contact)) continue;
    least = pieces + segments;
    found = &*memory;
  }
  return found;
}

}  // namespace

LumenFriction::LumenFriction(double coefficient, double slip_mm, const EffectContext& context)
    : coefficient_(coefficient),
      slip_mm_(slip_mm),
      held_(static_cast<std::size_t>(context.stack->curves())),
      crossing_(held_.size()) {
  const auto segments = static_cast<std::size_t>(context.wire.max_segments()) + 1;
  const auto pieces = segments * static_cast<std::size_t>(
                                     LumenPairs::PiecesPerSegment(context.wall.points_per_segment));
  const int curves = context.stack->curves();
  for (int c = 0; c < curves; ++c) {
    const auto k = static_cast<std::size_t>(c);
    if (curves > 1) {
      for (std::vector<HeldContact>& held : held_[k]) held.resize(pieces);
    }
    const bool touches_itself = context.stack->clearance().touches_itself;
    std::size_t pairs = touches_itself ? 1 : 0;
    for (int other = c + 1; other < curves; ++other) {
      pairs += touches_itself || context.stack->AreBeside(c, other) ? 1 : 0;
    }
    crossing_[k].held.reserve(pairs * LumenPairs::MostCrossingSpots(pieces));
    crossing_[k].before.reserve(pairs * LumenPairs::MostCrossingSpots(pieces));
  }
}

std::array<LumenFriction::Side, LumenFriction::kSides> LumenFriction::SidesOf(
    const PointSet& points) {
  auto& held = held_[static_cast<std::size_t>(points.among.curve)];
  const auto pieces = static_cast<std::size_t>(points.segments() * points.between.per_segment);
  return {{{points.between.lumen, held[0], pieces}, {points.between.beside, held[1], pieces}}};
}

void LumenFriction::BeginSide(const Side& side, double coefficient) {
  const std::size_t places = side.contacts.size();
  // Places beyond the last one, or in the sheath, return in another position, so their memory is
  // cleared.
  const std::size_t first = places == 0 ? side.held.size() : side.MemoryOf(places - 1);
  const std::size_t last = places == 0 ? 0 : side.MemoryOf(0);
  for (std::size_t k = 0; k < side.held.size(); ++k) {
    if (k < first || k > last) side.held[k] = HeldContact();
  }
  for (std::size_t place = 0; place < places; ++place) {
    side.HeldAt(place).Begin(side.contacts[place], coefficient);
  }
}

// Contacts that go on keep their anchors, also if they have moved to the next piece or segment.
void LumenFriction::BeginCrossing(const std::vector<LumenContact>& contacts,
                                  Crossing& crossing) const {
  std::swap(crossing.held, crossing.before);
  crossing.held.clear();
  for (const LumenContact& contact : contacts) {
    if (contact.force_N == 0) continue;
    HeldContact& held = crossing.held.emplace_back();
    if (const HeldContact* const memory = FindMemory(crossing.before, contact, 1)) {
      held.Inherit(*memory);
    }
    held.Begin(contact, coefficient_);
  }
}

void LumenFriction::Begin(const PointSet& points) {
  for (const Side& side : SidesOf(points)) BeginSide(side, coefficient_);
  BeginCrossing(points.between.crossing, CrossingOf(points));
}

double LumenFriction::Add(const PointSet& points, PointDerivatives& out) const {
  const auto pieces = static_cast<std::size_t>(points.segments() * points.between.per_segment);
  const auto curve = static_cast<std::size_t>(points.among.curve);
  double energy_mJ = 0;
  const auto add = [&](const HeldContact& held, const std::vector<LumenContact>& contacts,
                       std::size_t place, std::vector<SlideLoad>& loads) {
    if (!held.Holds(contacts[place])) return;
    SlideLoad& load = loads.emplace_back();
    load.place = static_cast<int>(place);
    energy_mJ += held.Add(contacts[place], slip_mm_, load);
  };
  for (std::size_t side = 0; side < kSides; ++side) {
    const std::vector<LumenContact>& contacts =
        side == 0 ? points.between.lumen : points.between.beside;
    for (std::size_t place = 0; place < contacts.size(); ++place) {
      add(held_[curve][side][pieces - 1 - place], contacts, place,
          side == 0 ? out.in_lumen : out.beside);
    }
  }
  const std::vector<LumenContact>& contacts = points.between.crossing;
  for (std::size_t place = 0; place < contacts.size(); ++place) {
    const HeldContact* const held = FindMemory(crossing_[curve].held, contacts[place], 0);
    if (held != nullptr) add(*held, contacts, place, out.crossing);
  }
  return energy_mJ;
}

// Surfaces that do not twist turn with their hands.
void LumenFriction::MoveSurfaces(const PointSet& points,
                                 const std::array<SurfaceMove, kMostInstruments>& moves) {
  for (const Side& side : SidesOf(points)) {
    for (std::size_t place = 0; place < side.contacts.size(); ++place) {
      side.HeldAt(place).MoveSurfaces(moves);
    }
  }
  for (HeldContact& held : CrossingOf(points).held) held.MoveSurfaces(moves);
}

void LumenFriction::End(const PointSet& points) {
  for (const Side& side : SidesOf(points)) {
    for (std::size_t place = 0; place < side.contacts.size(); ++place) {
      side.HeldAt(place).End(side.contacts[place], slip_mm_);
    }
  }
  // Contacts that have ended leave no memory.
  Crossing& crossing = CrossingOf(points);
  std::swap(crossing.held, crossing.before);
  crossing.held.clear();
  for (const LumenContact& contact : points.between.crossing) {
    const HeldContact* const memory = FindMemory(crossing.before, contact, 0);
    if (memory != nullptr) crossing.held.emplace_back(*memory).End(contact, slip_mm_);
  }
}

void LumenFriction::Reset() {
  for (auto& sides : held_) {
    for (std::vector<HeldContact>& held : sides) held.assign(held.size(), HeldContact());
  }
  for (Crossing& crossing : crossing_) {
    crossing.held.clear();
    crossing.before.clear();
  }
}

std::uint64_t LumenFriction::Hash(std::uint64_t seed) const {
  for (const auto& sides : held_) {
    for (const std::vector<HeldContact>& all : sides) {
      for (const HeldContact& held : all) seed = held.Hash(seed);
    }
  }
  for (const Crossing& crossing : crossing_) {
    for (const HeldContact& held : crossing.held) seed = held.Hash(seed);
  }
  return seed;
}

}  // namespace torquer::effects
