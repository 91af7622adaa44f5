#include "host/simulator/effects/observers/outlets.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "host/simulator/core/hash.h"

namespace torquer::effects {

using Eigen::Vector3d;

namespace {

// The bend of a tip may reach an outlet before its end does.
constexpr double kTipPartMm = 20;
// Least part of a motion. An instrument near an outlet that may not leave it yet moves at most this
// far between two looks.
constexpr double kLeastPartMm = 0.25;
// An entry lies behind the outlet within so many radii, where the instrument came in.
constexpr double kEntryRadii = 4;

int OutletBehind(const Sheath& sheath, const std::vector<vessel::Outlet>& outlets) {
  int own = -1;
  double nearest_mm = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < outlets.size(); ++k) {
    const double distance_mm = outlets[k].DistanceMm(sheath.point_mm);
    if (distance_mm > kEntryRadii * outlets[k].radius_mm || distance_mm >= nearest_mm ||
        sheath.direction.dot(outlets[k].outward) >= 0) {
      continue;
    }
    own = static_cast<int>(k);
    nearest_mm = distance_mm;
  }
  return own;
}

}  // namespace

Outlets::Outlets(std::vector<vessel::Outlet> outlets, double distance_mm,
                 const InstrumentStack& stack, const vessel::MovingField* moving)
    : outlets_(std::move(outlets)), distance_mm_(distance_mm), stack_(stack), moving_(moving) {
  for (int k = 0; k < stack_.size(); ++k) {
    own_[static_cast<std::size_t>(k)] = OutletBehind(stack_.instrument(k).sheath(), outlets_);
  }
}

void Outlets::Restart() {
  held_mm_ = {};
  was_out_ = false;
  beyond_mm_ = 0;
  events_ = 0;
  event_s_.reset();
}

void Outlets::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Outlets&>(twin);
  held_mm_ = from.held_mm_;
  was_out_ = from.was_out_;
  beyond_mm_ = from.beyond_mm_;
  events_ = from.events_;
  event_s_ = from.event_s_;
}

// Distance of the distal part of an instrument from the outlets, less its radius.
double Outlets::NearestMm(int instrument, const WireState& state) const {
  const Curve& curve = state.CurveOf(instrument);
  const double insertion_mm = state.poses()[instrument].insertion_mm;
  const WireModel& model = stack_.instrument(instrument);
  const int last = NodesBefore(model, curve, insertion_mm);
  const int first = std::max(0, last - static_cast<int>(kTipPartMm / model.segment_mm()));
  double nearest_mm = std::numeric_limits<double>::infinity();
  const auto look = [&](const Vector3d& place) {
    const Vector3d at = moving_ == nullptr ? place : moving_->AtRest(place);
    for (std::size_t k = 0; k < outlets_.size(); ++k) {
      if (static_cast<int>(k) == own_[static_cast<std::size_t>(instrument)]) continue;
      nearest_mm = std::min(nearest_mm, outlets_[k].DistanceMm(at));
    }
  };
  for (int i = first; i < last; ++i) look(curve.nodes()[static_cast<std::size_t>(i)]);
  look(PointAt(model, curve, insertion_mm));
  return nearest_mm - model.radius_mm(0);
}

void Outlets::Hold(InstrumentPoses& target) const {
  for (int k = 0; k < target.size(); ++k) {
    const auto& held_mm = held_mm_[static_cast<std::size_t>(k)];
    if (held_mm) target[k].insertion_mm = std::min(target[k].insertion_mm, *held_mm);
  }
}

bool Outlets::Limit(const WireState& state, InstrumentPoses& target) const {
  const InstrumentPoses& now = state.poses();
  Hold(target);
  double share = 1;
  for (int k = 0; k < target.size(); ++k) {
    const double feed_mm = target[k].insertion_mm - now[k].insertion_mm;
    if (feed_mm <= kLeastPartMm) continue;
    const double free_mm = std::max(kLeastPartMm, NearestMm(k, state) - distance_mm_);
    share = std::min(share, free_mm / feed_mm);
  }
  if (share >= 1) return false;
  for (int k = 0; k < target.size(); ++k) {
    InstrumentPose& pose = target[k];
    pose.insertion_mm = std::lerp(now[k].insertion_mm, pose.insertion_mm, share);
    pose.rotation_rad = std::lerp(now[k].rotation_rad, pose.rotation_rad, share);
  }
  return true;
}

void Outlets::Look(const WireState& state) {
  for (int k = 0; k < state.poses().size(); ++k) {
    auto& held_mm = held_mm_[static_cast<std::size_t>(k)];
    const double insertion_mm = state.poses()[k].insertion_mm;
    if (held_mm && insertion_mm < *held_mm) held_mm.reset();
    if (!held_mm && NearestMm(k, state) <= distance_mm_) held_mm = insertion_mm;
  }
}

bool Outlets::left_model() const {
  return std::any_of(held_mm_.begin(), held_mm_.end(),
                     [](const std::optional<double>& held_mm) { return held_mm.has_value(); });
}

std::uint64_t Outlets::Hash(std::uint64_t seed) const {
  for (const std::optional<double>& held_mm : held_mm_) {
    seed = HashDouble(held_mm.value_or(-1), seed);
  }
  return seed;
}

void Outlets::Observe(const TickView& tick) {
  beyond_mm_ = 0;
  for (int k = 0; k < tick.target.size(); ++k) {
    const auto& held_mm = held_mm_[static_cast<std::size_t>(k)];
    if (held_mm) beyond_mm_ = std::max(beyond_mm_, tick.target[k].insertion_mm - *held_mm);
  }
  const bool is_out = left_model();
  if (is_out && !was_out_) {
    ++events_;
    event_s_ = tick.time_s;
  }
  was_out_ = is_out;
}

std::vector<Reading> Outlets::Readings() const {
  return {{"left_model_mm", beyond_mm_},
          {"left_model_events", static_cast<double>(events_)},
          {"left_model_event_s", event_s_.value_or(std::numeric_limits<double>::quiet_NaN())}};
}

namespace {

struct OutletsSpec : TableSpec {
  double distance_mm = 1;
};

const Keys<OutletsSpec>& OutletsKeys() {
  static const Keys<OutletsSpec> keys =
      Keys<OutletsSpec>()
          .Number("distance_mm", &OutletsSpec::distance_mm, 0.3, 20, "mm",
                  "distance of an instrument's surface from the flat end of an outlet, at which it "
                  "leaves the model")
          .Example("");
  return keys;
}

std::unique_ptr<Effect> MakeOutlets(const OutletsSpec& spec, const EffectContext& context) {
  return std::make_unique<Outlets>(vessel::FindOutlets(*context.vessel), spec.distance_mm,
                                   *context.stack, context.moving);
}

}  // namespace

EffectKind OutletsKind() {
  return {.name = "outlets",
          .summary =
              "ends of the vessel's model: an instrument that reaches one is held there, "
              "and status has bit 7",
          .roles = "observer, limit",
          .keys = Any(OutletsKeys()),
          .make = MakeWith(MakeOutlets)};
}

}  // namespace torquer::effects
