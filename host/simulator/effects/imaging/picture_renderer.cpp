#include "host/simulator/effects/imaging/picture_renderer.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/effects/imaging/exposure.h"
#include "host/simulator/effects/imaging/fluoroscopy_noise.h"
#include "host/simulator/effects/imaging/wedge_filters.h"

namespace torquer::effects {

using Eigen::Vector3d;
using Mode = FluoroscopySettings::Mode;

namespace {

constexpr float kBackground = 0.56F;  // gray value of the mean exposure, 0 .. 1
// Displayed fraction of the body's contrast. Slow changes are compressed, as in real systems, so
// that thin and thick parts fit into the gray range together.
constexpr float kBodyShown = 0.6F;
// Largest displayed contrast of the body: lungs, and air beside the body, are not burnt out.
constexpr float kMostShown = 0.9F;
constexpr float kSubtractedBackground = 0.78F;  // gray value of unchanged pixels
constexpr float kRoadmapBackground = 0.5F;
constexpr float kRoadmapDye = 0.6F;  // weight of the map against the dye itself
constexpr std::uint64_t kMaskPicture =
    1ULL << 40;  // gives the mask its own noise, unlike that of any picture

// The part of a slow change that a picture does not show.
float Hidden(float contrast) {
  const float shown = kBodyShown * contrast;
  const float part = shown / kMostShown;
  return contrast - shown / std::sqrt(1 + part * part);
}

}  // namespace

float WithScatter(float integral, float scatter_to_primary) {
  if (scatter_to_primary == 0) return integral;
  return -std::log((std::exp(-integral) + scatter_to_primary) / (1 + scatter_to_primary));
}

PictureRenderer::PictureRenderer(const FluoroscopySettings& settings, const DyePoints& dye)
    : settings_(settings), dye_points_(dye), painted_(dye.points) {
  const auto pixels =
      static_cast<std::size_t>(settings.arm.width) * static_cast<std::size_t>(settings.arm.height);
  noise_.resize(pixels);
  memory_.mask_noise.resize(pixels);
}

void PictureRenderer::FindBody(const XrayFrame& frame) {
  const Controls& controls = frame.controls;
  // Data from an earlier session are invalid.
  if (frame.session != memory_.seen_session) memory_.has_body = memory_.has_mask = false;
  memory_.seen_session = frame.session;
  const View view = ViewOf(controls);
  bool same_view = memory_.has_body && view == memory_.body_view;
  // C-arm and table may have come back while pictures were dropped.
  if (settings_.scan != nullptr && frame.still < memory_.body_still) same_view = false;
  memory_.body_still = frame.still;
  const Projection projection = settings_.ProjectionOf(controls);
  if (same_view && settings_.scan != nullptr) {
    RefineScan(projection, frame.still);
    return;
  }
  if (same_view && frame.organs_mm == memory_.body_organs_mm) return;
  memory_.body_plane.Clear(settings_.arm.width, settings_.arm.height);
  const float mean = FillBody(projection, frame.organs_mm);
  if (same_view) return;
  memory_.exposure = mean;
  memory_.has_body = true;
  memory_.body_view = view;
  // A mask from another view is invalid.
  memory_.has_mask = false;
  if (settings_.scan != nullptr) RefineScan(projection, frame.still);
}

// Fills the plane of the body. Returns the mean in the field's middle.
float PictureRenderer::FillBody(const Projection& projection, const Vector3d& organs_mm) {
  memory_.fine_parts = 0;
  if (settings_.scan != nullptr)
    return settings_.scan->FillCoarsely(projection, memory_.body_plane);
  Body body = settings_.body;
  body.organs_mm = memory_.body_organs_mm = organs_mm;
  const float mean = FillWithBody(projection, body, memory_.body_plane);
  if (body.tubes != nullptr) {
    memory_.body_smooth = memory_.body_plane;
    AddTubes(projection, body, memory_.body_plane);
  }
  return mean;
}

// Refines the plane of a scan as far as pictures of this view allow. The scan is at
// rest, so the mask has the same plane.
void PictureRenderer::RefineScan(const Projection& projection, std::int64_t still) {
  const int parts = CtBody::FineParts(still, memory_.body_plane);
  if (parts <= memory_.fine_parts) return;
  settings_.scan->Refine(projection, memory_.fine_parts, parts, memory_.body_plane);
  memory_.fine_parts = parts;
  if (memory_.has_mask) memory_.mask_body = memory_.body_plane;
}

void PictureRenderer::PaintDye(const XrayFrame& frame, const Projection& projection) {
  const CArm& arm = settings_.arm;
  dye_.Clear(arm.width, arm.height);
  if (!frame.has_dye) return;
  for (std::size_t i = 0; i < dye_points_.points.size(); ++i) {
    painted_[i].attenuation_1_mm = frame.dye_1_mm[i];
    if (!frame.offsets.empty()) {
      painted_[i].position_mm = dye_points_.points[i].position_mm + frame.offsets[i].cast<double>();
    }
  }
  painter_.Begin(arm.width, arm.height);
  for (const DyePoints::Branch& branch : dye_points_.branches) {
    painter_.Add(projection, &painted_[branch.first], branch.count);
  }
  painter_.AddTo(projection, dye_);
  Blur(dye_, scratch_);
}

void PictureRenderer::Render(const XrayFrame& frame, ImageSource::Picture& out) {
  const CArm& arm = settings_.arm;
  FindBody(frame);
  const Projection projection = settings_.ProjectionOf(frame.controls);
  devices_.Clear(arm.width, arm.height);
  for (const std::vector<WirePoint>& shadow : frame.shadows) {
    AddWire(projection, shadow, devices_);
  }
  Blur(devices_, scratch_);
  PaintDye(frame, projection);
  FillWithNoise(settings_.seed, static_cast<std::uint64_t>(frame.number), noise_.data(),
                noise_.size());
  out.width = arm.width;
  out.height = arm.height;
  out.time_s = frame.time_s;
  out.controls = frame.controls;
  out.gray.resize(noise_.size());
  if (FluoroscopySettings::HasMask(settings_.ModeOf(frame.controls.imaging))) Subtract(frame);
  FillWedges(frame.controls.imaging);
  Expose(frame, out);
  CoverWithShutters(frame.controls.imaging, out);
}

// Finds the shadows of the wedges. They change slowly across the picture, so a plain picture shows
// the same fraction of them as of the body. A subtraction shows how far they moved since its mask.
void PictureRenderer::FillWedges(const Imaging& imaging) {
  const bool is_plain = !FluoroscopySettings::HasMask(settings_.ModeOf(imaging));
  const WedgeView view{imaging, is_plain ? Imaging{} : memory_.mask_imaging};
  if (view == wedge_view_) return;
  wedge_view_ = view;
  const double aspect = static_cast<double>(settings_.arm.height) / settings_.arm.width;
  const WedgeShadows now(view.now, aspect);
  const WedgeShadows mask(view.mask, aspect);
  has_wedges_ = now.any() || mask.any();
  if (!has_wedges_) return;
  wedges_.Clear(settings_.arm.width, settings_.arm.height);
  now.Fill(wedges_);
  wedges_shown_ = wedges_;
  // A wedge takes the same part of the photons that scatter.
  for (float& value : wedges_.value) value = std::exp(0.5F * value);
  if (is_plain) {
    for (float& value : wedges_shown_.value) value *= kBodyShown;
  } else if (mask.any()) {
    Plane& of_mask = scratch_;
    of_mask.Clear(wedges_.width, wedges_.height);
    mask.Fill(of_mask);
    for (std::size_t i = 0; i < of_mask.value.size(); ++i) {
      wedges_shown_.value[i] -= of_mask.value[i];
    }
  }
}

// Paints the shutters black, like lead.
void PictureRenderer::CoverWithShutters(const Imaging& imaging, ImageSource::Picture& out) {
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
void PictureRenderer::Subtract(const XrayFrame& frame) {
  const Mode mode = settings_.ModeOf(frame.controls.imaging);
  if (!memory_.has_mask || (frame.pedal != memory_.mask_pedal && mode == Mode::kSubtraction)) {
    memory_.mask = devices_;
    for (std::size_t i = 0; i < dye_.value.size(); ++i) memory_.mask.value[i] += dye_.value[i];
    memory_.mask_body = memory_.body_plane;
    memory_.densest_dye.Clear(memory_.mask.width, memory_.mask.height);
    FillWithNoise(settings_.seed, kMaskPicture + static_cast<std::uint64_t>(frame.number),
                  memory_.mask_noise.data(), memory_.mask_noise.size());
    memory_.has_mask = true;
    memory_.mask_imaging = frame.controls.imaging;
    memory_.mask_photons = ExposureOf(settings_, frame.controls).photons;
    memory_.mask_pedal = frame.pedal;
  }
  if (mode != Mode::kRoadmap) return;
  for (std::size_t i = 0; i < dye_.value.size(); ++i) {
    memory_.densest_dye.value[i] = std::max(memory_.densest_dye.value[i], dye_.value[i]);
  }
}

// Converts attenuation to gray: the logarithm of the counts about their mean. N photons have the
// standard deviation sqrt(N), so their logarithm has 1/sqrt(N).
void PictureRenderer::Expose(const XrayFrame& frame, ImageSource::Picture& out) const {
  const Mode mode = settings_.ModeOf(frame.controls.imaging);
  const bool has_mask = FluoroscopySettings::HasMask(mode);
  const auto gain = static_cast<float>(settings_.gain) * (has_mask ? 1.5F : 1.0F);
  const double photons = ExposureOf(settings_, frame.controls).photons;
  const auto sigma = static_cast<float>(1 / std::sqrt(photons));
  const auto mask_noise = static_cast<float>(std::sqrt(photons / memory_.mask_photons));
  const float background = !has_mask                    ? kBackground
                           : mode == Mode::kSubtraction ? kSubtractedBackground
                                                        : kRoadmapBackground;
  const float* const body = memory_.body_plane.value.data();
  const Plane& smooth =
      memory_.body_smooth.value.empty() ? memory_.body_plane : memory_.body_smooth;
  const float* const devices = devices_.value.data();
  const float* const dye = dye_.value.data();
  const auto scatter = static_cast<float>(settings_.scatter_to_primary);
  for (std::size_t i = 0; i < out.gray.size(); ++i) {
    const float thick = body[i] - memory_.exposure;
    const float seen = thick + devices[i] + dye[i];
    // Even black metal transmits a photon or two, so the attenuation is limited for the noise.
    float deviation = sigma / std::sqrt(std::exp(-std::min(seen, 5.0F)) + scatter);
    if (has_wedges_) deviation *= wedges_.value[i];
    float value = 0;
    switch (mode) {
      case Mode::kPlain:
      case Mode::kCine:
        value = Hidden(WithScatter(smooth.value[i] - memory_.exposure, scatter)) -
                WithScatter(seen, scatter) + deviation * noise_[i];
        break;
      case Mode::kSubtraction:
      case Mode::kRoadmap: {
        const float mask_thick = memory_.mask_body.value[i] - memory_.exposure;
        const float now = mode == Mode::kSubtraction ? seen : thick + devices[i];
        value = scatter == 0 ? memory_.mask.value[i] - (now - thick) + (mask_thick - thick)
                             : WithScatter(mask_thick + memory_.mask.value[i], scatter) -
                                   WithScatter(now, scatter);
        value += deviation * (noise_[i] - mask_noise * memory_.mask_noise[i]);
        if (mode == Mode::kRoadmap) value += kRoadmapDye * memory_.densest_dye.value[i];
        break;
      }
    }
    if (has_wedges_) value -= wedges_shown_.value[i];
    const float gray = 255 * (background + gain * value) + 0.5F;
    out.gray[i] = static_cast<std::uint8_t>(std::clamp(gray, 0.0F, 255.0F));
  }
}

}  // namespace torquer::effects
