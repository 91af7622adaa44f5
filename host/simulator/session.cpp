#include "host/simulator/session.h"

#include <algorithm>
#include <cmath>

#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

constexpr double kLargestTarget = 1e5;

bool Usable(const HandTarget& target) {
  return std::abs(target.insertion_mm) <= kLargestTarget &&
         std::abs(target.rotation_rad) <= kLargestTarget &&
         std::abs(target.catheter_insertion_mm) <= kLargestTarget &&
         std::abs(target.catheter_rotation_rad) <= kLargestTarget;
}

}  // namespace

Session::Session(scene::Scene& scene)
    : scene_(scene), relaxation_(scene.MakeRelaxation()), state_(scene.wire()) {
  for (const std::unique_ptr<effects::Effect>& effect : scene.effects()) {
    if (effects::Evolution* evolution = effect->evolution()) evolutions_.push_back(evolution);
    if (effects::Observer* observer = effect->observer()) observers_.push_back(observer);
    if (effects::ImageSource* image = effect->image()) image_ = image;
  }
  lives_ = scene.moving_field() != nullptr || !evolutions_.empty() || image_ != nullptr;
  Restart();
}

void Session::Restart() {
  time_s_ = 0;
  for (const std::unique_ptr<effects::Effect>& effect : scene_.effects()) effect->Restart();
  if (scene_.moving_field() != nullptr) scene_.moving_field()->SetTime(0);
  state_ = scene_.MakeStart(*relaxation_);
  target_ = scene_.start();
  command_sequence_ = -1;
  done_.clear();
  tick_ = 0;
  updates_ = 0;
  status_ = 0;
  report_ = TickReport();
  report_.residual = relaxation_->Current().residual;
  report_.energy_mJ = relaxation_->Current().energy_mJ;
  report_.max_penetration_mm = relaxation_->Current().max_penetration_mm;
  Observe();
  RunEffects(0, effects::Controls());
}

const TickReport& Session::Tick(const Command& command, WorkBudget& budget) {
  status_ = command.in_doubt ? protocol::kWireInDoubt : 0;
  command_sequence_ = command.sequence;
  if (Usable(command.target)) {
    target_ = command.target;
  } else {
    status_ |= protocol::kWireInputRefused;
  }
  const double before_s = time_s_;
  time_s_ = command.time_s < 0 ? time_s_ + 1e-3 : std::max(time_s_, command.time_s);
  if (scene_.moving_field() != nullptr) scene_.moving_field()->SetTime(time_s_);
  report_ = relaxation_->Tick(target_, budget, state_);
  ++tick_;
  done_.push_front({target_, time_s_, report_.work});
  // One more than a message holds: the newest stands in its own fields.
  if (done_.size() > kMostPastInMessage + 1) done_.pop_back();
  updates_ += report_.updates;
  Observe();
  RunEffects(time_s_ - before_s, command.controls);
  return report_;
}

void Session::RunEffects(double step_s, const effects::Controls& controls) {
  if (evolutions_.empty() && observers_.empty() && image_ == nullptr) return;
  const effects::TickView tick{.time_s = time_s_,
                               .step_s = step_s,
                               .controls = controls,
                               .target = target_,
                               .state = state_,
                               .expansion = relaxation_->Current(),
                               .report = report_};
  for (effects::Evolution* evolution : evolutions_) evolution->Advance(tick);
  for (effects::Observer* observer : observers_) observer->Observe(tick);
  if (image_ != nullptr) picture_due_ = image_->Take(tick);
}

std::vector<effects::Reading> Session::Readings() const {
  std::vector<effects::Reading> all;
  for (const effects::Observer* observer : observers_) {
    for (effects::Reading& reading : observer->Readings()) all.push_back(std::move(reading));
  }
  return all;
}

void Session::Observe() {
  hash_ = HashState(state_);
  if (report_.converged) status_ |= protocol::kWireConverged;
  if (report_.budget_spent) status_ |= protocol::kWireBudgetSpent;
  if (report_.snapped) status_ |= protocol::kWireSnapped;
  const PointSet& points = relaxation_->Current().points;
  for (std::size_t q = 0; q < points.touches.size(); ++q) {
    if (points.touches[q] && points.clearance[q].clearance_mm < 0) {
      status_ |= protocol::kWireOutsideLumen;
      break;
    }
  }
}

double Session::wire_insertion_mm() const {
  const CoaxialPair* const coaxial = scene_.coaxial();
  return coaxial == nullptr ? state_.insertion_mm
                            : std::min(coaxial->wire_place().insertion_mm, state_.insertion_mm);
}

void Session::DescribeShape(double insertion_mm, torquer_lcm::wire_state_t& out) const {
  std::vector<Eigen::Vector3d> nodes;
  TakePart(scene_.wire(), state_, insertion_mm, nodes);
  const int n = static_cast<int>(nodes.size()) - 1;
  out.insertion_mm = insertion_mm;
  out.segment_count = n;
  out.stride = n / kMostNodesInMessage + 1;
  out.nodes_mm.clear();
  const auto add = [&out](const Eigen::Vector3d& x) {
    out.nodes_mm.push_back(
        {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])});
  };
  for (int i = 0; i < n; i += out.stride) add(nodes[static_cast<std::size_t>(i)]);
  add(nodes.back());
  out.node_count = static_cast<std::int32_t>(out.nodes_mm.size());
  for (int axis = 0; axis < 3; ++axis) out.tip_mm[axis] = nodes.back()[axis];
}

bool Session::DescribeCatheter(torquer_lcm::wire_state_t& out) const {
  const CoaxialPair* const coaxial = scene_.coaxial();
  if (coaxial == nullptr) return false;
  out = {};  // all that it shares with the wire is in that one's message
  out.instrument = protocol::kCatheter;
  out.tick = tick_;
  out.time_s = time_s_;
  out.command_sequence = command_sequence_;
  out.commanded_insertion_mm = target_.catheter_insertion_mm;
  out.commanded_rotation_rad = target_.catheter_rotation_rad;
  out.rotation_rad = coaxial->catheter_place().rotation_rad;
  DescribeShape(std::min(coaxial->catheter_place().insertion_mm, state_.insertion_mm), out);
  out.carried_mm = target_.catheter_insertion_mm - out.insertion_mm;
  out.residual = report_.residual;
  out.work = report_.work;
  out.state_hash = static_cast<std::int64_t>(hash_);
  out.status = status_;
  return true;
}

void Session::Describe(torquer_lcm::wire_state_t& out) const {
  out.instrument = protocol::kGuidewire;
  out.tick = tick_;
  out.time_s = time_s_;
  out.command_sequence = command_sequence_;
  out.commanded_insertion_mm = target_.insertion_mm;
  out.commanded_rotation_rad = target_.rotation_rad;
  out.commanded_catheter_insertion_mm = target_.catheter_insertion_mm;
  out.commanded_catheter_rotation_rad = target_.catheter_rotation_rad;
  out.rotation_rad = state_.rotation_rad;
  // With less than half a segment inside there is no segment yet, and all of it is carried.
  DescribeShape(wire_insertion_mm(), out);
  out.carried_mm =
      target_.insertion_mm - std::min(out.insertion_mm, state_.ArcLength(scene_.wire()));
  out.energy_mJ = report_.energy_mJ;
  out.residual = report_.residual;
  out.max_penetration_um = 1e3 * report_.max_penetration_mm;
  out.actions = report_.actions;
  out.work = report_.work;
  out.updates = updates_;
  out.state_hash = static_cast<std::int64_t>(hash_);
  out.status = status_;

  const int n = state_.segments();
  // A contact a segment at most, with the deepest of its points.
  const PointSet& points = relaxation_->Current().points;
  out.contact_nodes.clear();
  out.contact_penetrations_um.clear();
  for (int i = 0; i < n; ++i) {
    double deepest_mm = 0;
    for (int k = 0; k < points.per_segment; ++k) {
      const auto q = static_cast<std::size_t>(i * points.per_segment + k);
      if (q >= points.touches.size() || !points.touches[q]) continue;
      deepest_mm = std::max(deepest_mm, points.radius_mm[q] - points.clearance[q].clearance_mm);
    }
    if (deepest_mm <= 0) continue;
    out.contact_nodes.push_back(i + 1);
    out.contact_penetrations_um.push_back(static_cast<float>(1e3 * deepest_mm));
  }
  out.contact_count = static_cast<std::int32_t>(out.contact_nodes.size());

  out.past_insertion_mm.clear();
  out.past_rotation_rad.clear();
  out.past_catheter_insertion_mm.clear();
  out.past_catheter_rotation_rad.clear();
  out.past_time_s.clear();
  out.past_work.clear();
  for (std::size_t k = 1; k < done_.size(); ++k) {
    out.past_insertion_mm.push_back(done_[k].target.insertion_mm);
    out.past_rotation_rad.push_back(done_[k].target.rotation_rad);
    out.past_catheter_insertion_mm.push_back(done_[k].target.catheter_insertion_mm);
    out.past_catheter_rotation_rad.push_back(done_[k].target.catheter_rotation_rad);
    out.past_time_s.push_back(done_[k].time_s);
    out.past_work.push_back(done_[k].work);
  }
  out.past_count = static_cast<std::int32_t>(out.past_work.size());
}

}  // namespace torquer::simulator
