#include "host/emulator/pmw3360_navigation.h"

#include <algorithm>
#include <cmath>

namespace torquer::emulator {
namespace {

constexpr double kMmPerInch = 25.4;

double Distance_mm(const SurfacePosition& a, const SurfacePosition& b) {
  return std::hypot(a.axial_mm - b.axial_mm, a.transverse_mm - b.transverse_mm);
}

}  // namespace

void SensorNavigation::Restart(double begin_us) {
  begin_us_ = begin_us;
  still_since_us_ = begin_us;
  mode_ = Mode::kRun;
  based_ = false;
  pending_x_ = pending_y_ = 0;
}

void SensorNavigation::Move(const SurfacePosition& to, const Settings& settings, bool counted) {
  double counts_per_mm = settings.cpi / kMmPerInch;
  if (settings.magnification) {
    counts_per_mm *= settings.magnification((to.raised_mm + last_.raised_mm) / 2);
  }
  const double axial = (to.axial_mm - last_.axial_mm) * counts_per_mm;
  const double transverse = (to.transverse_mm - last_.transverse_mm) * counts_per_mm;
  if (!counted) lost_mm_ += Distance_mm(to, last_);
  last_ = to;
  if (!counted) return;
  const double cosine = std::cos(imperfections_.misalignment_rad);
  const double sine = std::sin(imperfections_.misalignment_rad);
  // The board lies along the pipe: y of the sensor is axial, its x runs against the rotation.
  pending_y_ += imperfections_.scale * (cosine * axial + sine * transverse);
  pending_x_ -= imperfections_.scale * (-sine * axial + cosine * transverse);
  if (imperfections_.noise_counts > 0 && (axial != 0 || transverse != 0)) {
    std::normal_distribution<double> noise(0, imperfections_.noise_counts);
    pending_y_ += noise(random_);
    pending_x_ -= noise(random_);
  }
}

void SensorNavigation::Advance(double now_us, const Settings& settings, bool blind) {
  if (!running(now_us)) return;
  if (!based_) {
    last_ = still_ = surface_(begin_us_);
    based_ = true;
  }
  if (!settings.rest_enabled && mode_ != Mode::kRun) {
    mode_ = Mode::kRun;
    still_since_us_ = now_us;
  }
  FollowRest(now_us, settings, blind);
  if (mode_ != Mode::kRun) return;

  const SurfacePosition position = surface_(now_us);
  if (blind) last_ = position;
  const double one_count_mm = kMmPerInch / settings.cpi;
  if (Distance_mm(position, still_) >= one_count_mm) {
    still_since_us_ = now_us;
    still_ = position;
  }
  Move(position, settings, true);
  if (settings.rest_enabled && now_us - still_since_us_ >= settings.downshift_us[0]) {
    mode_ = Mode::kRest1;
    mode_since_us_ = still_since_us_ + settings.downshift_us[0];
    next_frame_us_ = mode_since_us_ + settings.rest_period_us[0];
    FollowRest(now_us, settings, blind);
  }
}

void SensorNavigation::FollowRest(double now_us, const Settings& settings, bool blind) {
  while (mode_ != Mode::kRun && next_frame_us_ <= now_us) {
    const SurfacePosition position = surface_(next_frame_us_);
    if (blind) last_ = position;
    const double moved_mm = Distance_mm(position, last_);
    if (moved_mm >= kMmPerInch / settings.cpi) {
      Move(position, settings, moved_mm <= kCorrelation_mm);
      mode_ = Mode::kRun;
      still_since_us_ = next_frame_us_;
      still_ = position;
      return;
    }
    const auto rest = static_cast<std::size_t>(mode_) - 1;
    if (mode_ != Mode::kRest3 &&
        next_frame_us_ - mode_since_us_ >= settings.downshift_us[rest + 1]) {
      mode_ = static_cast<Mode>(rest + 2);
      mode_since_us_ = next_frame_us_;
    }
    next_frame_us_ += settings.rest_period_us[static_cast<std::size_t>(mode_) - 1];
  }
}

SensorNavigation::Counts SensorNavigation::Take() {
  const auto take = [](double& pending) {
    // Nearest, not down: a hand that stands still on a count's edge must not flicker by rounding.
    const double whole = std::clamp(std::nearbyint(pending), -32768.0, 32767.0);
    pending -= whole;
    return static_cast<int>(whole);
  };
  Counts counts;
  counts.x = take(pending_x_);
  counts.y = take(pending_y_);
  return counts;
}

double SensorNavigation::LatestFrameUs(double now_us, const Settings& settings) const {
  if (!running(now_us)) return -1e12;
  if (mode_ == Mode::kRun) {
    return begin_us_ + std::floor((now_us - begin_us_) / kRunFrame_us) * kRunFrame_us;
  }
  return next_frame_us_ - settings.rest_period_us[static_cast<std::size_t>(mode_) - 1];
}

}  // namespace torquer::emulator
