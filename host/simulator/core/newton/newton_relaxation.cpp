#include "host/simulator/core/newton/newton_relaxation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {
// Proximal weights, in units of the local EI/(1 mm): below the smallest none is used, above the
// largest a step is shorter than rounding.
constexpr double kSmallestProximal = 1e-4;
constexpr double kLargestProximal = 1e12;
// Weight over residual with which to begin where none was needed so far.
constexpr double kFirstDamping = 0.1;
// Least weight over residual above a residual.
constexpr double kFarDamping = 2;
constexpr double kFarResidual = 5e-3;
// After a feed the wire is expected to go on relaxing as after the feed before, if that was at
// least a part of this one and turned no segment by more.
constexpr double kLargestRatio = 6;
constexpr double kLargestDriftRad = 0.1;
// Above this residual the wire has hardly been relaxed since it was moved.
constexpr double kUnrelaxed = 0.1;
// A balance that is stable but for this weight counts as stable.
constexpr double kStableProximal = 1e-6;
// Turn of a segment, rad, by which a wire in unstable balance is pushed off it.
constexpr double kPush = 1e-4;
}  // namespace

template <class Stage>
NewtonMethod<Stage>::NewtonMethod(const WireModel& model, const ClearanceField& field,
                                  const WallModel& wall, const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : model_(model),
      field_(field),
      settings_(settings),
      terms_(terms),
      mechanics_(model, field, wall, terms),
      sweep_(model.max_segments()),
      current_(mechanics_.MakeExpansion()),
      trial_expansion_(mechanics_.MakeExpansion()),
      trial_(model) {
  assert(Stage::kTwists == model.twists());
  step_.reserve(static_cast<std::size_t>(model.max_segments()) + 1);
  displacement_mm_.reserve(static_cast<std::size_t>(model.max_segments()) + 1);
  if (Stage::kTwists) spin_step_.reserve(step_.capacity());
  fed_.reserve(step_.capacity());
  drift_.reserve(step_.capacity());
  active_.reserve(current_.points.position.capacity());
  pressed_.assign(current_.points.position.capacity(), 0);
}

template <class Stage>
void NewtonMethod<Stage>::Restart(WireState& state) {
  mechanics_.ForgetLookups();
  for (EnergyTerm* term : terms_) term->Reset();
  damping_ = feed_damping_ = 0;
  stable_ = false;
  moved_ = false;
  fed_mm_ = 0;
  TransportNormals(model_, state);
  mechanics_.TakeStiffness(state);
  travel_mm_ = field_.TravelMm();
  mechanics_.Expand(state, current_);
}

template <class Stage>
void NewtonMethod<Stage>::RememberPressed() {
  std::fill(pressed_.begin(), pressed_.end(), 0);
  for (const int q : current_.points.near) {
    pressed_[static_cast<std::size_t>(current_.points.FromTip(q))] =
        current_.points.touches[static_cast<std::size_t>(q)];
  }
}

template <class Stage>
void NewtonMethod<Stage>::Feed(double feed_mm, WireState& state) {
  const std::size_t before = state.tangents.size();
  drift_.clear();
  if (fed_mm_ != 0 && fed_.size() == before) {
    for (std::size_t k = 0; k < before; ++k) {
      const std::size_t i = before - 1 - k;
      drift_.push_back(fed_[i].cross(state.tangents[i]));
    }
  }
  FeedAlongItself(model_, feed_mm, state);
  fed_ = state.tangents;
  const double ratio = fed_mm_ != 0 ? feed_mm / fed_mm_ : 0;
  fed_mm_ = feed_mm;
  predicted_ = ratio > 0 && ratio < kLargestRatio && Drift(ratio, state);
}

template <class Stage>
void NewtonMethod<Stage>::Rotate(double angle_rad, WireState& state) {
  // All of the wire at once, which is where it comes to rest if nothing holds it.
  if (Stage::kTwists) TurnNormals(angle_rad - state.rotation_rad, state);
  state.SetRotation(angle_rad);
}

template <class Stage>
bool NewtonMethod<Stage>::Drift(double ratio, WireState& state) {
  double longest = 0;
  for (const Vector3d& turn : drift_) longest = std::max(longest, turn.squaredNorm());
  if (ratio * std::sqrt(longest) > kLargestDriftRad) return false;
  const std::size_t n = state.tangents.size();
  for (std::size_t k = 0; k < std::min(n, drift_.size()); ++k) {
    const std::size_t i = n - 1 - k;
    const Vector3d& u = state.tangents[i];
    TurnSegment(i, (u + ratio * drift_[k].cross(u)).normalized(), state);
  }
  PlaceNodes(model_, 1, state);
  UpdateSpin(model_, state);
  return true;
}

template <class Stage>
bool NewtonMethod<Stage>::MoveTowards(const HandTarget& target, WireState& state,
                                      TickReport& report) {
  const double feed_left =
      std::clamp(target.insertion_mm, 0.0, model_.max_length_mm()) - state.insertion_mm;
  const double turn_left = target.rotation_rad - state.rotation_rad;
  if (feed_left == 0 && turn_left == 0) return false;
  RememberPressed();
  const double longest = std::min(settings_.max_feed_mm, model_.segment_mm() / 2);
  Feed(std::abs(feed_left) <= longest ? feed_left : std::copysign(longest, feed_left), state);
  if (std::abs(feed_left) <= longest) {
    state.insertion_mm = std::clamp(target.insertion_mm, 0.0, model_.max_length_mm());
  }
  Rotate(std::abs(turn_left) <= settings_.max_turn_rad
             ? target.rotation_rad
             : state.rotation_rad + std::copysign(settings_.max_turn_rad, turn_left),
         state);
  report.actions += (feed_left != 0) + (turn_left != 0);
  // What was wound up is gone with the wire: begun anew, it does the same again.
  if (state.segments() == 0) feed_damping_ = fed_mm_ = 0;
  damping_ = feed_damping_;
  stable_ = false;
  moved_ = true;
  mechanics_.TakeStiffness(state);
  mechanics_.Expand(state, current_);
  return true;
}

template <class Stage>
void NewtonMethod<Stage>::Retract(const WireState& from, double scale, WireState& to) const {
  const auto n = from.tangents.size();
  to.tangents.resize(n);
  to.normals.resize(n);
  to.first_segment_mm = from.first_segment_mm;
  to.insertion_mm = from.insertion_mm;
  to.rotation_rad = from.rotation_rad;
  to.turn = from.turn;
  to.spin = from.spin;
  to.twist_rad = from.twist_rad;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d& u = from.tangents[i];
    const Vector2d xi = scale * step_[i];
    const Vector3d longer = u + current_.frames[i] * xi;
    const double length = longer.norm();
    const Vector3d tangent = longer / length;
    // ParallelTransport(normal, u, tangent), whose scalar products are known here.
    const Vector3d carried = from.normals[i] - (xi[0] / (1 + length)) * (u + tangent);
    const Vector3d normal = carried - carried.dot(tangent) * tangent;
    to.tangents[i] = tangent;
    to.normals[i] = normal * (1.5 - 0.5 * normal.squaredNorm());
    if constexpr (Stage::kTwists) {
      const Vector3d spun = to.normals[i] + (scale * spin_step_[i]) * tangent.cross(to.normals[i]);
      to.normals[i] = spun / spun.norm();
    }
  }
  PlaceNodes(model_, 1, to);
  if constexpr (Stage::kTwists) UpdateSpin(model_, to);
}

template <class Stage>
int NewtonMethod<Stage>::FindActive(const WireState& state) {
  int last_changed = -1;
  const int per_segment = current_.points.per_segment;
  for (std::size_t k = 0; k < current_.springs.size(); ++k) {
    const int q = current_.points.near[k];
    const int i = q / per_segment;
    const double t = state.SegmentLength(model_, i) * (q % per_segment + 1) / per_segment;
    const Vector3d moved = displacement_mm_[i] + current_.frames[i] * (t * step_[i]);
    const double penetration =
        current_.springs[k].penetration_mm -
        current_.points.clearance[static_cast<std::size_t>(q)].gradient.dot(moved);
    const std::uint8_t touches = penetration > 0;
    if (touches == active_[k]) continue;
    active_[k] = touches;
    last_changed = i;
  }
  return last_changed;
}

// Minimizes the model in which every near point has a one-sided spring, by Newton's method on its
// piecewise quadratic. Returns the decrease of energy that it predicts; negative where the model
// has no minimum or none was found.
template <class Stage>
double NewtonMethod<Stage>::SolveModel(const WireState& state) {
  constexpr int kRounds = 6;
  active_.resize(current_.springs.size());
  for (std::size_t k = 0; k < active_.size(); ++k) {
    // Sliding along itself, the wire cuts corners by more than it is pressed in; which points press
    // hardly changes.
    active_[k] =
        moved_
            ? pressed_[static_cast<std::size_t>(current_.points.FromTip(current_.points.near[k]))]
            : current_.springs[k].penetration_mm > 0;
  }
  mechanics_.Model(state, active_, current_);
  int last_changed = state.segments() - 1;
  for (int round = 0; round < kRounds; ++round) {
    if (!sweep_.Refactor(model_, state, current_, proximal_, last_changed)) return -1;
    const double decrease =
        sweep_.Step(model_, state, current_, step_, spin_step_, displacement_mm_);
    if (!std::isfinite(decrease)) return -1;
    // The model's energy at no step, with this set instead of the true one.
    double at_rest = 0;
    for (std::size_t k = 0; k < active_.size(); ++k) {
      const WallSpring& spring = current_.springs[k];
      const double energy =
          spring.stiffness_N_mm * spring.penetration_mm * spring.penetration_mm / 2;
      if (active_[k] && spring.penetration_mm <= 0) at_rest += energy;
      if (!active_[k] && spring.penetration_mm > 0) at_rest -= energy;
    }
    last_changed = FindActive(state);
    if (last_changed < 0 || round + 1 == kRounds) return decrease - at_rest;
    mechanics_.Model(state, active_, current_);
  }
  return -1;
}

template <class Stage>
bool NewtonMethod<Stage>::Iterate(WireState& state, TickReport& report) {
  // In proportion to the residual a weight does not spoil the quadratic convergence.
  // Far from balance some is always needed: contacts would come and go in turns.
  const double damping =
      current_.residual > kFarResidual ? std::max(damping_, kFarDamping) : damping_;
  proximal_ = damping * current_.residual;
  if (proximal_ < kSmallestProximal) proximal_ = 0;
  bool refused = false;
  for (int attempt = 0; attempt < 40; ++attempt) {
    const double expected = SolveModel(state);
    bool accepted = false;
    double gained = 0;
    double scale = 1;
    if (expected >= 0) {
      double longest = 0;
      for (const Vector2d& xi : step_) longest = std::max(longest, xi.squaredNorm());
      for (const double zeta : spin_step_) longest = std::max(longest, zeta * zeta);
      longest = std::sqrt(longest);
      scale = longest > settings_.max_step_rad ? settings_.max_step_rad / longest : 1;
      Retract(state, scale, trial_);
      mechanics_.Expand(trial_, trial_expansion_);
      report.updates += state.segments();
      gained = current_.energy_mJ - trial_expansion_.energy_mJ;
      // Close to the minimum the gain drowns in the rounding of the energy; there the residual
      // tells.
      const double rounding = 1e-12 * std::abs(current_.energy_mJ);
      accepted = gained >= 0.1 * scale * expected ||
                 (gained >= -rounding && trial_expansion_.residual < current_.residual);
    }
    if (!accepted) {
      refused = true;
      proximal_ = std::max({10 * proximal_, kFirstDamping * current_.residual, kSmallestProximal});
      if (proximal_ > kLargestProximal) break;
      continue;
    }
    stable_ = proximal_ == 0;
    if (refused) {
      damping_ = proximal_ / current_.residual;
    } else if (proximal_ > 0 && scale == 1 && gained >= 0.5 * expected) {
      // What was enough at once may be less next time.
      damping_ /= 1.5;
    }
    if (moved_) feed_damping_ = damping_;
    Accept(state);
    std::swap(current_, trial_expansion_);
    if constexpr (Stage::kTwists) {
      current_.points.normals = &state.normals;
    } else {
      UpdateSpin(model_, state);
      mechanics_.ExpandCurvedJoints(state, current_);
    }
    return true;
  }
  mechanics_.Expand(state, current_);
  damping_ = feed_damping_ = 0;
  return false;
}

template <class Stage>
void NewtonMethod<Stage>::Accept(WireState& state) {
  std::swap(state.nodes, trial_.nodes);
  std::swap(state.tangents, trial_.tangents);
  std::swap(state.normals, trial_.normals);
  std::swap(state.twist_rad, trial_.twist_rad);
  moved_ = false;
}

template <class Stage>
bool NewtonMethod<Stage>::Stable(const WireState& state) {
  if (!stable_) stable_ = sweep_.Factor(model_, state, current_, kStableProximal);
  return stable_;
}

template <class Stage>
void NewtonMethod<Stage>::PushOff(WireState& state) {
  // Every shape gets its part; which way is arbitrary, and always the same.
  step_.resize(state.tangents.size());
  std::uint32_t random = 1;
  for (Vector2d& xi : step_) {
    for (double& component : xi) {
      random = 1664525 * random + 1013904223;
      component = kPush * (random / 2147483648.0 - 1);
    }
  }
  std::fill(spin_step_.begin(), spin_step_.end(), 0);
  Retract(state, 1, trial_);
  Accept(state);
  UpdateSpin(model_, state);
  mechanics_.Expand(state, current_);
}

template <class Stage>
TickReport NewtonMethod<Stage>::Tick(const HandTarget& target, WorkBudget& budget,
                                     WireState& state) {
  TickReport report;
  const Vector3d tip_before = state.nodes.back();
  const double insertion_before = state.insertion_mm;
  const double rotation_before = state.rotation_rad;

  for (EnergyTerm* term : terms_) term->Begin(current_.points);
  // What the terms took over may have changed the energy, and so does a vessel that moves.
  bool up_to_date = terms_.empty() && field_.TravelMm() == travel_mm_ && !model_changed_;
  if (model_changed_) {
    stable_ = false;
    UpdateSpin(model_, state);  // other joints may rest curved now
  }
  model_changed_ = false;
  travel_mm_ = field_.TravelMm();
  bool stalled = false;
  bool pushed = false;
  bool pending = true;
  // A wire that the budget left as it was fed is relaxed before it is fed again.
  int since_move = current_.residual > kUnrelaxed ? 0 : settings_.iterations_between_parts;
  while (true) {
    if (pending && since_move >= settings_.iterations_between_parts) {
      if (!Grant(budget, report)) break;
      pending = MoveTowards(target, state, report);
      if (!pending && !up_to_date) mechanics_.Expand(state, current_);
      up_to_date = true;
      since_move = 0;
      stalled = false;
    } else if (!up_to_date) {
      mechanics_.Expand(state, current_);
      up_to_date = true;
    }
    if (current_.residual <= settings_.tolerance || stalled || state.segments() == 0) {
      if (stalled || state.segments() == 0 || Stable(state)) {
        if (!pending) break;
        since_move = settings_.iterations_between_parts;
        continue;
      }
      if (!pushed) PushOff(state);
      pushed = true;
    }
    if (report.iterations >= settings_.max_iterations || !Grant(budget, report)) break;
    ++report.iterations;
    ++since_move;
    stalled = !Iterate(state, report);
  }
  for (EnergyTerm* term : terms_) term->End(current_.points);

  report.converged = current_.residual <= settings_.tolerance;
  report.carried_mm =
      std::clamp(target.insertion_mm, 0.0, model_.max_length_mm()) - state.insertion_mm;
  report.budget_spent = !stalled && (!report.converged || report.carried_mm != 0);
  report.energy_mJ = current_.energy_mJ;
  report.residual = current_.residual;
  report.max_penetration_mm = current_.max_penetration_mm;
  const double hand = std::abs(state.insertion_mm - insertion_before) +
                      10 * std::abs(state.rotation_rad - rotation_before);
  report.snapped = (state.nodes.back() - tip_before).norm() > 3 * hand + 0.5;
  return report;
}

template class NewtonMethod<BendStage>;
template class NewtonMethod<TwistStage>;

std::unique_ptr<Relaxation> MakeNewtonRelaxation(const WireModel& model,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms) {
  if (model.twists()) {
    return std::make_unique<NewtonMethod<TwistStage>>(model, field, wall, settings, terms);
  }
  return std::make_unique<NewtonRelaxation>(model, field, wall, settings, terms);
}

}  // namespace torquer
