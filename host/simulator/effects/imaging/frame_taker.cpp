#include "host/simulator/effects/imaging/frame_taker.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace torquer::effects {

using Eigen::Vector3d;

DyePoints LayDyePoints(const Contrast* contrast) {
  DyePoints dye;
  if (contrast == nullptr) return dye;
  constexpr double kStepPerRadius = 0.5;
  constexpr double kLeastStepMm = 0.7;
  const FlowGraph& graph = contrast->flow().graph();
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const FlowEdge& edge = graph.edges()[e];
    const Contrast::Cells& cells = contrast->cells()[e];
    const vessel::Centerline& curve = graph.network().curves()[edge.curve];
    DyePoints::Branch branch{dye.points.size(), 0};
    double s = edge.from_mm;
    while (true) {
      const vessel::CenterlineSample at = curve.At(s);
      dye.points.push_back({at.position_mm, at.tangent, at.radius_mm, 0});
      const double x = (s - edge.from_mm) / cells.length_mm - 0.5;
      const double inside = std::clamp(x, 0.0, static_cast<double>(cells.count - 1));
      const auto cell = std::min(cells.count - 2, static_cast<std::size_t>(inside));
      dye.cells.push_back(
          {cells.first + cell, static_cast<float>(inside - static_cast<double>(cell))});
      if (s >= edge.to_mm) break;
      const double step = std::max(kLeastStepMm, kStepPerRadius * at.radius_mm);
      s = s + 1.5 * step > edge.to_mm ? edge.to_mm : s + step;
    }
    branch.count = dye.points.size() - branch.first;
    dye.branches.push_back(branch);
  }
  return dye;
}

namespace {

/// Open part of a picture.
class OpenPart {
 public:
  OpenPart(const FluoroscopySettings& settings, const Controls& controls)
      : projection_(settings.ProjectionOf(controls)),
        left_(controls.imaging.left * settings.arm.width - 0.5),
        right_((1 - controls.imaging.right) * settings.arm.width - 0.5),
        top_(controls.imaging.top * settings.arm.height - 0.5),
        bottom_((1 - controls.imaging.bottom) * settings.arm.height - 0.5) {}

  bool Shows(const Vector3d& point_mm) const {
    const Vector3d camera_mm = projection_.ToCamera(point_mm);
    if (!(camera_mm[2] > 0)) return false;
    const ImagePoint at = projection_.FromCamera(camera_mm);
    return at.column > left_ && at.column < right_ && at.row > top_ && at.row < bottom_;
  }

 private:
  Projection projection_;
  double left_, right_, top_, bottom_;
};

}  // namespace

PictureContents ContentsOf(const XrayFrame& frame, const DyePoints& dye,
                           const FluoroscopySettings& settings) {
  constexpr double kSeenIntegral = 0.01;
  const OpenPart open(settings, frame.controls);
  PictureContents contents;
  for (const std::vector<WirePoint>& shadow : frame.shadows) {
    if (std::any_of(shadow.begin(), shadow.end(),
                    [&open](const WirePoint& point) { return open.Shows(point.position_mm); })) {
      contents.instrument = true;
    }
  }
  if (!frame.has_dye) return contents;
  for (std::size_t i = 0; i < dye.points.size() && !contents.contrast; ++i) {
    const LumenPoint& point = dye.points[i];
    if (2 * point.radius_mm * static_cast<double>(frame.dye_1_mm[i]) < kSeenIntegral) continue;
    Vector3d at_mm = point.position_mm;
    if (!frame.offsets.empty()) at_mm += frame.offsets[i].cast<double>();
    contents.contrast = open.Shows(at_mm);
  }
  return contents;
}

FrameTaker::FrameTaker(const FluoroscopySettings& settings, const WireModel& wire,
                       const Contrast* contrast, const DyePoints& dye,
                       std::vector<const vessel::FieldMotion*> motions,
                       std::vector<Instrument> instruments)
    : settings_(settings),
      wire_(wire),
      contrast_(contrast),
      dye_(dye),
      motions_(std::move(motions)),
      instruments_(std::move(instruments)) {
  if (!motions_.empty()) memory_.offsets.assign(dye_.points.size(), Eigen::Vector3f::Zero());
}

void FrameTaker::Restart() {
  ++memory_.session;
  memory_.next_s = 0;
  memory_.was_down = false;
  memory_.number = 0;
  memory_.view = {};
  std::fill(memory_.offsets.begin(), memory_.offsets.end(), Eigen::Vector3f::Zero());
}

bool FrameTaker::IsDue(const TickView& tick) {
  if (!tick.controls.xray) {
    memory_.was_down = false;
    return false;
  }
  if (!memory_.was_down) {
    memory_.next_s = tick.time_s;
    ++memory_.pedal;
  }
  memory_.was_down = true;
  constexpr double kEarlyS = 5e-4;  // half a tick
  if (tick.time_s < memory_.next_s - kEarlyS) return false;
  const double pause_s = 1 / settings_.PulsesPerS(tick.controls.imaging);
  memory_.next_s = std::max(memory_.next_s, tick.time_s - pause_s) + pause_s;
  return true;
}

void FrameTaker::CountStill(const Controls& controls) {
  const View view = ViewOf(controls);
  memory_.still = view == memory_.view ? memory_.still + 1 : 0;
  memory_.view = view;
}

bool FrameTaker::Take(const TickView& tick, XrayFrame& frame) {
  if (!IsDue(tick)) return false;
  frame.session = memory_.session;
  frame.number = memory_.number++;
  CountStill(tick.controls);
  frame.still = memory_.still;
  frame.pedal = memory_.pedal;
  frame.time_s = tick.time_s;
  frame.controls = tick.controls;
  frame.organs_mm = OrgansNow();
  TakeInstruments(tick.state, frame);
  TakeDye(frame);
  return true;
}

// The organs move like the vessel at the isocenter.
Vector3d FrameTaker::OrgansNow() const {
  vessel::Offset offset;
  for (const vessel::FieldMotion* motion : motions_) {
    motion->AddOffset(settings_.arm.isocenter_mm, offset);
  }
  return offset.value;
}

// Goes along one polyline from the instrument's tip, by the distance from it. Two points lie at the
// proximal end of the marker, so that no segment has both attenuations.
void FrameTaker::TakeBody(const Instrument& instrument, std::vector<WirePoint>& body) const {
  const auto radius_mm = [&instrument](double from_tip_mm) {
    const WireModel& model = *instrument.model;
    return model.radius_mm(static_cast<int>(std::lround(from_tip_mm / model.segment_mm())));
  };
  const double marker_mm = instrument.marker_mm;
  body.clear();
  double from_tip_mm = 0;
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    if (i + 1 < nodes_.size()) {
      const double length_mm = (nodes_[i + 1] - nodes_[i]).norm();
      const double rest_mm = marker_mm - from_tip_mm;
      from_tip_mm += length_mm;
      if (rest_mm > 0 && rest_mm <= length_mm) {
        const double part = rest_mm / length_mm;
        const WirePoint end{nodes_[i + 1] + part * (nodes_[i] - nodes_[i + 1]),
                            radius_mm(marker_mm), 0};
        for (const double attenuation_1_mm :
             {instrument.marker_1_mm, instrument.attenuation_1_mm}) {
          body.push_back(end);
          body.back().attenuation_1_mm = attenuation_1_mm;
        }
      }
    }
    const bool marked = from_tip_mm < marker_mm;
    body.push_back({nodes_[i], radius_mm(from_tip_mm),
                    marked ? instrument.marker_1_mm : instrument.attenuation_1_mm});
  }
  std::reverse(body.begin(), body.end());
}

void FrameTaker::TakeInstruments(const WireState& state, XrayFrame& frame) {
  std::size_t shadows = 0;
  const auto next = [&]() -> std::vector<WirePoint>& {
    if (frame.shadows.size() == shadows) frame.shadows.emplace_back();
    return frame.shadows[shadows++];
  };
  for (std::size_t k = instruments_.size(); k-- > 0;) {
    const Instrument& instrument = instruments_[k];
    const int number = static_cast<int>(k);
    TakeNodes(wire_, state.CurveOf(number), state.poses()[number].insertion_mm, nodes_);
    TakeBody(instrument, next());
    if (instrument.inner_radius_mm == 0) continue;
    std::vector<WirePoint>& lumen = next();
    lumen = frame.shadows[shadows - 2];
    for (WirePoint& point : lumen) {
      point.radius_mm = instrument.inner_radius_mm;
      point.attenuation_1_mm = -point.attenuation_1_mm;
    }
  }
}

void FrameTaker::TakeDye(XrayFrame& frame) {
  frame.has_dye = contrast_ != nullptr && !contrast_->clear();
  if (!frame.has_dye) return;
  const std::vector<double>& concentration = contrast_->concentration_mg_mL();
  frame.dye_1_mm.resize(dye_.points.size());
  const auto scale = static_cast<float>(settings_.iodine_1_mm_mg_mL);
  for (std::size_t i = 0; i < dye_.points.size(); ++i) {
    const DyePoints::CellPlace& place = dye_.cells[i];
    const auto a = static_cast<float>(concentration[place.cell]);
    const auto b = static_cast<float>(concentration[place.cell + 1]);
    frame.dye_1_mm[i] = scale * (a + place.weight * (b - a));
  }
  if (motions_.empty()) return;
  // The displaced position of a lumen point solves a fixed-point equation, since its offset is a
  // function of that position. This is one iteration from the position in the last picture.
  for (std::size_t i = 0; i < dye_.points.size(); ++i) {
    if (!(frame.dye_1_mm[i] > 0)) continue;
    vessel::Offset offset;
    const Vector3d now = dye_.points[i].position_mm + memory_.offsets[i].cast<double>();
    for (const vessel::FieldMotion* motion : motions_) motion->AddOffset(now, offset);
    memory_.offsets[i] = offset.value.cast<float>();
  }
  frame.offsets = memory_.offsets;
}

}  // namespace torquer::effects
