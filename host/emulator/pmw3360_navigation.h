// Navigation of a PMW3360: frames, rest modes and counts from the surface that moves below it. It
// does not handle SPI.
#pragma once

#include <cstdint>
#include <functional>
#include <random>

namespace torquer::emulator {

/// Differences between a sensor and an ideal, straight sensor.
struct SensorImperfections {
  double misalignment_rad = 0;  ///< of its axes, right-handed as seen from outside the cylinder
  double scale = 1;             ///< counts seen over counts nominal
  double noise_counts = 0;  ///< standard deviation of the noise of each moving reading, per axis
  /// Mean time between spontaneous resets of the sensor (static discharge, a dip of its supply), s;
  /// 0: none. The times are random, by the device's seed.
  double self_reset_interval_s = 0;
  /// Pessimistic reading of the data sheet: the write that arms a motion burst clears the motion.
  bool arming_clears = false;
};

/// A place on the surface under the sensor.
struct SurfacePosition {
  double axial_mm = 0;       ///< positive distally
  double transverse_mm = 0;  ///< along the circumference, positive right-handed
  double raised_mm = 0;      ///< nearer to the lens than at rest
};

class SensorNavigation {
 public:
  /// Settings of the registers, converted by the formulas of the data sheet.
  struct Settings {
    int cpi = 5000;
    bool rest_enabled = true;
    /// Time without motion after which the next mode begins, us: run, rest 1, rest 2.
    double downshift_us[3] = {0, 0, 0};
    /// From frame to frame, us: rest 1, 2, 3.
    double rest_period_us[3] = {0, 0, 0};
    /// Counts for a motion over nominal ones, by the height of the surface; empty: 1.
    std::function<double(double raised_mm)> magnification;
  };
  /// OP_Mode of the motion register.
  enum class Mode : std::uint8_t { kRun = 0, kRest1 = 1, kRest2 = 2, kRest3 = 3 };

  struct Counts {
    int x = 0;
    int y = 0;
  };

  /// The slowest that a frame in run mode is assumed to be. The data sheet says "up to 12000 fps".
  static constexpr double kRunFrame_us = 500;
  /// Largest motion of the surface between two frames that the sensor recognizes: 250 ips at 12000
  /// frames a second. What moved farther is lost.
  static constexpr double kCorrelation_mm = 0.53;

  SensorNavigation(const SensorImperfections& imperfections, std::uint32_t seed)
      : imperfections_(imperfections), random_(seed) {}

  /// Asked in rising order of time.
  void SetSurface(std::function<SurfacePosition(double now_us)> surface) {
    surface_ = std::move(surface);
  }

  /// Sets the state after a reset: no counts; frames are taken from `begin_us` on.
  void Restart(double begin_us);
  /// Takes the frames up to now. While `blind`, the sensor sees no motion, and the current position
  /// of the surface becomes its new reference.
  void Advance(double now_us, const Settings& settings, bool blind);
  /// Takes whole counts, -32768 .. 32767; the rest stays for the next time.
  Counts Take();

  Mode mode() const { return mode_; }
  bool running(double now_us) const { return now_us >= begin_us_; }
  /// Motion that came and went between two frames of a rest mode, since the beginning.
  double lost_mm() const { return lost_mm_; }
  /// Time of the latest frame before `now_us`.
  double LatestFrameUs(double now_us, const Settings& settings) const;

 private:
  void Move(const SurfacePosition& to, const Settings& settings, bool counted);
  void FollowRest(double now_us, const Settings& settings, bool blind);

  SensorImperfections imperfections_;
  std::mt19937 random_;
  std::function<SurfacePosition(double)> surface_ = [](double) { return SurfacePosition{}; };
  Mode mode_ = Mode::kRun;
  double begin_us_ = 0;
  double still_since_us_ = 0;  // in run mode
  SurfacePosition still_;
  double mode_since_us_ = 0;
  double next_frame_us_ = 0;  // of a rest mode
  bool based_ = false;
  SurfacePosition last_;
  double pending_x_ = 0;  // counts along the sensor's axes
  double pending_y_ = 0;
  double lost_mm_ = 0;
};

}  // namespace torquer::emulator
