#include "host/simulator/effects/imaging/fluoroscopy.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/effects/imaging/fluoroscopy_noise.h"

namespace torquer::effects {

using Eigen::Vector3d;
using Mode = FluoroscopySettings::Mode;

namespace {

constexpr float kBackground = 0.56F;  // gray value of the mean exposure, 0 .. 1
// Displayed fraction of the body's contrast. Slow changes are compressed, as in real systems, so
// that thin and thick parts fit into the gray range together.
constexpr float kBodyShown = 0.6F;
constexpr float kSubtractedBackground = 0.78F;  // gray value of unchanged pixels
constexpr float kRoadmapBackground = 0.5F;
constexpr float kRoadmapDye = 0.6F;  // weight of the map against the dye itself
constexpr std::uint64_t kMaskPicture =
    1ULL << 40;  // gives the mask its own noise, unlike that of any picture

// Distance of the interventional reference point (IEC 60601-2-43) from the isocenter.
constexpr double kBeforeIsocenterMm = 150;

double FieldMm(const CArm& arm) { return arm.detector_mm * arm.sod_mm / arm.sid_mm; }

}  // namespace

float WithScatter(float integral, float scatter_to_primary) {
  if (scatter_to_primary == 0) return integral;
  return -std::log((std::exp(-integral) + scatter_to_primary) / (1 + scatter_to_primary));
}

FluoroscopySettings::Mode Fluoroscopy::ModeOf(const Imaging& imaging) const {
  switch (imaging.mode) {
    case Imaging::Mode::kAsScene:
      break;
    case Imaging::Mode::kPlain:
      return Mode::kPlain;
    case Imaging::Mode::kSubtraction:
      return Mode::kSubtraction;
    case Imaging::Mode::kRoadmap:
      return Mode::kRoadmap;
  }
  return settings_.mode;
}

double Fluoroscopy::PulsesPerS(const Imaging& imaging) const {
  return imaging.pulses_per_s > 0 ? imaging.pulses_per_s : settings_.pictures_per_s;
}

CArm Fluoroscopy::ArmOf(const Imaging& imaging) const {
  CArm arm = settings_.arm;
  arm.detector_mm /= imaging.magnification;
  return arm;
}

// Air kerma of one pulse at the reference point. The tube current adapts to the body's thickness
// and the pixel size, so a pixel always gets the same dose.
double Fluoroscopy::PulseKermaMGy(const Controls& controls) const {
  constexpr double kThicknessMm = 200;
  const Body& body = settings_.body;
  const double magnification = controls.imaging.magnification;
  double mA = settings_.tube_mA * magnification * magnification;
  if (body.width_mm > 0) {
    const double more =
        MiddleIntegral(Projection(settings_.arm, controls.lao_rad, controls.cra_rad), body) -
        body.tissue_1_mm * kThicknessMm;
    mA *= std::exp(more);
  }
  const double distance_m = 1e-3 * (settings_.arm.sod_mm - kBeforeIsocenterMm);
  return settings_.tube_mGy_mAs * mA * 1e-3 * settings_.pulse_ms / (distance_m * distance_m);
}

// Open area of the beam at the reference point, between the shutters.
double Fluoroscopy::OpenAreaCm2(const Imaging& imaging) const {
  const CArm arm = ArmOf(imaging);
  const double width_cm = 0.1 * arm.detector_mm * (arm.sod_mm - kBeforeIsocenterMm) / arm.sid_mm;
  const double height_cm = width_cm * arm.height / arm.width;
  return width_cm * (1 - imaging.left - imaging.right) * height_cm *
         (1 - imaging.top - imaging.bottom);
}

Fluoroscopy::Fluoroscopy(const FluoroscopySettings& settings, const WireModel& wire,
                         const Contrast* contrast, std::vector<const vessel::FieldMotion*> motions,
                         std::vector<Instrument> instruments)
    : settings_(settings),
      wire_(wire),
      contrast_(contrast),
      motions_(std::move(motions)),
      instruments_(std::move(instruments)),
      field_mm_(FieldMm(settings.arm)) {
  if (contrast_ != nullptr) LayLumen();
  const auto pixels =
      static_cast<std::size_t>(settings.arm.width) * static_cast<std::size_t>(settings.arm.height);
  noise_.resize(pixels);
  mask_noise_.resize(pixels);
}

void Fluoroscopy::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Fluoroscopy&>(twin);
  offsets_ = from.offsets_;
  next_s_ = from.next_s_;
  was_down_ = from.was_down_;
  pedal_ = from.pedal_;
  session_ = from.session_;
  number_ = from.number_;
  pulses_ = from.pulses_;
  next_pulse_s_ = from.next_pulse_s_;
  was_exposed_ = from.was_exposed_;
  air_kerma_mGy_ = from.air_kerma_mGy_;
  kerma_area_Gy_cm2_ = from.kerma_area_Gy_cm2_;
  field_mm_ = from.field_mm_;
  pulse_mGy_ = from.pulse_mGy_;
  dose_lao_rad_ = from.dose_lao_rad_;
  dose_cra_rad_ = from.dose_cra_rad_;
  dose_magnification_ = from.dose_magnification_;
  body_plane_ = from.body_plane_;
  mask_ = from.mask_;
  mask_body_ = from.mask_body_;
  densest_dye_ = from.densest_dye_;
  mask_noise_ = from.mask_noise_;
  has_body_ = from.has_body_;
  body_lao_rad_ = from.body_lao_rad_;
  body_cra_rad_ = from.body_cra_rad_;
  body_magnification_ = from.body_magnification_;
  body_organs_mm_ = from.body_organs_mm_;
  has_mask_ = from.has_mask_;
  mask_pedal_ = from.mask_pedal_;
  seen_session_ = from.seen_session_;
  exposure_ = from.exposure_;
  shots_.CopyFrom(from.shots_);
}

void Fluoroscopy::Restart() {
  ++session_;
  next_s_ = 0;
  was_down_ = false;
  number_ = pulses_ = 0;
  was_exposed_ = false;
  air_kerma_mGy_ = kerma_area_Gy_cm2_ = pulse_mGy_ = 0;
  field_mm_ = FieldMm(settings_.arm);
  std::fill(offsets_.begin(), offsets_.end(), Eigen::Vector3f::Zero());
}

// Distributes points along every edge; thin lumens get dense points.
void Fluoroscopy::LayLumen() {
  constexpr double kStepPerRadius = 0.5;
  constexpr double kLeastStepMm = 0.7;
  const FlowGraph& graph = contrast_->flow().graph();
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const FlowEdge& edge = graph.edges()[e];
    const Contrast::Cells& cells = contrast_->cells()[e];
    const vessel::Centerline& curve = graph.network().curves()[edge.curve];
    Branch branch{lumen_.size(), 0};
    double s = edge.from_mm;
    while (true) {
      const vessel::CenterlineSample at = curve.At(s);
      lumen_.push_back({at.position_mm, at.tangent, at.radius_mm, 0});
      const double x = (s - edge.from_mm) / cells.length_mm - 0.5;
      const double inside = std::clamp(x, 0.0, static_cast<double>(cells.count - 1));
      const auto cell = std::min(cells.count - 2, static_cast<std::size_t>(inside));
      cell_places_.push_back(
          {cells.first + cell, static_cast<float>(inside - static_cast<double>(cell))});
      if (s >= edge.to_mm) break;
      const double step = std::max(kLeastStepMm, kStepPerRadius * at.radius_mm);
      s = s + 1.5 * step > edge.to_mm ? edge.to_mm : s + step;
    }
    branch.count = lumen_.size() - branch.first;
    branches_.push_back(branch);
  }
  if (!motions_.empty()) offsets_.assign(lumen_.size(), Eigen::Vector3f::Zero());
  painted_lumen_ = lumen_;
}

bool Fluoroscopy::Take(const TickView& tick) {
  if (!tick.controls.xray) {
    was_down_ = false;
    return false;
  }
  if (!was_down_) {
    next_s_ = tick.time_s;
    ++pedal_;
  }
  was_down_ = true;
  constexpr double kEarlyS = 5e-4;  // half a tick
  if (tick.time_s < next_s_ - kEarlyS) return false;
  const double pause_s = 1 / PulsesPerS(tick.controls.imaging);
  next_s_ = std::max(next_s_, tick.time_s - pause_s) + pause_s;

  Shot& shot = shots_.Draft();
  shot.session = session_;
  shot.number = number_++;
  shot.pedal = pedal_;
  shot.time_s = tick.time_s;
  shot.controls = tick.controls;
  shot.organs_mm = OrgansNow();
  TakeInstruments(tick.state, shot);
  TakeDye(shot);
  shots_.Publish();
  return true;
}

// The organs move like the vessel at the isocenter.
Vector3d Fluoroscopy::OrgansNow() const {
  vessel::Offset offset;
  for (const vessel::FieldMotion* motion : motions_) {
    motion->AddOffset(settings_.arm.isocenter_mm, offset);
  }
  return offset.value;
}

// Counts pulses independently of Take, because pictures are taken only for viewers.
void Fluoroscopy::Observe(const TickView& tick) {
  const Controls& at = tick.controls;
  field_mm_ = FieldMm(ArmOf(at.imaging));
  if (!at.xray) {
    was_exposed_ = false;
    return;
  }
  if (!was_exposed_) next_pulse_s_ = tick.time_s;
  was_exposed_ = true;
  if (pulse_mGy_ == 0 || at.lao_rad != dose_lao_rad_ || at.cra_rad != dose_cra_rad_ ||
      at.imaging.magnification != dose_magnification_) {
    dose_lao_rad_ = at.lao_rad;
    dose_cra_rad_ = at.cra_rad;
    dose_magnification_ = at.imaging.magnification;
    pulse_mGy_ = PulseKermaMGy(at);
  }
  constexpr double kEarlyS = 5e-4;  // half a tick
  while (tick.time_s >= next_pulse_s_ - kEarlyS) {
    next_pulse_s_ += 1 / PulsesPerS(at.imaging);
    ++pulses_;
    air_kerma_mGy_ += pulse_mGy_;
    kerma_area_Gy_cm2_ += 1e-3 * pulse_mGy_ * OpenAreaCm2(at.imaging);
  }
}

std::vector<Reading> Fluoroscopy::Readings() const {
  return {{"xray_pulses", static_cast<double>(pulses_)},
          {"air_kerma_mGy", air_kerma_mGy_},
          {"kerma_area_Gy_cm2", kerma_area_Gy_cm2_},
          {"xray_field_mm", field_mm_}};
}

void Fluoroscopy::TakeInstruments(const WireState& state, Shot& shot) {
  constexpr double kRoundingMm = 1e-6;
  std::size_t shadows = 0;
  const auto next = [&]() -> std::vector<WirePoint>& {
    if (shot.shadows.size() == shadows) shot.shadows.emplace_back();
    return shot.shadows[shadows++];
  };
  for (std::size_t k = instruments_.size(); k-- > 0;) {
    const Instrument& instrument = instruments_[k];
    // Goes along one polyline, by the distance of each node from the instrument's tip.
    const int number = static_cast<int>(k);
    TakePart(wire_, state.CurveOf(number), state.places()[number].insertion_mm, nodes_);
    std::vector<WirePoint>& body = next();
    body.resize(nodes_.size());
    double from_tip_mm = 0;
    for (std::size_t i = nodes_.size(); i-- > 0;) {
      if (i + 1 < nodes_.size()) from_tip_mm += (nodes_[i + 1] - nodes_[i]).norm();
      const int from_tip =
          static_cast<int>(std::lround(from_tip_mm / instrument.model->segment_mm()));
      const bool marked =
          instrument.marker_mm > 0 && from_tip_mm <= instrument.marker_mm + kRoundingMm;
      body[i] = {nodes_[i], instrument.model->radius_mm(from_tip),
                 marked ? instrument.marker_1_mm : instrument.attenuation_1_mm};
    }
    if (instrument.inner_radius_mm == 0) continue;
    std::vector<WirePoint>& lumen = next();
    lumen = shot.shadows[shadows - 2];
    for (WirePoint& point : lumen) {
      point.radius_mm = instrument.inner_radius_mm;
      point.attenuation_1_mm = -point.attenuation_1_mm;
    }
  }
}

void Fluoroscopy::TakeDye(Shot& shot) {
  shot.has_dye = contrast_ != nullptr && !contrast_->clear();
  if (!shot.has_dye) return;
  const std::vector<double>& concentration = contrast_->concentration_mg_mL();
  shot.dye_1_mm.resize(lumen_.size());
  const auto scale = static_cast<float>(settings_.iodine_1_mm_mg_mL);
  for (std::size_t i = 0; i < lumen_.size(); ++i) {
    const CellPlace& place = cell_places_[i];
    const auto a = static_cast<float>(concentration[place.cell]);
    const auto b = static_cast<float>(concentration[place.cell + 1]);
    shot.dye_1_mm[i] = scale * (a + place.part * (b - a));
  }
  if (motions_.empty()) return;
  // The displaced position of a lumen point solves a fixed-point equation, since its offset is a
  // function of that position. This is one iteration from the position in the last picture.
  for (std::size_t i = 0; i < lumen_.size(); ++i) {
    if (!(shot.dye_1_mm[i] > 0)) continue;
    vessel::Offset offset;
    const Vector3d now = lumen_[i].position_mm + offsets_[i].cast<double>();
    for (const vessel::FieldMotion* motion : motions_) motion->AddOffset(now, offset);
    offsets_[i] = offset.value.cast<float>();
  }
  shot.offsets = offsets_;
}

void Fluoroscopy::FindBody(const Shot& shot) {
  const Controls& controls = shot.controls;
  // Data from an earlier session are invalid.
  if (shot.session != seen_session_) has_body_ = has_mask_ = false;
  seen_session_ = shot.session;
  const double magnification = controls.imaging.magnification;
  const bool same_view = has_body_ && controls.lao_rad == body_lao_rad_ &&
                         controls.cra_rad == body_cra_rad_ && magnification == body_magnification_;
  if (same_view && shot.organs_mm == body_organs_mm_) return;
  const CArm arm = ArmOf(controls.imaging);
  body_plane_.Clear(arm.width, arm.height);
  const Projection projection(arm, controls.lao_rad, controls.cra_rad);
  Body body = settings_.body;
  body.organs_mm = body_organs_mm_ = shot.organs_mm;
  const float mean = FillWithBody(projection, body, body_plane_);
  if (same_view) return;
  exposure_ = mean;
  has_body_ = true;
  body_lao_rad_ = controls.lao_rad;
  body_cra_rad_ = controls.cra_rad;
  body_magnification_ = magnification;
  // A mask from another angle or field is invalid.
  has_mask_ = false;
}

void Fluoroscopy::PaintDye(const Shot& shot, const Projection& projection) {
  const CArm& arm = settings_.arm;
  dye_.Clear(arm.width, arm.height);
  if (!shot.has_dye) return;
  for (std::size_t i = 0; i < lumen_.size(); ++i) {
    painted_lumen_[i].attenuation_1_mm = shot.dye_1_mm[i];
    if (!shot.offsets.empty()) {
      painted_lumen_[i].position_mm = lumen_[i].position_mm + shot.offsets[i].cast<double>();
    }
  }
  painter_.Begin(arm.width, arm.height);
  for (const Branch& branch : branches_) {
    painter_.Add(projection, &painted_lumen_[branch.first], branch.count);
  }
  painter_.AddTo(projection, dye_);
  Blur(dye_, scratch_);
}

bool Fluoroscopy::Render(Picture& out) {
  const bool is_new = shots_.Fetch();
  const Shot& shot = shots_.Held();
  const CArm arm = ArmOf(shot.controls.imaging);
  FindBody(shot);
  const Projection projection(arm, shot.controls.lao_rad, shot.controls.cra_rad);
  devices_.Clear(arm.width, arm.height);
  for (const std::vector<WirePoint>& shadow : shot.shadows) {
    AddWire(projection, shadow, devices_);
  }
  Blur(devices_, scratch_);
  PaintDye(shot, projection);
  FillWithNoise(settings_.seed, static_cast<std::uint64_t>(shot.number), noise_.data(),
                noise_.size());
  out.width = arm.width;
  out.height = arm.height;
  out.time_s = shot.time_s;
  out.controls = shot.controls;
  out.gray.resize(noise_.size());
  if (ModeOf(shot.controls.imaging) != Mode::kPlain) Subtract(shot);
  Expose(shot, out);
  CoverWithShutters(shot.controls.imaging, out);
  return is_new;
}

// Paints the shutters black, like lead.
void Fluoroscopy::CoverWithShutters(const Imaging& imaging, Picture& out) {
  const auto pixels = [](double share, int of) {
    return static_cast<int>(std::lround(share * of));
  };
  const int left = pixels(imaging.left, out.width);
  const int right = out.width - pixels(imaging.right, out.width);
  const int top = pixels(imaging.top, out.height);
  const int bottom = out.height - pixels(imaging.bottom, out.height);
  for (int row = 0; row < out.height; ++row) {
    const auto begin = out.gray.begin() + static_cast<std::ptrdiff_t>(row) * out.width;
    if (row < top || row >= bottom) {
      std::fill(begin, begin + out.width, std::uint8_t{0});
      continue;
    }
    std::fill(begin, begin + left, std::uint8_t{0});
    std::fill(begin + right, begin + out.width, std::uint8_t{0});
  }
}

// Updates the mask, and the densest dye for the road map.
void Fluoroscopy::Subtract(const Shot& shot) {
  const Mode mode = ModeOf(shot.controls.imaging);
  if (!has_mask_ || (shot.pedal != mask_pedal_ && mode == Mode::kSubtraction)) {
    mask_ = devices_;
    for (std::size_t i = 0; i < mask_.value.size(); ++i) mask_.value[i] += dye_.value[i];
    mask_body_ = body_plane_;
    densest_dye_.Clear(mask_.width, mask_.height);
    FillWithNoise(settings_.seed, kMaskPicture + static_cast<std::uint64_t>(shot.number),
                  mask_noise_.data(), mask_noise_.size());
    has_mask_ = true;
    mask_pedal_ = shot.pedal;
  }
  if (mode != Mode::kRoadmap) return;
  for (std::size_t i = 0; i < dye_.value.size(); ++i) {
    densest_dye_.value[i] = std::max(densest_dye_.value[i], dye_.value[i]);
  }
}

// Converts attenuation to gray: the logarithm of the counts about their mean. N photons have the
// standard deviation sqrt(N), so their logarithm has 1/sqrt(N).
void Fluoroscopy::Expose(const Shot& shot, Picture& out) const {
  const Mode mode = ModeOf(shot.controls.imaging);
  const auto gain = static_cast<float>(settings_.gain) * (mode == Mode::kPlain ? 1.0F : 1.5F);
  const auto sigma = static_cast<float>(1 / std::sqrt(settings_.photons));
  const float background = mode == Mode::kPlain         ? kBackground
                           : mode == Mode::kSubtraction ? kSubtractedBackground
                                                        : kRoadmapBackground;
  const float* const body = body_plane_.value.data();
  const float* const devices = devices_.value.data();
  const float* const dye = dye_.value.data();
  const auto scatter = static_cast<float>(settings_.scatter_to_primary);
  for (std::size_t i = 0; i < out.gray.size(); ++i) {
    const float thick = body[i] - exposure_;
    const float seen = thick + devices[i] + dye[i];
    // Even black metal transmits a photon or two, so the attenuation is limited for the noise.
    const float deviation = sigma / std::sqrt(std::exp(-std::min(seen, 5.0F)) + scatter);
    float value = 0;
    switch (mode) {
      case Mode::kPlain:
        value = (1 - kBodyShown) * WithScatter(thick, scatter) - WithScatter(seen, scatter) +
                deviation * noise_[i];
        break;
      case Mode::kSubtraction:
      case Mode::kRoadmap: {
        const float mask_thick = mask_body_.value[i] - exposure_;
        const float now = mode == Mode::kSubtraction ? seen : thick + devices[i];
        value = scatter == 0
                    ? mask_.value[i] - (now - thick) + (mask_thick - thick)
                    : WithScatter(mask_thick + mask_.value[i], scatter) - WithScatter(now, scatter);
        value += deviation * (noise_[i] - mask_noise_[i]);
        if (mode == Mode::kRoadmap) value += kRoadmapDye * densest_dye_.value[i];
        break;
      }
    }
    const float gray = 255 * (background + gain * value) + 0.5F;
    out.gray[i] = static_cast<std::uint8_t>(std::clamp(gray, 0.0F, 255.0F));
  }
}

namespace {

struct FluoroscopySpec : TableSpec {
  Mode mode = Mode::kPlain;
  std::optional<Vector3d> isocenter_mm;
  std::optional<Vector3d> body_center_mm;
  int width_px = 512;
  int height_px = 512;
  double sid_mm = 1050;
  double sod_mm = 750;
  double detector_mm = 300;
  double pictures_per_s = 15;
  double photons = 600;
  double scatter_to_primary = 0;
  double tube_mA = 10;
  double pulse_ms = 8;
  double tube_mGy_mAs = 0.06;
  double gain = 0.4;
  double iodine_1_mm_mg_mL = 7.6e-4;
  double body_width_mm = 320;
  double body_depth_mm = 220;
  double tissue_1_mm = 0.018;
  double spine_1_mm = 0.01;
  int seed = 1;
};

const Keys<FluoroscopySpec>& FluoroscopyKeys() {
  using Spec = FluoroscopySpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Choice("mode", &Spec::mode, {"plain", "subtraction", "roadmap"},
                  "as the detector sees it; less the first picture since the pedal went down; or "
                  "that with the densest dye so far as a bright map")
          .Otherwise("the middle of the vessel")
          .Point("isocenter_mm", &Spec::isocenter_mm, "mm", "about which the C-arm turns")
          .Otherwise("the middle of the vessel")
          .Point("body_center_mm", &Spec::body_center_mm, "mm", "middle of the patient's body")
          .Integer("width_px", &Spec::width_px, 64, 1024, "columns of the picture")
          .Integer("height_px", &Spec::height_px, 64, 1024, "rows of the picture")
          .Number("sid_mm", &Spec::sid_mm, 500, 2000, "mm", "from the source to the detector")
          .Number("sod_mm", &Spec::sod_mm, 200, 1900, "mm", "from the source to the isocenter")
          .Number("detector_mm", &Spec::detector_mm, 50, 600, "mm", "width of the detector's field")
          .Number("pictures_per_s", &Spec::pictures_per_s, 1, 60, "1/s",
                  "pulses while the pedal is down")
          .Number("photons", &Spec::photons, 10, 1e7, "",
                  "that reach a pixel behind the mean of the body without being scattered")
          .Number("scatter_to_primary", &Spec::scatter_to_primary, 0, 20, "",
                  "as many scattered photons for each of those, the same in every pixel; 1 to 5 "
                  "behind a trunk, a fifth of that behind a grid")
          .Number("tube_mA", &Spec::tube_mA, 0.1, 2000, "mA",
                  "current through 200 mm of tissue; it follows the body's thickness")
          .Number("pulse_ms", &Spec::pulse_ms, 0.1, 100, "ms", "length of a pulse")
          .Number("tube_mGy_mAs", &Spec::tube_mGy_mAs, 1e-4, 1, "mGy/(mA s)",
                  "air kerma of the tube at 1 m, at its voltage and with its filter")
          .Number("gain", &Spec::gain, 0.01, 10, "",
                  "of the gray range, for a factor e in intensity")
          .Number("iodine_1_mm_mg_mL", &Spec::iodine_1_mm_mg_mL, 0, 0.01, "1/mm per mg/mL",
                  "attenuation of iodine per concentration")
          .Number("body_width_mm", &Spec::body_width_mm, 0, 1000, "mm",
                  "of the body from left to right; 0: no body")
          .Number("body_depth_mm", &Spec::body_depth_mm, 10, 1000, "mm",
                  "of the body from front to back")
          .Number("tissue_1_mm", &Spec::tissue_1_mm, 0, 1, "1/mm", "attenuation of the body")
          .Number("spine_1_mm", &Spec::spine_1_mm, 0, 1, "1/mm",
                  "attenuation of the spine beyond the body's")
          .Integer("seed", &Spec::seed, 0, 1000000000,
                   "of the noise; the same gives the same pictures")
          .Checked([](const Spec& spec, StrictTable& table) {
            if (spec.sod_mm < spec.sid_mm) return;
            table.Refuse("sod_mm",
                         "must be less than sid_mm: the isocenter is before the detector");
          })
          .Example(
              "mode = \"subtraction\"\n"
              "isocenter_mm = [22, -4, -28]\n"
              "detector_mm = 200\n");
  return keys;
}

std::unique_ptr<Effect> MakeFluoroscopy(const FluoroscopySpec& spec, const EffectContext& context) {
  FluoroscopySettings s;
  s.mode = spec.mode;
  s.arm.axes = s.body.axes = context.axes;
  s.arm.isocenter_mm = spec.isocenter_mm.value_or(context.bounds_mm.center());
  s.body.center_mm = spec.body_center_mm.value_or(context.bounds_mm.center());
  s.arm.width = spec.width_px;
  s.arm.height = spec.height_px;
  s.arm.sid_mm = spec.sid_mm;
  s.arm.sod_mm = spec.sod_mm;
  s.arm.detector_mm = spec.detector_mm;
  s.pictures_per_s = spec.pictures_per_s;
  s.photons = spec.photons;
  s.scatter_to_primary = spec.scatter_to_primary;
  s.tube_mA = spec.tube_mA;
  s.pulse_ms = spec.pulse_ms;
  s.tube_mGy_mAs = spec.tube_mGy_mAs;
  s.gain = spec.gain;
  s.iodine_1_mm_mg_mL = spec.iodine_1_mm_mg_mL;
  s.body.width_mm = spec.body_width_mm;
  s.body.depth_mm = spec.body_depth_mm;
  s.body.tissue_1_mm = spec.tissue_1_mm;
  s.body.spine_1_mm = spec.spine_1_mm;
  s.seed = static_cast<std::uint64_t>(spec.seed);
  return MakeFluoroscopy(s, context);
}

}  // namespace

std::unique_ptr<Fluoroscopy> MakeFluoroscopy(const FluoroscopySettings& settings,
                                             const EffectContext& context) {
  std::vector<const vessel::FieldMotion*> motions;
  if (context.earlier != nullptr) {
    for (const std::unique_ptr<Effect>& effect : *context.earlier) {
      if (const vessel::FieldMotion* motion = effect->motion()) motions.push_back(motion);
    }
  }
  return std::make_unique<Fluoroscopy>(settings, context.wire, FindEarlier<Contrast>(context),
                                       std::move(motions), context.instruments);
}

EffectKind FluoroscopyKind() {
  return {.name = "fluoroscopy",
          .summary = "the X-ray picture under the C-arm's angles, while the pedal is down",
          .roles = "image, observer",
          .keys = Any(FluoroscopyKeys()),
          .make = MakeWith(MakeFluoroscopy)};
}

}  // namespace torquer::effects
