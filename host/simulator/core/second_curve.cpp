// Second curve of a state: README, section 18.
#include <algorithm>
#include <cassert>
#include <utility>

#include "host/simulator/core/wire_state.h"

namespace torquer {

using Eigen::Vector3d;

void WireState::LaySecond(const WireModel& second, double reach_mm, int first_outer,
                          bool outer_leads) {
  second_.clear();
  second_.reserve(1);
  second_.emplace_back(second, places_.size());
  first_outer_ = first_outer;
  outer_leads_ = outer_leads;
  WireState& other = second_.front();
  other.places_ = places_;
  other.tangents_ = tangents_;
  other.normals_ = normals_;
  other.twist_rad_ = twist_rad_;
  if (second.stack_twists()) other.turns_rad_.assign(tangents_.size(), Rotations());
  other.first_segment_mm_ = first_segment_mm_;
  other.FitEnd(second, segments(), reach_mm);
}

void WireState::FeedSecond(const WireModel& second, int segments_before, double fed_mm,
                           double reach_mm) {
  WireState& other = second_.front();
  other.Slide(second, fed_mm);
  other.first_segment_mm_ += fed_mm;
  if (segments_before == 0 || segments() == 0) {
    other.tangents_.clear();
    other.normals_.clear();
    other.twist_rad_.clear();
    other.turns_rad_.clear();
  } else if (other.segments() > 0 && segments() > segments_before) {
    other.SplitFirst(second);
  } else if (other.segments() > 1 && segments() < segments_before) {
    other.JoinFirst(second);
  }
  other.first_segment_mm_ = first_segment_mm_;
  if (segments() > 0 && other.segments() == 0 && reach_mm > 0) {
    other.tangents_.assign(1, tangents_.front());
    other.normals_.assign(1, normals_.front());
    if (second.stack_twists()) {
      other.twist_rad_.assign(1, 0);
      other.turns_rad_.assign(1, Rotations());
    }
  }
  other.FitEnd(second, segments(), reach_mm);
}

// Shortens the end, or extends it straight on, so that `reach_mm` lies in the last segment. Keeps
// at most `most` segments.
void WireState::FitEnd(const WireModel& model, int most, double reach_mm) {
  const auto begin_mm = [&](int segment) {
    return segment == 0 ? 0 : first_segment_mm_ + (segment - 1) * model.segment_mm();
  };
  while (segments() > most || (segments() > 0 && begin_mm(segments() - 1) >= reach_mm)) {
    tangents_.pop_back();
    normals_.pop_back();
    if (!model.stack_twists()) continue;
    twist_rad_.pop_back();
    turns_rad_.pop_back();
  }
  while (segments() > 0 && segments() < most && begin_mm(segments()) < reach_mm) {
    tangents_.emplace_back(tangents_.back());
    normals_.emplace_back(normals_.back());
    if (!model.stack_twists()) continue;
    twist_rad_.push_back(0);
    turns_rad_.emplace_back(turns_rad_.back());
  }
  insertion_mm_ = segments() == 0 ? 0 : begin_mm(segments());
  PlaceAgain(model);
}

void WireState::ExchangeCurves() {
  WireState& other = second_.front();
  assert(segments() == other.segments());
  std::swap(nodes_, other.nodes_);
  std::swap(tangents_, other.tangents_);
  std::swap(normals_, other.normals_);
  std::swap(twist_rad_, other.twist_rad_);
  std::swap(turns_rad_, other.turns_rad_);
  outer_leads_ = !outer_leads_;
}

void WireState::UpdateCurves(const WireModel& model, const WireModel& second) {
  UpdateFrames(model);
  second_.front().UpdateFrames(second);
}

void WireState::StepSecond(const WireModel& second, const WireState& from,
                           const std::vector<Frame>& frames, const std::vector<Eigen::Vector2d>& xi,
                           const std::vector<double>& spin, double scale) {
  second_.front().Step(second, from.second_.front(), frames, xi, spin, scale);
  outer_leads_ = from.outer_leads_;
}

void WireState::MoveBoth(const WireModel& model, const WireModel& second,
                         const InstrumentPlaces& places) {
  MoveInstruments(model, places);
  second_.front().MoveInstruments(second, places);
}

}  // namespace torquer
